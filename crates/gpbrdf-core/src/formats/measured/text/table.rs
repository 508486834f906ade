//! A table as text: where its header is, what parts its columns, and its rows.

use crate::base::error::Result;
use crate::formats::measured::input::{Input, shortened};
use crate::formats::measured::text::columns::{angle_unit, count_angles};
use crate::formats::measured::text::comment::comment;
use crate::formats::measured::text::number::is_number;
use crate::formats::measured::text::separator::{SEPARATORS, Separator};

/// A header is looked for in this many lines.
const HEADER_LINES: usize = 200;

/// The names of the columns.
#[derive(Clone, Debug, Default)]
pub(crate) struct Header {
    pub(crate) names: Vec<String>,
    /// The units that a row of units gives; empty if there is none.
    units: Vec<String>,
    pub(crate) line: u64,
}

impl Header {
    /// The name of a column, for messages.
    pub(crate) fn name(&self, index: usize) -> String {
        shortened(self.names.get(index).map_or("", String::as_str))
    }

    /// The unit of a column in the row of units; empty if there is none.
    pub(crate) fn unit(&self, index: usize) -> &str {
        self.units.get(index).map_or("", String::as_str)
    }

    /// All names, for messages.
    pub(crate) fn listed(&self) -> String {
        let names: Vec<_> = self.names.iter().map(|name| format!("`{}`", shortened(name))).collect();
        format!("the columns {} on line {}", names.join(", "), self.line)
    }
}

/// A table whose header is known. Its rows are split one by one.
#[derive(Debug)]
pub(crate) struct Table<'a> {
    pub(crate) header: Header,
    /// The rows and their numbers.
    rows: Vec<(u64, &'a str)>,
    separator: Separator,
    /// Whether the rows have a name before the first column, which the header does not name.
    has_row_names: bool,
    /// The comments before the rows without the header, and their lines.
    pub(crate) comments: Vec<(u64, &'a str)>,
}

impl<'a> Table<'a> {
    /// Finds header and rows. Where the first line that is no comment is already a row, the header is looked
    /// for in the comments before it.
    ///
    /// # Errors
    /// [`Error::Format`](crate::Error::Format) if there is no header or no row.
    pub(crate) fn new(input: &Input<'_>, text: &'a str) -> Result<Self> {
        if text.is_empty() {
            return Err(input.wrong("a header line", "an empty file"));
        }
        let mut comments = Vec::new();
        let mut content = Vec::new();
        for (line, number) in text.lines().zip(1u64..) {
            match comment(line) {
                Some(text) if content.len() < HEADER_LINES => comments.push((number, text)),
                Some(_) => {}
                None if line.trim().is_empty() => {}
                None => content.push((number, line)),
            }
        }
        let Some(&(_, first)) = content.first() else {
            return Err(input.wrong("a header line", "nothing but comments"));
        };
        let place = header_line(&content);
        let first_row = content.iter().position(|(_, line)| is_row(line)).unwrap_or(content.len());
        let in_comment =
            if place.is_none() && is_row(first) { header_comment(&comments, content[0].0) } else { None };
        if let Some(index) = in_comment {
            let (line, text) = comments.remove(index);
            return Self::with_header(input, (line, text), content, comments);
        }
        let place = place.filter(|&place| place < first_row).unwrap_or(0);
        let header = content[place];
        let rows = content.split_off(place + 1);
        Self::with_header(input, header, rows, comments)
    }

    /// The table with this header and these rows.
    pub(crate) fn with_header(
        input: &Input<'_>,
        (line, text): (u64, &'a str),
        mut rows: Vec<(u64, &'a str)>,
        mut comments: Vec<(u64, &'a str)>,
    ) -> Result<Self> {
        let of_header = header_separator(text);
        let mut names = of_header.split_header(text);
        while names.last().is_some_and(String::is_empty) {
            names.pop();
        }
        let mut header = Header { names, units: Vec::new(), line };
        let mut fields = Vec::new();
        if let Some((_, first)) = rows.first() {
            of_header.split(first, &mut fields);
            if fields.iter().any(|field| angle_unit(field).is_some()) && !fields.iter().any(|f| is_number(f))
            {
                header.units.clone_from(&fields);
                rows.remove(0);
            }
        }
        let Some(&(first_row, first)) = rows.first() else {
            return Err(input.wrong("at least one row", "a header only"));
        };
        comments.retain(|(line, _)| *line < first_row);
        let (separator, has_row_names) = row_separator(of_header, header.names.len(), first);
        let has_row_names = has_row_names && rows.iter().all(|(_, row)| starts_with_a_name(row, separator));
        Ok(Self { header, rows, separator, has_row_names, comments })
    }

    /// Calls `row` with the line and the fields of each row. There are never more fields than names.
    ///
    /// # Errors
    /// Those of `row`, and [`Error::Format`](crate::Error::Format) for a row that has more fields than the
    /// header or, unless `row` refuses it, fewer.
    pub(crate) fn each(
        &self,
        input: &Input<'_>,
        mut row: impl FnMut(u64, &[String]) -> Result<()>,
    ) -> Result<()> {
        let mut fields = Vec::new();
        let count = self.header.names.len();
        for &(line, text) in &self.rows {
            self.separator.split(text, &mut fields);
            if self.has_row_names {
                fields.remove(0);
            }
            while fields.len() > count && fields.last().is_some_and(String::is_empty) {
                fields.pop();
            }
            let expected = || {
                let by = self.separator.name();
                format!(
                    "{count} fields on line {line}, as in the header on line {}, parted by {by}",
                    self.header.line
                )
            };
            if fields.len() > count {
                let hint = if self.separator == Separator::Comma {
                    "; if they are decimal commas, part the columns by semicolons or tabs"
                } else {
                    ""
                };
                return Err(input.wrong(expected(), format!("{}{hint}", fields.len())));
            }
            row(line, &fields)?;
            if fields.len() < count {
                return Err(input.wrong(expected(), fields.len().to_string()));
            }
        }
        Ok(())
    }
}

/// Whether a line of a text can be the header or a row of a table of samples.
pub(crate) fn is_header_or_row(line: &str) -> bool {
    let any = |separator: &Separator| count_angles(&separator.split_header(line)) > 0;
    SEPARATORS.iter().any(any) || is_numeric(line, 4)
}

/// Whether a line is a row and not a header: three numbers at least.
fn is_row(line: &str) -> bool {
    is_numeric(line, 3)
}

/// Whether a line has at least `least` fields that are numbers and no name of an angle.
fn is_numeric(line: &str, least: usize) -> bool {
    let mut fields = Vec::new();
    SEPARATORS.into_iter().any(|separator| {
        separator.split(line, &mut fields);
        count_angles(&fields) == 0 && fields.iter().filter(|field| is_number(field)).count() >= least
    })
}

/// The place of the header among lines that are no comments: the first that names two angles, else one.
fn header_line(content: &[(u64, &str)]) -> Option<usize> {
    let near = || content.iter().take(HEADER_LINES).map(|(_, line)| count_in(line));
    near().position(|count| count >= 2).or_else(|| near().position(|count| count == 1))
}

/// The place of the header among the comments before a line: the last of those that name most angles.
fn header_comment(comments: &[(u64, &str)], before: u64) -> Option<usize> {
    let before = comments.iter().take_while(|(line, _)| *line < before);
    let counts = before.map(|(_, text)| count_in(text)).enumerate();
    counts.filter(|&(_, count)| count >= 2).max_by_key(|&(_, count)| count).map(|(index, _)| index)
}

/// The number of angles that a line names, by the separator that finds most.
pub(crate) fn count_in(line: &str) -> usize {
    count_angles(&header_separator(line).split_header(line))
}

fn header_separator(line: &str) -> Separator {
    let count = |separator: Separator| count_angles(&separator.split_header(line));
    let most = SEPARATORS.into_iter().map(count).max().unwrap_or(0);
    let best = SEPARATORS.into_iter().find(|&separator| count(separator) == most && most > 0);
    best.or_else(|| SEPARATORS.into_iter().find(|s| s.split_header(line).len() > 1))
        .unwrap_or(Separator::Comma)
}

/// What parts the fields of a row under a header of `count` names, and whether there is one field more for a
/// name of the row.
fn row_separator(of_header: Separator, count: usize, row: &str) -> (Separator, bool) {
    let mut fields = Vec::new();
    let mut count_of = |separator: Separator| {
        separator.split(row, &mut fields);
        while fields.len() > count && fields.last().is_some_and(String::is_empty) {
            fields.pop();
        }
        fields.len()
    };
    let order = || std::iter::once(of_header).chain(SEPARATORS);
    if let Some(found) = order().find(|&separator| count_of(separator) == count) {
        return (found, false);
    }
    match order().find(|&separator| count_of(separator) == count + 1) {
        Some(found) => (found, true),
        None => (of_header, false),
    }
}

/// Whether a row starts with a name in quotes or with something that is no number.
fn starts_with_a_name(row: &str, separator: Separator) -> bool {
    let mut fields = Vec::new();
    separator.split(row, &mut fields);
    row.trim_start().starts_with('"')
        || fields.first().is_some_and(|field| !field.is_empty() && !is_number(field))
}
