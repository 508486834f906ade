//! From the numbers of a row to linear sRGB and its standard deviation.

use crate::base::error::Result;
use crate::brdf::Rgb;
use crate::formats::measured::collector::{Collector, Sigma};
use crate::formats::measured::input::Input;
use crate::formats::measured::spectrum::{SpectrumToRgb, sparse, srgb_from_xyz};
use crate::formats::measured::text::table::Header;
use crate::formats::measured::text::values::{SigmaColumns, ValueColumns, Values};

/// A value, the numbers that it is made of and its standard deviation.
pub(crate) type Coloured = (Rgb, Vec<f64>, Sigma);

/// Makes linear sRGB of the numbers of a row.
pub(crate) struct Colours<'a> {
    columns: &'a ValueColumns,
    /// The map from a spectrum, where there are several wavelengths.
    map: Option<SpectrumToRgb>,
    /// The wavelengths of each direction, where they have a row each.
    wavelengths: Vec<f64>,
    /// The angles of the spectrum that is being read, and its values and standard deviations so far.
    open: Option<([f64; 4], u64)>,
    spectrum: Vec<f64>,
    sigma: Vec<f64>,
}

impl<'a> Colours<'a> {
    pub(crate) fn new(
        input: &Input<'_>,
        columns: &'a ValueColumns,
        header: &Header,
        numbers: &[f64],
        collector: &mut Collector<'_>,
    ) -> Result<Self> {
        let mut wavelengths = match &columns.values {
            Values::Spectrum { wavelengths, .. } => wavelengths.clone(),
            Values::Long { nm, .. } => {
                let width = columns.indices().len();
                numbers.iter().skip(1).step_by(width).map(|wavelength| nm * wavelength).collect()
            }
            _ => Vec::new(),
        };
        wavelengths.sort_by(f64::total_cmp);
        wavelengths.dedup();
        if let Some(least) = wavelengths.first().filter(|&&least| least < 100.0) {
            return Err(input.wrong(
                "wavelengths in nm, or their unit in the name of their column, as in `wavelength [um]`",
                format!("{least} under {}", header.listed()),
            ));
        }
        let map = if wavelengths.len() > 1 {
            let map = SpectrumToRgb::new(&wavelengths).ok_or_else(|| {
                input.wrong(
                    "one wavelength, or several that reach into 380 to 780 nm",
                    format!("{} to {}", wavelengths[0], wavelengths[wavelengths.len() - 1]),
                )
            })?;
            sparse(&wavelengths).into_iter().for_each(|notice| collector.notice(notice));
            Some(map)
        } else {
            None
        };
        Ok(Self { columns, map, wavelengths, open: None, spectrum: Vec::new(), sigma: Vec::new() })
    }

    /// The colour of a row, or `None` if more wavelengths of its directions follow.
    pub(crate) fn add(
        &mut self,
        input: &Input<'_>,
        numbers: &[f64],
        angles: [f64; 4],
        line: u64,
    ) -> Result<Option<Coloured>> {
        let count = match &self.columns.values {
            Values::Grey(_) => 1,
            Values::Rgb(_) | Values::Xyz(_) => 3,
            Values::Spectrum { columns, .. } => columns.len(),
            Values::Long { .. } => 2,
        };
        let (values, sigmas) = numbers.split_at(count);
        if let Some(found) = sigmas.iter().find(|sigma| **sigma < 0.0) {
            let expected = format!("a standard deviation of at least 0 on line {line}");
            return Err(input.wrong(expected, found.to_string()));
        }
        let sigma = match (&self.columns.sigma, sigmas) {
            (SigmaColumns::Relative(_, scale), [share]) => Sigma::Relative(scale * share),
            (_, [sigma]) => Sigma::Absolute([*sigma; 3]),
            (_, &[r, g, b]) => Sigma::Absolute([r, g, b]),
            _ => Sigma::Unknown,
        };
        let value = match (&self.columns.values, values) {
            (Values::Xyz(_), &[x, y, z]) => srgb_from_xyz([x, y, z]),
            (Values::Rgb(_), &[r, g, b]) => [r, g, b],
            (Values::Long { nm, .. }, &[value, wavelength]) => {
                return self.add_long(input, value, nm * wavelength, sigma, angles, line);
            }
            (_, values) => match &self.map {
                Some(map) => map.rgb(values.iter().copied()),
                None => [values[0]; 3],
            },
        };
        Ok(Some((value, values.to_vec(), sigma)))
    }

    /// Adds one wavelength of a spectrum whose wavelengths follow each other in rows.
    fn add_long(
        &mut self,
        input: &Input<'_>,
        value: f64,
        wavelength: f64,
        sigma: Sigma,
        angles: [f64; 4],
        line: u64,
    ) -> Result<Option<Coloured>> {
        let Some(map) = &self.map else { return Ok(Some(([value; 3], vec![value], sigma))) };
        let expected = self.wavelengths[self.spectrum.len()];
        if wavelength != expected || self.open.is_some_and(|(open, _)| open != angles) {
            return Err(input.wrong(
                format!(
                    "on line {line} a row for {expected} nm, as each direction has a row for each of {} \
                     wavelengths in increasing order",
                    self.wavelengths.len()
                ),
                format!(
                    "{wavelength} nm{}",
                    if wavelength == expected { " of another direction" } else { "" }
                ),
            ));
        }
        self.open = Some((angles, line));
        self.spectrum.push(value);
        match sigma {
            Sigma::Absolute(sigma) => self.sigma.push(sigma[0]),
            Sigma::Relative(share) => self.sigma.push(share * value.abs()),
            Sigma::Unknown => {}
        }
        if self.spectrum.len() < self.wavelengths.len() {
            return Ok(None);
        }
        self.open = None;
        let raw = std::mem::take(&mut self.spectrum);
        let sigma = std::mem::take(&mut self.sigma);
        let sigma =
            if sigma.is_empty() { Sigma::Unknown } else { Sigma::Absolute(map.sigma(sigma.iter().copied())) };
        Ok(Some((map.rgb(raw.iter().copied()), raw, sigma)))
    }

    /// Refuses a spectrum that ends with the file.
    pub(crate) fn check_complete(&self, input: &Input<'_>) -> Result<()> {
        match self.open {
            None => Ok(()),
            Some((_, line)) => Err(input.wrong(
                format!("{} wavelengths of each direction", self.wavelengths.len()),
                format!("{} of the one on line {line}", self.spectrum.len()),
            )),
        }
    }
}
