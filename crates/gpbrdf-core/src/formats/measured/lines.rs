//! Lists of lines, for messages.

/// Counts lines and remembers the first of them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lines {
    pub(crate) count: usize,
    first: Vec<u64>,
}

/// How many lines are named.
const NAMED: usize = 5;

impl Lines {
    pub(crate) fn push(&mut self, line: u64) {
        self.count += 1;
        if self.first.len() < NAMED && self.first.last() != Some(&line) {
            self.first.push(line);
        }
    }

    /// For example `line 3` or `lines 12, 40, 77, ...`.
    pub(crate) fn named(&self) -> String {
        let numbers: Vec<String> = self.first.iter().map(u64::to_string).collect();
        let more = if self.count > self.first.len() { ", ..." } else { "" };
        let plural = if self.count > 1 { "s" } else { "" };
        format!("line{plural} {}{more}", numbers.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_most_five_lines_are_named() {
        let mut lines = Lines::default();
        lines.push(3);
        assert_eq!(lines.named(), "line 3");
        (4..7).for_each(|line| lines.push(line));
        assert_eq!(lines.named(), "lines 3, 4, 5, 6");
        (7..30).for_each(|line| lines.push(line));
        assert_eq!(lines.named(), "lines 3, 4, 5, 6, 7, ...");
        assert_eq!(lines.count, 27);
    }
}
