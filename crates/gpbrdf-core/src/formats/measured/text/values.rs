//! Which columns hold values and their standard deviations, by the names that people give them.

use crate::base::error::Result;
use crate::formats::measured::input::{Input, shortened};
use crate::formats::measured::options::ValueKind;
use crate::formats::measured::text::name::Name;
use crate::formats::measured::text::table::Header;

/// The columns that hold the values of a row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Values {
    /// One value for all channels.
    Grey(usize),
    /// Linear sRGB.
    Rgb([usize; 3]),
    /// CIE XYZ.
    Xyz([usize; 3]),
    /// One column for each wavelength; these in nm, increasing.
    Spectrum { columns: Vec<usize>, wavelengths: Vec<f64> },
    /// One row for each wavelength: the columns of the wavelength and of the value, and the former's unit in
    /// nm.
    Long { wavelength: usize, value: usize, nm: f64 },
}

/// The columns of standard deviations.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum SigmaColumns {
    None,
    /// One for all channels, in the unit of the values.
    Grey(usize),
    /// One for each channel.
    Rgb([usize; 3]),
    /// As a share of the value; the factor is 0.01 for percent.
    Relative(usize, f64),
}

/// What the columns of values are.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ValueColumns {
    pub(crate) values: Values,
    pub(crate) sigma: SigmaColumns,
    /// What the names say that the values are.
    pub(crate) kind: ValueKind,
}

impl ValueColumns {
    /// All columns of numbers, those of values first.
    pub(crate) fn indices(&self) -> Vec<usize> {
        let mut indices = match &self.values {
            Values::Grey(index) => vec![*index],
            Values::Rgb(indices) | Values::Xyz(indices) => indices.to_vec(),
            Values::Spectrum { columns, .. } => columns.clone(),
            Values::Long { wavelength, value, .. } => vec![*value, *wavelength],
        };
        match self.sigma {
            SigmaColumns::None => {}
            SigmaColumns::Grey(index) | SigmaColumns::Relative(index, _) => indices.push(index),
            SigmaColumns::Rgb(columns) => indices.extend(columns),
        }
        indices
    }
}

/// What the name of a column of values says about their kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Said {
    /// The BRDF, or nothing.
    Brdf,
    Cosine,
    Factor,
    /// Something that needs the option.
    Unclear,
}

impl Said {
    /// The kind that a name without its channel says.
    fn new(word: &str) -> Option<Self> {
        match word {
            "f" | "fr" | "value" | "values" | "val" | "brdf" | "bsdf" => Some(Self::Brdf),
            "fcos"
            | "brdfcos"
            | "bsdfcos"
            | "cosbrdf"
            | "ccbrdf"
            | "ccbsdf"
            | "brdfxcos"
            | "fcostheta"
            | "brdfcostheta"
            | "cosinecorrectedbrdf" => Some(Self::Cosine),
            "brf" | "reflectancefactor" | "pif" | "pibrdf" => Some(Self::Factor),
            "reflectance" | "refl" | "rho" | "radiance" | "intensity" | "signal" | "reflectivity" => {
                Some(Self::Unclear)
            }
            _ => None,
        }
    }

    fn kind(self) -> ValueKind {
        match self {
            Self::Brdf | Self::Unclear => ValueKind::Brdf,
            Self::Cosine => ValueKind::Cosine,
            Self::Factor => ValueKind::Factor,
        }
    }
}

/// The channel at the end of a name, and what is before it.
fn channel(word: &str) -> Option<(usize, &str)> {
    let ends = [("red", 0), ("green", 1), ("blue", 2), ("r", 0), ("g", 1), ("b", 2)];
    ends.into_iter().find_map(|(end, channel)| Some((channel, word.strip_suffix(end)?)))
}

/// A wavelength in nm, for names such as `550`, `550 nm`, `f_550` and `0.55 um`.
fn wavelength(name: &Name) -> Option<f64> {
    let mut word = name.word.as_str();
    let mut unit = name.unit.as_str();
    for end in ["nm", "um"] {
        if let Some(base) = word.strip_suffix(end) {
            (word, unit) = (base, end);
        }
    }
    let prefixes = ["lambda", "brdf", "value", "wl", "f", "w"];
    let digits = prefixes.into_iter().find_map(|prefix| word.strip_prefix(prefix)).unwrap_or(word);
    if !digits.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    let number = digits.parse::<f64>().ok()?;
    match unit {
        "um" => Some(1000.0 * number),
        "nm" => Some(number),
        _ => (200.0..=20_000.0).contains(&number).then_some(number),
    }
}

/// Finds the columns of values. Columns that are used already are `angles`.
///
/// # Errors
/// [`Error::Format`](crate::Error::Format) if there are none, if there are several, or if what they are is not
/// clear and the options do not say it.
pub(crate) fn value_columns(
    input: &Input<'_>,
    header: &Header,
    angles: &[usize],
    allow_xyz: bool,
) -> Result<ValueColumns> {
    let names: Vec<(usize, Name)> = header
        .names
        .iter()
        .enumerate()
        .filter(|(index, _)| !angles.contains(index))
        .map(|(index, text)| (index, Name::new(text)))
        .collect();
    let named = |word: &str| names.iter().find(|(_, name)| name.word == word).map(|(index, _)| *index);
    let (values, said) = if let Some(found) = rgb(input, header, &names)? {
        found
    } else if let Some(found) = spectrum(input, header, &names)? {
        (found, Said::Brdf)
    } else if let Some((index, said)) = grey(input, header, &names)? {
        (Values::Grey(index), said)
    } else if allow_xyz && let (Some(x), Some(y), Some(z)) = (named("x"), named("y"), named("z")) {
        (Values::Xyz([x, y, z]), Said::Brdf)
    } else {
        return Err(input.wrong("value columns `r`, `g`, `b`, or `f`", header.listed()));
    };
    let columns = ValueColumns {
        values: long(input, header, &names, values)?,
        sigma: sigma(input, header, &names)?,
        kind: said.kind(),
    };
    check_kind(input, header, &columns, said)?;
    Ok(columns)
}

/// A column that may hold standard deviations and is not used, as its name does not say so.
pub(crate) fn unused_uncertainty(header: &Header, columns: &ValueColumns) -> Option<String> {
    let is_one = |name: &&String| {
        matches!(Name::new(name).word.as_str(), "uncertainty" | "unc" | "error" | "err" | "deltaf")
    };
    let found = header.names.iter().find(is_one).filter(|_| columns.sigma == SigmaColumns::None)?;
    Some(format!(
        "the column `{}` is not used; call it `sigma` or `sigma_rel` if it is one standard deviation",
        shortened(found)
    ))
}

/// Refuses values of which neither the name nor the unit nor an option says what they are.
fn check_kind(input: &Input<'_>, header: &Header, columns: &ValueColumns, said: Said) -> Result<()> {
    if input.options.values.is_some() {
        return Ok(());
    }
    let index = columns.indices()[0];
    let unclear = |found: String| {
        input.wrong(
            "values that are a BRDF in sr^-1, or the option --values",
            format!("{found} on line {}", header.line),
        )
    };
    if said == Said::Unclear {
        return Err(unclear(format!("the column `{}`", header.name(index))));
    }
    if matches!(columns.values, Values::Spectrum { .. }) {
        return Ok(());
    }
    let unit = Name::new(&header.names[index]).unit;
    let unit = if unit.is_empty() { header.unit(index).to_lowercase() } else { unit };
    let unit: String =
        unit.chars().filter(|c| c.is_alphanumeric() || matches!(c, '%' | '⁻' | '¹' | '/' | '-')).collect();
    let is_known = match unit.as_str() {
        "" | "1/sr" | "sr-1" | "/sr" | "sr⁻¹" | "persr" => true,
        "-" | "1" => said == Said::Factor,
        _ => false,
    };
    if is_known {
        Ok(())
    } else {
        Err(unclear(format!("the unit `{unit}` of the column `{}`", header.name(index))))
    }
}

/// Three columns of colours. Those of the kind that the options ask for come before others, and the BRDF before
/// what has to be converted.
fn rgb(input: &Input<'_>, header: &Header, names: &[(usize, Name)]) -> Result<Option<(Values, Said)>> {
    let mut sets: Vec<(String, Said, [Option<usize>; 3])> = Vec::new();
    for (index, name) in names {
        let Some((channel, prefix)) = channel(&name.word) else { continue };
        let said = if prefix.is_empty() { Some(Said::Brdf) } else { Said::new(prefix) };
        let Some(said) = said else { continue };
        let set = match sets.iter_mut().find(|set| set.0 == prefix) {
            Some(set) => set,
            None => {
                sets.push((prefix.to_owned(), said, [None; 3]));
                sets.last_mut().ok_or_else(|| input.wrong("columns", "none"))?
            }
        };
        if set.2[channel].replace(*index).is_some() {
            return Err(input.wrong(format!("one column `{}`", header.name(*index)), header.listed()));
        }
    }
    let whole: Vec<(Values, Said)> =
        sets.into_iter().filter_map(|(_, said, [r, g, b])| Some((Values::Rgb([r?, g?, b?]), said))).collect();
    choose(input, header, whole)
}

/// One column of grey values.
fn grey(input: &Input<'_>, header: &Header, names: &[(usize, Name)]) -> Result<Option<(usize, Said)>> {
    let found = names.iter().filter_map(|(index, name)| Some((*index, Said::new(&name.word)?))).collect();
    choose(input, header, found)
}

/// The one candidate that is to be used.
fn choose<T>(input: &Input<'_>, header: &Header, mut found: Vec<(T, Said)>) -> Result<Option<(T, Said)>> {
    let wanted = input.options.values.unwrap_or(ValueKind::Brdf);
    let rank = |said: Said| match said {
        Said::Unclear => 2,
        said if said.kind() == wanted => 0,
        _ => 1,
    };
    found.sort_by_key(|candidate| rank(candidate.1));
    let best = found.first().map_or(0, |candidate| rank(candidate.1));
    if found.iter().filter(|candidate| rank(candidate.1) == best).count() > 1 {
        return Err(input.wrong("one set of value columns", header.listed()));
    }
    Ok(found.into_iter().next())
}

/// One column for each wavelength.
fn spectrum(input: &Input<'_>, header: &Header, names: &[(usize, Name)]) -> Result<Option<Values>> {
    let mut found: Vec<(f64, usize)> =
        names.iter().filter_map(|(index, name)| Some((wavelength(name)?, *index))).collect();
    if found.is_empty() {
        return Ok(None);
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let Some(pair) = found.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(input.wrong(format!("one column for {} nm", pair[0].0), header.listed()));
    }
    let (wavelengths, columns) = found.into_iter().unzip();
    Ok(Some(Values::Spectrum { columns, wavelengths }))
}

/// One row for each wavelength, if there is a column of wavelengths beside that of values.
fn long(input: &Input<'_>, header: &Header, names: &[(usize, Name)], values: Values) -> Result<Values> {
    let is_wavelength =
        |name: &Name| matches!(name.word.as_str(), "wavelength" | "wavelengths" | "lambda" | "wl");
    let mut found = names.iter().filter(|(_, name)| is_wavelength(name));
    let (Some((wavelength, name)), Values::Grey(value)) = (found.next(), &values) else { return Ok(values) };
    if found.next().is_some() {
        return Err(input.wrong("one column of wavelengths", header.listed()));
    }
    let unit = if name.unit.is_empty() { header.unit(*wavelength) } else { &name.unit };
    let nm = match unit.trim_matches(['[', ']', '(', ')']) {
        "" | "nm" => 1.0,
        "um" | "µm" | "μm" => 1000.0,
        other => {
            let expected = format!("wavelengths in nm or um in column `{}`", header.name(*wavelength));
            return Err(input.wrong(expected, format!("`{other}`")));
        }
    };
    Ok(Values::Long { wavelength: *wavelength, value: *value, nm })
}

/// The columns of standard deviations.
fn sigma(input: &Input<'_>, header: &Header, names: &[(usize, Name)]) -> Result<SigmaColumns> {
    let mut grey = Vec::new();
    let mut relative = Vec::new();
    let mut rgb = [None; 3];
    for (index, name) in names {
        let marks = ["standarddeviation", "stddev", "stdev", "sigma", "std", "sd"];
        let word = name.word.as_str();
        let Some(rest) =
            marks.into_iter().find_map(|mark| word.strip_prefix(mark).or_else(|| word.strip_suffix(mark)))
        else {
            continue;
        };
        match rest {
            "" if name.unit == "%" => relative.push((*index, 0.01)),
            "" | "f" | "value" | "brdf" => grey.push(*index),
            "rel" | "relative" => relative.push((*index, if name.unit == "%" { 0.01 } else { 1.0 })),
            "r" | "red" => rgb[0] = Some(*index),
            "g" | "green" => rgb[1] = Some(*index),
            "b" | "blue" => rgb[2] = Some(*index),
            _ => {}
        }
    }
    match (grey.as_slice(), relative.as_slice(), rgb) {
        ([], [], [None, None, None]) => Ok(SigmaColumns::None),
        ([index], [], [None, None, None]) => Ok(SigmaColumns::Grey(*index)),
        ([], [(index, scale)], [None, None, None]) => Ok(SigmaColumns::Relative(*index, *scale)),
        ([], [], [Some(r), Some(g), Some(b)]) => Ok(SigmaColumns::Rgb([r, g, b])),
        _ => Err(input.wrong(
            "standard deviations in one column `sigma` or `sigma_rel`, or in `sigma_r`, `sigma_g`, `sigma_b`",
            header.listed(),
        )),
    }
}
