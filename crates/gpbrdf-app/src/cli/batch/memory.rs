//! The memory that the materials of a batch share.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use gpbrdf_core::gp::available_bytes;

/// The share of the available memory that a batch takes unless it is told otherwise.
const SHARE: f64 = 0.8;

const GIB: f64 = 1_073_741_824.0;

/// Memory that is handed out to materials and given back.
#[derive(Debug)]
pub(super) struct Memory {
    bytes: f64,
    reserved: Mutex<Reserved>,
    returned: Condvar,
}

#[derive(Debug, Default)]
struct Reserved {
    bytes: f64,
    materials: usize,
}

/// Memory that is reserved until this is dropped.
#[derive(Debug)]
#[must_use = "the memory is given back when this is dropped"]
pub(super) struct Reservation<'a> {
    memory: &'a Memory,
    bytes: f64,
}

impl Memory {
    /// As many GiB, or four fifths of what is available.
    pub(super) fn new(gib: Option<f64>) -> Self {
        let bytes = gib.map_or_else(|| SHARE * available_bytes(), |gib| gib * GIB);
        Self { bytes, reserved: Mutex::default(), returned: Condvar::new() }
    }

    /// Waits until so many bytes are left, or no other material holds any: one by one, the largest are tried, too.
    pub(super) fn reserve(&self, bytes: f64) -> Reservation<'_> {
        let mut reserved = self.lock();
        while reserved.materials > 0 && reserved.bytes + bytes > self.bytes {
            reserved = self.returned.wait(reserved).unwrap_or_else(PoisonError::into_inner);
        }
        reserved.bytes += bytes;
        reserved.materials += 1;
        Reservation { memory: self, bytes }
    }

    fn lock(&self) -> MutexGuard<'_, Reserved> {
        // A panic elsewhere leaves the sums usable.
        self.reserved.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Reservation<'_> {
    fn drop(&mut self) {
        let mut reserved = self.memory.lock();
        reserved.bytes -= self.bytes;
        reserved.materials -= 1;
        self.memory.returned.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    use super::*;

    #[test]
    fn materials_wait_for_memory_and_the_largest_runs_alone() {
        let memory = Memory::new(Some(1.0));
        let (running, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
        std::thread::scope(|scope| {
            for gib in [0.4, 0.4, 0.4, 0.4, 7.0] {
                let (memory, running, most) = (&memory, &running, &most);
                scope.spawn(move || {
                    let _held = memory.reserve(gib * GIB);
                    let now = running.fetch_add(1, Ordering::SeqCst) + 1;
                    assert!(gib < 1.0 || now == 1);
                    most.fetch_max(now, Ordering::SeqCst);
                    std::thread::sleep(Duration::from_millis(30));
                    running.fetch_sub(1, Ordering::SeqCst);
                });
            }
        });
        assert_eq!(most.load(Ordering::SeqCst), 2);
        assert_eq!(memory.lock().materials, 0);
    }
}
