//! Messages for the user: errors and notes stay until they are dismissed, successes for a moment.

use std::path::Path;

/// An error about a file as a text that names the file.
pub(crate) fn naming(path: &Path, error: &dyn std::fmt::Display) -> String {
    let (text, name) = (error.to_string(), path.display().to_string());
    if text.contains(&name) { text } else { format!("\"{name}\": {text}") }
}

/// What a message says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Error,
    /// Something worth knowing, such as how a file was read.
    Note,
    /// Something that was wanted is done.
    Success,
}

/// One message.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Message {
    pub(crate) kind: Kind,
    pub(crate) text: String,
    /// The time, in seconds, at which it was first shown.
    since: Option<f64>,
}

/// Messages, the oldest first.
#[derive(Debug, Default)]
pub(crate) struct Messages {
    list: Vec<Message>,
}

/// The oldest notes and successes are dropped where there are more than this.
const NOTES: usize = 3;
/// The oldest errors are dropped where there are more than this, which nobody reads any more.
const ERRORS: usize = 100;

impl Messages {
    /// Reports a failure.
    pub(crate) fn error(&mut self, message: impl Into<String>) {
        self.push(Kind::Error, message.into());
    }

    /// Says what is worth knowing.
    pub(crate) fn note(&mut self, message: impl Into<String>) {
        self.push(Kind::Note, message.into());
    }

    /// Reports a success.
    pub(crate) fn success(&mut self, message: impl Into<String>) {
        self.push(Kind::Success, message.into());
    }

    fn push(&mut self, kind: Kind, text: String) {
        if !self.list.iter().any(|known| known.text == text) {
            self.list.push(Message { kind, text, since: None });
        }
        // Notes make room for newer ones; errors stay until they are read, or are too many for that.
        for (is_error, most) in [(false, NOTES), (true, ERRORS)] {
            let is_like = |m: &Message| (m.kind == Kind::Error) == is_error;
            if self.list.iter().filter(|m| is_like(m)).count() > most
                && let Some(oldest) = self.list.iter().position(is_like)
            {
                self.list.remove(oldest);
            }
        }
    }

    /// Drops the successes that have been shown for so many seconds.
    pub(crate) fn expire(&mut self, now: f64, seconds: f64) {
        self.list.retain_mut(|message| {
            let since = *message.since.get_or_insert(now);
            message.kind != Kind::Success || now - since < seconds
        });
    }

    /// Drops all of them.
    pub(crate) fn clear(&mut self) {
        self.list.clear();
    }

    /// The messages, the oldest first.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Message> {
        self.list.iter()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Drops a message that has been read.
    pub(crate) fn dismiss(&mut self, index: usize) {
        if index < self.list.len() {
            self.list.remove(index);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_stay_and_notes_make_room() {
        let mut messages = Messages::default();
        for i in 0..20 {
            messages.error(format!("error {i}"));
            messages.note(format!("note {i}"));
        }
        messages.error("error 3");
        let count = |error: bool| messages.list.iter().filter(|m| (m.kind == Kind::Error) == error).count();
        assert_eq!((count(true), count(false)), (20, NOTES));
        assert_eq!(messages.list[0].text, "error 0");
        assert!(messages.list.iter().any(|m| m.text == "note 19"));
        // An error of each minute of a day.
        for i in 20..1440 {
            messages.error(format!("error {i}"));
        }
        assert_eq!(messages.list.iter().filter(|m| m.kind == Kind::Error).count(), ERRORS);
        assert!(messages.list.iter().any(|m| m.text == "error 1439"));
    }

    #[test]
    fn successes_go_and_all_else_stays() {
        let mut messages = Messages::default();
        messages.success("written");
        messages.note("odd");
        messages.error("broken");
        messages.expire(100.0, 8.0);
        messages.expire(107.0, 8.0);
        assert_eq!(messages.list.len(), 3);
        messages.expire(108.5, 8.0);
        let left: Vec<&str> = messages.iter().map(|message| message.text.as_str()).collect();
        assert_eq!(left, ["odd", "broken"]);
    }
}
