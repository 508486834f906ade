//! The name of a column, taken apart into words and a unit.

/// A name without its unit.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Name {
    /// Lower-case letters and digits only, with Greek letters spelt out.
    pub(crate) word: String,
    /// The unit, in lower case and without brackets; empty if there is none.
    pub(crate) unit: String,
}

/// Endings that are units without brackets, as in `theta_i_deg`.
const ENDINGS: [&str; 10] = ["deg", "degree", "degrees", "°", "º", "rad", "radian", "radians", "nm", "um"];

impl Name {
    pub(crate) fn new(text: &str) -> Self {
        let text = text.trim().to_lowercase();
        let (base, unit) = take_unit(&text);
        let mut word = String::new();
        for c in base.chars() {
            match c {
                'θ' | 'ϑ' => word.push_str("theta"),
                'φ' | 'ϕ' => word.push_str("phi"),
                'δ' | 'Δ' => word.push_str("delta"),
                'λ' => word.push_str("lambda"),
                'σ' => word.push_str("sigma"),
                'ρ' => word.push_str("rho"),
                _ if c.is_alphanumeric() || c == '.' => word.push(c),
                _ => {}
            }
        }
        Self { word, unit: unit.replace(['µ', 'μ'], "u") }
    }
}

/// Parts `theta_i [deg]`, `theta_i / deg` and `theta_i_deg`.
fn take_unit(text: &str) -> (&str, String) {
    if let Some((base, unit)) = text.split_once(['[', '(', '{']) {
        return (base, unit.trim_end_matches([']', ')', '}']).trim().to_owned());
    }
    if let Some((base, unit)) = text.split_once(" / ") {
        return (base, unit.trim().to_owned());
    }
    if let Some(base) = text.strip_suffix(['°', 'º']) {
        return (base, "°".to_owned());
    }
    if let Some((base, end)) = text.rsplit_once(['_', ' ', '-', '.', ','])
        && ENDINGS.contains(&end)
    {
        return (base, end.to_owned());
    }
    (text, String::new())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_taken_off() {
        for (text, word, unit) in [
            (" Theta_I ", "thetai", ""),
            ("theta_i_deg", "thetai", "deg"),
            ("theta_i [deg]", "thetai", "deg"),
            ("theta_o (Degrees)", "thetao", "degrees"),
            ("θ_r / °", "thetar", "°"),
            ("phi i°", "phii", "°"),
            ("Incident angle", "incidentangle", ""),
            ("f [1/sr]", "f", "1/sr"),
            ("λ [µm]", "lambda", "um"),
            ("550 nm", "550", "nm"),
        ] {
            assert_eq!(Name::new(text), Name { word: word.to_owned(), unit: unit.to_owned() }, "{text}");
        }
    }
}
