//! Errors as they are shown to people.

/// The causes of an error from the outside in, joined by colons. A cause is left out where the message before it
/// already ends with it.
pub(crate) fn said_once(error: &anyhow::Error) -> String {
    let mut line = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if line.is_empty() {
            line = cause;
        } else if !line.ends_with(&cause) {
            line.push_str(": ");
            line.push_str(&cause);
        }
    }
    line
}

#[cfg(test)]
mod tests {
    use super::said_once;

    #[test]
    fn causes_are_said_once() {
        let error = anyhow::anyhow!("no space").context("cannot write \"a\": no space").context("stopped");
        assert_eq!(said_once(&error), "stopped: cannot write \"a\": no space");
    }
}
