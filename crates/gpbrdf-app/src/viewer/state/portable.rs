//! Paths that stay valid when a file that names them is moved together with what it names.

use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A file that another one names: where it was, and where it was as seen from the folder of the other.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct PortablePath {
    path: PathBuf,
    /// With slashes on every system; none where there is no way, as between drives.
    relative: Option<String>,
}

impl PortablePath {
    /// An absolute path as seen from a folder.
    pub(crate) fn new(path: &Path, folder: &Path) -> Self {
        Self { path: path.to_owned(), relative: relative(path, folder) }
    }

    /// A file that is named as seen from the folder only.
    pub(crate) fn beside(relative: &str) -> Self {
        Self { path: PathBuf::from(relative), relative: Some(relative.to_owned()) }
    }

    /// Where the file is now: by the way from this folder if there is a file, else where it was.
    pub(crate) fn resolve(&self, folder: &Path) -> PathBuf {
        let beside = self.relative.as_ref().map(|relative| folder.join(relative));
        beside.filter(|path| path.exists()).map_or_else(|| self.path.clone(), |path| tidy(&path))
    }

    /// Replaces, in `value`, all texts that are one of these paths by where the file is now.
    pub(crate) fn resolve_all(files: &[Self], folder: &Path, value: &mut Value) {
        let places: HashMap<String, String> = files
            .iter()
            .filter_map(|file| {
                let now = file.resolve(folder).into_os_string().into_string().ok()?;
                Some((file.path.to_str()?.to_owned(), now))
            })
            .collect();
        replace(value, &places);
    }
}

fn replace(value: &mut Value, places: &HashMap<String, String>) {
    match value {
        Value::String(text) => {
            if let Some(now) = places.get(text.as_str()) {
                text.clone_from(now);
            }
        }
        Value::Array(values) => values.iter_mut().for_each(|value| replace(value, places)),
        Value::Object(members) => members.values_mut().for_each(|value| replace(value, places)),
        _ => {}
    }
}

/// The way from a folder to a file, both absolute.
fn relative(path: &Path, folder: &Path) -> Option<String> {
    let (path, folder) = (tidy(path), tidy(folder));
    let (mut to, mut from) = (path.components().peekable(), folder.components().peekable());
    let mut common = 0;
    while let (Some(a), Some(b)) = (to.peek(), from.peek())
        && a == b
    {
        to.next();
        from.next();
        common += 1;
    }
    if common == 0 {
        return None;
    }
    let up = from.map(|_| Some(".."));
    let down = to.map(|part| part.as_os_str().to_str());
    up.chain(down).collect::<Option<Vec<&str>>>().map(|parts| parts.join("/"))
}

/// A path without `.`, and without `..` after a name.
fn tidy(path: &Path) -> PathBuf {
    let mut parts: Vec<Component<'_>> = Vec::new();
    for part in path.components() {
        match (part, parts.last()) {
            (Component::CurDir, _) => {}
            (Component::ParentDir, Some(Component::Normal(_))) => {
                parts.pop();
            }
            _ => parts.push(part),
        }
    }
    parts.iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_is_tried_first_and_the_old_place_next() {
        let folder = tempfile::tempdir().unwrap();
        let [here, there] = ["here/sessions", "there/sessions"].map(|name| folder.path().join(name));
        for side in [&here, &there] {
            std::fs::create_dir_all(side.join("../data")).unwrap();
            std::fs::create_dir_all(side).unwrap();
        }
        let old = folder.path().join("here/data/a.csv");
        std::fs::write(&old, "old").unwrap();
        let file = PortablePath::new(&old, &here);
        assert_eq!(file.relative.as_deref(), Some("../data/a.csv"));
        assert_eq!(file.resolve(&here), old);
        assert_eq!(file.resolve(&there), old);
        let new = folder.path().join("there/data/a.csv");
        std::fs::write(&new, "new").unwrap();
        assert_eq!(file.resolve(&there), new);

        let mut value = serde_json::json!({"a": [old.to_str(), "other"], "b": {"c": old.to_str()}});
        PortablePath::resolve_all(&[file], &there, &mut value);
        let expected = serde_json::json!({"a": [new.to_str(), "other"], "b": {"c": new.to_str()}});
        assert_eq!(value, expected);
    }

    #[cfg(unix)]
    #[test]
    fn ways_go_up_and_down() {
        let way = |path: &str, folder: &str| relative(Path::new(path), Path::new(folder)).unwrap();
        assert_eq!(way("/a/b/c.csv", "/a/b"), "c.csv");
        assert_eq!(way("/a/b/c.csv", "/a/./x/../d/e"), "../../b/c.csv");
        assert_eq!(way("/a.csv", "/"), "a.csv");
        assert_eq!(relative(Path::new("a.csv"), Path::new("/b")), None);
    }
}
