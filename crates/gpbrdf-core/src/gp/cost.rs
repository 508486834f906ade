//! A forecast of the memory and the time of a fit.

use crate::base::error::{Error, Result};

/// The forecast for a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitCost {
    /// Name of the solver.
    pub solver: &'static str,
    /// Number of samples.
    pub samples: usize,
    /// Memory in bytes.
    pub bytes: f64,
    /// Wall-clock time in seconds, from a speed of this machine that is measured once.
    pub seconds: f64,
}

impl FitCost {
    /// Refuses a fit that needs more memory than is available.
    ///
    /// # Errors
    /// [`Error::TooLarge`] with the memory that is needed, the limit and the time.
    pub fn check(&self) -> Result<()> {
        self.check_against(available_bytes())
    }

    fn check_against(&self, limit: f64) -> Result<()> {
        const GIB: f64 = 1_073_741_824.0;
        if self.bytes <= limit {
            return Ok(());
        }
        Err(Error::TooLarge {
            solver: self.solver,
            samples: self.samples,
            need_gib: self.bytes / GIB,
            limit_gib: limit / GIB,
            need_seconds: self.seconds,
        })
    }
}

/// Memory that is assumed to be available where the system does not report it: 4 GiB.
const ASSUMED_BYTES: f64 = 4.0 * 1_073_741_824.0;

/// Memory that is available without swapping, in bytes: `MemAvailable` of Linux, 4 GiB elsewhere.
#[must_use]
pub fn available_bytes() -> f64 {
    let parse = |text: String| {
        let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?.trim();
        let kib: f64 = line.strip_suffix("kB")?.trim().parse().ok()?;
        Some(kib * 1024.0)
    };
    std::fs::read_to_string("/proc/meminfo").ok().and_then(parse).unwrap_or(ASSUMED_BYTES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused_with_both_figures() {
        let cost = FitCost { solver: "dense", samples: 37_616, bytes: 3.0 * 1_073_741_824.0, seconds: 480.0 };
        assert!(cost.check_against(3.5 * 1_073_741_824.0).is_ok());
        let message = cost.check_against(2.0 * 1_073_741_824.0).unwrap_err().to_string();
        for part in ["37616 samples", "at most 2.0 GiB", "need of 3.0 GiB", "480 s"] {
            assert!(message.contains(part), "{message}");
        }
        assert!(available_bytes() > 1e6);
    }
}
