//! Samples written as comma-separated values.

use std::io::{self, Write};
use std::path::Path;

use crate::base::atomic_file::AtomicFile;
use crate::base::error::{Error, Result};
use crate::sample::{Sample, SampleSet};

/// Writes samples with the columns `theta_i_deg, phi_i_deg, theta_o_deg, phi_o_deg, r, g, b`, and `sigma_r,
/// sigma_g, sigma_b` where the standard deviation is known. When they are read back, values are equal to the
/// bit and directions to rounding.
///
/// # Errors
/// [`Error::Io`] when the file cannot be written; no part of it is left then.
pub fn write_samples_csv(path: impl AsRef<Path>, samples: &SampleSet) -> Result<()> {
    let mut file = AtomicFile::create(path.as_ref())?;
    write_samples_csv_to(&mut file, samples).map_err(|source| Error::write(path.as_ref(), source))?;
    file.commit()
}

/// Like [`write_samples_csv`], but writes to any writer.
///
/// # Errors
/// Any error of `to`.
pub fn write_samples_csv_to(mut to: impl Write, samples: &SampleSet) -> io::Result<()> {
    for line in samples.description.lines() {
        writeln!(to, "# {line}")?;
    }
    write!(to, "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b")?;
    writeln!(to, "{}", if samples.sigma.is_empty() { "" } else { ",sigma_r,sigma_g,sigma_b" })?;
    for (i, Sample { wi, wo, value }) in samples.iter().enumerate() {
        for w in [wi, wo] {
            let theta = w.x.hypot(w.y).atan2(w.z).to_degrees();
            write!(to, "{theta},{},", w.y.atan2(w.x).to_degrees())?;
        }
        write!(to, "{},{},{}", value[0], value[1], value[2])?;
        if let Some(sigma) = samples.sigma.get(i) {
            write!(to, ",{},{},{}", sigma[0], sigma[1], sigma[2])?;
        }
        writeln!(to)?;
    }
    to.flush()
}
