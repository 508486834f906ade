//! What threads do, so that a frame of the window never waits. Each kind of work serves the newest request
//! that it is given and sends results of its own type to an outbox.

pub(crate) mod curves;
pub(crate) mod dialogs;
pub(crate) mod export;
pub(crate) mod fitter;
mod grain;
pub(crate) mod mailbox;
pub(crate) mod outbox;
pub(crate) mod planner;
pub(crate) mod quality;
pub(crate) mod scene;
pub(crate) mod slices;
pub(crate) mod sphere_metrics;
pub(crate) mod watcher;
