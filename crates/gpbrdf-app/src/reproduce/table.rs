//! A table of results as Markdown, CSV and JSON.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use gpbrdf_core::base::number::significant;

/// Rows of names and numbers under named columns.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Table {
    /// Part of the file's name.
    pub(super) name: String,
    /// What the table shows.
    pub(super) title: String,
    pub(super) columns: Vec<String>,
    pub(super) rows: Vec<Vec<Value>>,
    /// Remarks below the table.
    pub(super) notes: Vec<String>,
}

/// A number as JSON; infinities and NaN become text, as JSON has no numbers for them.
pub(super) fn number(x: f64) -> Value {
    if x.is_finite() { json!(x) } else { json!(x.to_string()) }
}

impl Table {
    pub(super) fn new(name: &str, title: impl Into<String>, columns: &[&str]) -> Self {
        Self {
            name: name.to_owned(),
            title: title.into(),
            columns: columns.iter().map(|&c| c.to_owned()).collect(),
            ..Self::default()
        }
    }

    pub(super) fn note(&mut self, note: impl Into<String>) {
        self.notes.push(note.into());
    }

    /// Adds a row of means for each value of the column `by` that several rows share; their text is left out.
    pub(super) fn add_means(&mut self, by: usize) {
        let mut groups: Vec<(Value, Vec<usize>)> = Vec::new();
        for (i, row) in self.rows.iter().enumerate() {
            let Some(key) = row.get(by) else { continue };
            match groups.iter_mut().find(|(of, _)| of == key) {
                Some((_, members)) => members.push(i),
                None => groups.push((key.clone(), vec![i])),
            }
        }
        for (key, members) in groups.into_iter().filter(|(_, members)| members.len() > 1) {
            let mean = |column: usize| {
                let cells = members.iter().filter_map(|&i| self.rows[i].get(column));
                let values: Vec<f64> = cells.filter_map(Value::as_f64).collect();
                if values.is_empty() {
                    return Value::Null;
                }
                number(values.iter().sum::<f64>() / values.len() as f64)
            };
            let mut row: Vec<Value> = (0..self.columns.len()).map(mean).collect();
            row[by] = key;
            if let Some(first) = row.first_mut() {
                *first = json!(format!("**mean of {}**", members.len()));
            }
            self.rows.push(row);
        }
    }

    /// The table for people, with four digits of each number.
    pub(crate) fn markdown(&self) -> String {
        let mut out = format!("## {}\n\n", self.title);
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        out.push_str(&line(&self.columns));
        out.push_str(&format!("|{}\n", "---|".repeat(self.columns.len())));
        for row in &self.rows {
            out.push_str(&line(&row.iter().map(shown).collect::<Vec<_>>()));
        }
        for note in &self.notes {
            out.push_str(&format!("\n{note}\n"));
        }
        out
    }

    /// The table for programs, with all digits.
    pub(super) fn csv(&self) -> String {
        let quoted = |text: &str| {
            if text.contains([',', '"', '\n']) {
                format!("\"{}\"", text.replace('"', "\"\""))
            } else {
                text.to_owned()
            }
        };
        let cell = |value: &Value| match value {
            Value::Null => String::new(),
            Value::String(text) => quoted(text),
            other => other.to_string(),
        };
        let mut lines = vec![self.columns.iter().map(|c| quoted(c)).collect::<Vec<_>>().join(",")];
        lines.extend(self.rows.iter().map(|row| row.iter().map(cell).collect::<Vec<_>>().join(",")));
        lines.join("\n") + "\n"
    }
}

fn shown(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        Value::Number(n) if n.is_u64() => n.to_string(),
        Value::Number(n) => n.as_f64().map_or_else(String::new, |x| significant(x, 4)),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_reads_the_same_in_all_formats() {
        let mut table = Table::new("t", "Title", &["what", "n", "x"]);
        table.rows.push(vec![json!("a, \"b\""), json!(37_616), number(0.001_234_56)]);
        table.rows.push(vec![json!("c"), Value::Null, number(f64::INFINITY)]);
        table.note("A note.");
        assert_eq!(
            table.markdown(),
            "## Title\n\n| what | n | x |\n|---|---|---|\n| a, \"b\" | 37616 | 0.001235 |\n| c |  | inf |\n\nA note.\n"
        );
        assert_eq!(table.csv(), "what,n,x\n\"a, \"\"b\"\"\",37616,0.00123456\nc,,inf\n");
        table.rows.push(vec![json!("d"), Value::Null, number(2.0)]);
        table.add_means(1);
        assert_eq!(table.rows[3..], [[json!("**mean of 2**"), Value::Null, number(2.0)]]);
    }
}
