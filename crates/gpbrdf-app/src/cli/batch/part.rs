//! A part of a batch, for one of several machines.

use std::str::FromStr;

/// Every `of`-th material, from the `number`-th on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Part {
    /// From 1 to `of`.
    number: usize,
    of: usize,
}

impl Part {
    /// The items of this part.
    pub(super) fn select<T>(self, items: Vec<T>) -> Vec<T> {
        items.into_iter().skip(self.number - 1).step_by(self.of).collect()
    }

    /// The name of its record.
    pub(super) fn record_name(self) -> String {
        format!("batch-{}-of-{}.jsonl", self.number, self.of)
    }
}

impl FromStr for Part {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers =
            text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        match numbers {
            Some((number, of)) if 0 < number && number <= of => Ok(Self { number, of }),
            _ => Err("expected a part like 1/8, from 1/8 to 8/8".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_make_up_the_whole() {
        let items: Vec<usize> = (0..10).collect();
        let mut all: Vec<usize> = Vec::new();
        for number in 1..=3 {
            all.extend(format!("{number}/3").parse::<Part>().unwrap().select(items.clone()));
        }
        assert_eq!(all, [0, 3, 6, 9, 1, 4, 7, 2, 5, 8]);
        for text in ["0/3", "4/3", "1", "1/0", "-1/2", "a/b"] {
            assert!(text.parse::<Part>().is_err(), "{text}");
        }
    }
}
