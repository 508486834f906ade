//! What is drawn. Functions named `*_ui` draw and never wait.

pub(crate) mod half_disc;
pub(crate) mod hint;
pub(crate) mod layout;
pub(crate) mod menu;
pub(crate) mod messages;
pub(crate) mod navigate;
pub(crate) mod pane;
pub(crate) mod panes;
pub(crate) mod shortcuts;
pub(crate) mod status;
pub(crate) mod theme;
pub(crate) mod ticks;
pub(crate) mod widgets;
pub(crate) mod windows;
