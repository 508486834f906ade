//! Parsers of options that hold several numbers, or a number or a word.

/// Numbers joined by commas.
fn parse_numbers<const N: usize>(text: &str) -> Option<[f32; N]> {
    let numbers: Option<Vec<f32>> =
        text.split(',').map(|part| part.trim().parse().ok().filter(|x: &f32| x.is_finite())).collect();
    numbers?.try_into().ok()
}

pub(crate) fn parse_vector(text: &str) -> Result<[f32; 3], String> {
    parse_numbers(text).ok_or_else(|| "expected three numbers like 1,1,1.5".into())
}

pub(crate) fn parse_pair(text: &str) -> Result<[f32; 2], String> {
    parse_numbers(text).ok_or_else(|| "expected two numbers like 30,20".into())
}

/// Columns and rows, as `640x480`.
pub(crate) fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let sides: Option<Vec<u32>> =
        text.split(['x', 'X']).map(|side| side.parse().ok().filter(|&n| n > 0)).collect();
    sides.and_then(|s| s.try_into().ok()).ok_or_else(|| "expected two positive numbers like 640x480".into())
}

/// How bright a picture is shown.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Exposure {
    /// Chosen by the picture.
    Auto,
    Stops(f32),
}

pub(crate) fn parse_exposure(text: &str) -> Result<Exposure, String> {
    if text == "auto" {
        return Ok(Exposure::Auto);
    }
    match text.parse::<f32>() {
        Ok(stops) if stops.abs() <= 60.0 => Ok(Exposure::Stops(stops)),
        _ => Err("expected auto or a number of stops within -60 and 60".into()),
    }
}

/// A number from `low` to `high`.
pub(crate) fn parse_number_in(text: &str, low: f64, high: f64) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (low..=high).contains(&value) => Ok(value),
        _ => Err(format!("expected a number from {low} to {high}")),
    }
}

pub(crate) fn parse_positive(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("expected a positive number".into()),
    }
}
