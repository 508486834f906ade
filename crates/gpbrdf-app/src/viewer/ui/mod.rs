//! What is drawn.

pub(crate) mod layout;
pub(crate) mod menu;
pub(crate) mod panes;
pub(crate) mod shortcuts;
pub(crate) mod status;
pub(crate) mod widgets;
pub(crate) mod windows;
