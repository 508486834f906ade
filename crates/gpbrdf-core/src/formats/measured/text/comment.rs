//! Comments, and what they say about the names of angles.

use crate::formats::measured::options::Zenith;

/// The text of a comment line, or `None` for a line that is none. Spreadsheets put quotes around comments that
/// have the sign between columns, and that sign behind them.
pub(crate) fn comment(line: &str) -> Option<&str> {
    let line = line.trim();
    let line = match line.strip_prefix("\"#") {
        Some(_) => line[1..].trim_end_matches([',', ';', '\t']).trim_end_matches('"'),
        None => line,
    };
    let text =
        line.strip_prefix('#').or_else(|| line.strip_prefix('%')).or_else(|| line.strip_prefix("//"))?;
    Some(text.trim())
}

/// What comments say about which angle is measured from the normal, and on which line they say it first.
/// Understood are sentences such as `(phi_i, theta_i) are the zenith and azimuth angles` and `phi: zenith`.
///
/// # Errors
/// The lines of two statements that contradict each other.
pub(crate) fn zenith<'a>(
    comments: impl Iterator<Item = (u64, &'a str)>,
) -> Result<Option<(Zenith, u64)>, [u64; 2]> {
    let mut found: Option<(Zenith, u64)> = None;
    for (line, text) in comments {
        let Some(said) = said(text) else { continue };
        match found {
            None => found = Some((said, line)),
            Some((other, first)) if other != said => return Err([first, line]),
            Some(_) => {}
        }
    }
    Ok(found)
}

/// What one line says: its names of angles and of what they are, paired in their order.
pub(crate) fn said(text: &str) -> Option<Zenith> {
    let text = text.to_lowercase().replace(['θ', 'ϑ'], "theta").replace(['φ', 'ϕ'], "phi");
    let (mut names, mut kinds) = (Vec::new(), Vec::new());
    for word in text.split(|c: char| !c.is_alphanumeric() && c != '_') {
        if word.starts_with("theta") {
            names.push(Zenith::Theta);
        } else if word.starts_with("phi") {
            names.push(Zenith::Phi);
        } else if word.starts_with("zenith") || word == "polar" {
            kinds.push(true);
        } else if word.starts_with("azimuth") {
            kinds.push(false);
        }
    }
    if names.is_empty() || names.len() != kinds.len() {
        return None;
    }
    let pairs: Vec<Zenith> = names
        .into_iter()
        .zip(kinds)
        .map(|(name, is_zenith)| match (name, is_zenith) {
            (Zenith::Theta, true) | (Zenith::Phi, false) => Zenith::Theta,
            _ => Zenith::Phi,
        })
        .collect();
    pairs.iter().all(|pair| *pair == pairs[0]).then_some(pairs[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_are_recognised() {
        assert_eq!(comment("# a"), Some("a"));
        assert_eq!(comment("\"# a, b\",,,"), Some("a, b"));
        assert_eq!(comment("%x"), Some("x"));
        assert_eq!(comment("// y"), Some("y"));
        assert_eq!(comment("theta_i"), None);
    }

    #[test]
    fn statements_about_the_zenith_are_understood() {
        for (text, expected) in [
            ("(phi_i, theta_i) are the zenith and azimuth angles", Some(Zenith::Phi)),
            ("(theta_o, phi_o) are the zenith and azimuth angles", Some(Zenith::Theta)),
            ("phi: zenith angle", Some(Zenith::Phi)),
            ("azimuth is theta", Some(Zenith::Phi)),
            ("phi_i = azimuth of the light", Some(Zenith::Theta)),
            ("zenith angles are at most 80", None),
            ("phi_i theta_i phi_o theta_o", None),
            ("theta and phi are both zenith, zenith", None),
        ] {
            assert_eq!(said(text), expected, "{text}");
        }
        let conflict = [(1, "phi: zenith"), (4, "theta: zenith")];
        assert_eq!(zenith(conflict.into_iter()), Err([1, 4]));
        assert_eq!(zenith([(3, "x"), (4, "phi: zenith")].into_iter()), Ok(Some((Zenith::Phi, 4))));
    }
}
