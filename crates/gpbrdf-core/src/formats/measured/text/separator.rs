//! What parts the columns of a table.

/// The sign between columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Separator {
    Semicolon,
    Tab,
    Comma,
    /// One or more blanks or tabs.
    Blank,
}

/// In the order in which they are tried.
pub(crate) const SEPARATORS: [Separator; 4] =
    [Separator::Semicolon, Separator::Tab, Separator::Comma, Separator::Blank];

impl Separator {
    /// The name, for messages.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Semicolon => "semicolons",
            Self::Tab => "tabs",
            Self::Comma => "commas",
            Self::Blank => "blanks",
        }
    }

    fn sign(self) -> Option<char> {
        match self {
            Self::Semicolon => Some(';'),
            Self::Tab => Some('\t'),
            Self::Comma => Some(','),
            Self::Blank => None,
        }
    }

    /// The fields of a line without the blanks around them and without their quotes.
    pub(crate) fn split(self, line: &str, fields: &mut Vec<String>) {
        fields.clear();
        match self.sign() {
            Some(sign) if line.contains('"') => {
                let mut reader = csv::ReaderBuilder::new()
                    .delimiter(u8::try_from(sign).unwrap_or(b','))
                    .has_headers(false)
                    .trim(csv::Trim::All)
                    .from_reader(line.as_bytes());
                let mut record = csv::StringRecord::new();
                if reader.read_record(&mut record).is_ok() {
                    fields.extend(record.iter().map(|field| unquoted(field).to_owned()));
                }
            }
            Some(sign) => fields.extend(line.split(sign).map(|field| field.trim().to_owned())),
            None => fields.extend(line.split_whitespace().map(|field| field.trim_matches('"').to_owned())),
        }
    }

    /// The names in a header. Between blanks, a unit in brackets belongs to the name before it.
    pub(crate) fn split_header(self, line: &str) -> Vec<String> {
        let mut fields = Vec::new();
        self.split(line, &mut fields);
        if self == Self::Blank {
            let mut names: Vec<String> = Vec::new();
            for field in fields {
                match names.last_mut() {
                    Some(name) if field.starts_with(['[', '(', '/']) => {
                        name.push(' ');
                        name.push_str(&field);
                    }
                    _ => names.push(field),
                }
            }
            return names;
        }
        fields
    }
}

/// A field without the quotes that a blank before them kept.
fn unquoted(field: &str) -> &str {
    field.strip_prefix('"').and_then(|field| field.strip_suffix('"')).unwrap_or(field)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_split() {
        let split = |separator: Separator, line: &str| {
            let mut fields = Vec::new();
            separator.split(line, &mut fields);
            fields
        };
        assert_eq!(split(Separator::Semicolon, "1,5; 2 ;;"), ["1,5", "2", "", ""]);
        assert_eq!(
            split(Separator::Comma, "\"a, b\", \"c\" , \"say \"\"d\"\"\""),
            ["a, b", "c", "say \"\"d\"\""]
        );
        assert_eq!(split(Separator::Tab, "1\t\t2"), ["1", "", "2"]);
        assert_eq!(split(Separator::Blank, " 1   2\t3 "), ["1", "2", "3"]);
        assert_eq!(Separator::Blank.split_header("theta_i [deg]  f (1/sr)"), ["theta_i [deg]", "f (1/sr)"]);
    }
}
