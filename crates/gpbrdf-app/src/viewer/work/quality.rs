//! How close the picture of an object's prediction is to that of its truth, measured on a thread of its own
//! while the pictures get smoother. Both are exposed as in the image metrics, whatever the exposure on the screen.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use gpbrdf_core::judge::{exposure_of, psnr, ssim};
use gpbrdf_render::LinearPicture;

use super::mailbox::{Mailbox, Sender};
use super::outbox::Outbox;
use crate::viewer::state::document::DocumentId;

/// Pictures to compare.
#[derive(Debug)]
pub(crate) struct Measured {
    pub(crate) document: DocumentId,
    pub(crate) picture: u64,
    pub(crate) samples: u32,
    pub(crate) linear: Arc<LinearPicture>,
}

/// How close truth and prediction are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Quality {
    pub(crate) document: DocumentId,
    /// The picture that was measured, and how many samples per pixel it had.
    pub(crate) picture: u64,
    pub(crate) samples: u32,
    pub(crate) psnr: f64,
    pub(crate) ssim: f64,
}

/// The thread that compares.
pub(crate) struct Measurer {
    sender: Sender<Measured>,
    idle: Arc<AtomicBool>,
    last: Option<(u64, u32)>,
}

/// The longest rest between two measurements.
const REST: Duration = Duration::from_millis(400);

impl Measurer {
    /// Starts the thread.
    pub(crate) fn spawn(outbox: Outbox<Quality>) -> std::io::Result<Self> {
        let idle = Arc::new(AtomicBool::new(true));
        let theirs = Arc::clone(&idle);
        let sender = Mailbox::spawn("quality", move |measured: Measured, stale| {
            theirs.store(false, Ordering::Relaxed);
            let start = Instant::now();
            if let Some(quality) = measure(&measured) {
                outbox.send(quality);
            }
            // Take half of a processor's time at most, unless a newer picture waits already.
            let rest = start.elapsed().min(REST);
            let until = Instant::now() + rest;
            while Instant::now() < until && !stale() {
                std::thread::sleep(Duration::from_millis(5));
            }
            theirs.store(true, Ordering::Relaxed);
        })?;
        Ok(Self { sender, idle, last: None })
    }

    /// Whether a picture is worth reading back: always after its first and its last samples, and in between
    /// when the thread is idle.
    pub(crate) fn wants(&self, picture: u64, samples: u32, last: bool) -> bool {
        let new = self.last.is_none_or(|(known, _)| known != picture);
        self.last != Some((picture, samples)) && (new || last || self.idle.load(Ordering::Relaxed))
    }

    /// Takes a picture in place of an older one.
    pub(crate) fn put(&mut self, measured: Measured) {
        self.last = Some((measured.picture, measured.samples));
        self.sender.put(measured);
    }
}

fn measure(measured: &Measured) -> Option<Quality> {
    let (truth, prediction) = measured.linear.images().ok()?;
    let exposure = exposure_of(&truth);
    Some(Quality {
        document: measured.document,
        picture: measured.picture,
        samples: measured.samples,
        psnr: psnr(&truth, &prediction, exposure).ok()?,
        ssim: ssim(&truth, &prediction, exposure).ok()?,
    })
}
