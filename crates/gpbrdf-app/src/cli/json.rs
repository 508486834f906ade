//! JSON on standard output and in reports.

use anyhow::Result;
use serde::Serialize;
use serde_json::{Map, Value};

/// JSON with line ends. A PSNR that is no number of JSON is `null`, and a key `notes` names it: an infinite one of
/// equal pictures is `"psnr_env": null` with the note `"metrics.psnr_env": "inf"`.
///
/// # Errors
/// Those of the value.
pub(super) fn to_json(value: &impl Serialize) -> Result<String> {
    Ok(format!("{}\n", serde_json::to_string_pretty(&noted(value)?)?))
}

/// The same JSON in a single line, with its end.
///
/// # Errors
/// Those of the value.
pub(super) fn to_json_line(value: &impl Serialize) -> Result<String> {
    Ok(format!("{}\n", serde_json::to_string(&noted(value)?)?))
}

/// A value with `null` and notes in place of what is no number of JSON.
fn noted(value: &impl Serialize) -> Result<Value> {
    let mut value = serde_json::to_value(value)?;
    let mut notes = Map::new();
    take_names(&mut value, "", false, &mut notes);
    if let Value::Object(object) = &mut value
        && !notes.is_empty()
    {
        object.insert("notes".to_owned(), Value::Object(notes));
    }
    Ok(value)
}

/// Replaces the names of numbers under keys of a PSNR by `null` and adds them to the notes, under the path to the key.
fn take_names(value: &mut Value, path: &str, is_psnr: bool, notes: &mut Map<String, Value>) {
    match value {
        Value::String(name) if is_psnr && matches!(name.as_str(), "inf" | "-inf" | "NaN") => {
            notes.insert(path.to_owned(), value.take());
        }
        Value::Array(values) => {
            for (i, value) in values.iter_mut().enumerate() {
                take_names(value, &format!("{path}[{i}]"), is_psnr, notes);
            }
        }
        Value::Object(object) => {
            for (key, value) in object {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                take_names(value, &path, key.starts_with("psnr"), notes);
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn infinity_is_null_with_a_note_and_all_else_stays() {
        let given = json!({ "name": "inf", "m": { "psnr": "inf", "psnr_of": ["NaN", 2.5, "other"] } });
        let read: Value = serde_json::from_str(&to_json(&given).unwrap()).unwrap();
        let expected = json!({
            "name": "inf",
            "m": { "psnr": null, "psnr_of": [null, 2.5, "other"] },
            "notes": { "m.psnr": "inf", "m.psnr_of[0]": "NaN" },
        });
        assert_eq!(read, expected);
        let line = to_json_line(&given).unwrap();
        assert_eq!(serde_json::from_str::<Value>(&line).unwrap(), expected);
        assert!(line.ends_with("}\n") && line.lines().count() == 1, "{line}");
        assert_eq!(to_json(&json!({ "a": "b" })).unwrap(), "{\n  \"a\": \"b\"\n}\n");
    }
}
