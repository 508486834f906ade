//! Messages for the user: errors stay until they are dismissed.

use std::path::Path;

/// An error about a file as a text that names the file.
pub(crate) fn naming(path: &Path, error: &dyn std::fmt::Display) -> String {
    let (text, name) = (error.to_string(), path.display().to_string());
    if text.contains(&name) { text } else { format!("\"{name}\": {text}") }
}

/// One message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Message {
    /// Whether it reports a failure, not a success.
    pub(crate) is_error: bool,
    pub(crate) text: String,
}

/// Messages, the oldest first.
#[derive(Debug, Default)]
pub(crate) struct Messages {
    list: Vec<Message>,
}

/// The oldest notes are dropped where there are more than this.
const NOTES: usize = 3;

impl Messages {
    /// Reports a failure.
    pub(crate) fn error(&mut self, message: impl Into<String>) {
        self.push(true, message.into());
    }

    /// Reports a success.
    pub(crate) fn note(&mut self, message: impl Into<String>) {
        self.push(false, message.into());
    }

    fn push(&mut self, is_error: bool, text: String) {
        if !self.list.iter().any(|known| known.text == text) {
            self.list.push(Message { is_error, text });
        }
        // Notes make room for newer ones; errors stay until they are read.
        let notes = self.list.iter().filter(|m| !m.is_error).count();
        if notes > NOTES
            && let Some(oldest) = self.list.iter().position(|m| !m.is_error)
        {
            self.list.remove(oldest);
        }
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
        let count = |error: bool| messages.list.iter().filter(|m| m.is_error == error).count();
        assert_eq!((count(true), count(false)), (20, NOTES));
        assert_eq!(messages.list[0].text, "error 0");
        assert!(messages.list.iter().any(|m| m.text == "note 19"));
    }
}
