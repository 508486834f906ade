//! Names in a file that the program does not know.

use serde_json::Value;

/// The most names that a message lists.
const LISTED: usize = 8;

/// A message about the fields of `given` that `known` does not have, which is what has been made of it; none if there
/// are no such fields. Fields within fields are named with a dot, those in lists by the list.
pub(crate) fn unknown_fields(given: &Value, known: &Value) -> Option<String> {
    let mut found = Vec::new();
    collect(given, known, "", &mut found);
    found.dedup();
    let more = if found.len() > LISTED { ", ..." } else { "" };
    found.truncate(LISTED);
    let quoted: Vec<String> = found.iter().map(|name| format!("\"{name}\"")).collect();
    (!quoted.is_empty()).then(|| format!("{}{more} not known, and ignored", quoted.join(", ")))
}

fn collect(given: &Value, known: &Value, place: &str, found: &mut Vec<String>) {
    match (given, known) {
        (Value::Object(given), Value::Object(known)) => {
            for (name, value) in given {
                let here = if place.is_empty() { name.clone() } else { format!("{place}.{name}") };
                match known.get(name) {
                    Some(known) => collect(value, known, &here, found),
                    None => found.push(here),
                }
            }
        }
        (Value::Array(given), Value::Array(known)) => {
            given.iter().zip(known).for_each(|(given, known)| collect(given, known, place, found));
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn fields_are_named_by_their_place() {
        let known = json!({"a": 1, "b": {"c": [{"d": 2}, {"d": 3}]}, "e": null});
        assert_eq!(unknown_fields(&known, &known), None);
        let given = json!({"a": {"free": 1}, "b": {"c": [{"d": 2, "x": 1}, {"x": 2}], "y": 0}, "z": 1});
        let message = unknown_fields(&given, &known).unwrap();
        assert_eq!(message, "\"b.c.x\", \"b.y\", \"z\" not known, and ignored");
    }
}
