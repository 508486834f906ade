//! The materials of a batch: which files they are in, and what each is called.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use anyhow::{Context, Result, bail};
use glob::MatchOptions;

use crate::cli::input::is_standard_input;

/// One material of a batch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Input {
    /// The name of its folder, which no other material of the batch has.
    pub(super) name: String,
    /// Its file, or the name of a built-in material.
    pub(super) path: PathBuf,
}

/// The materials that arguments name: files, patterns of files, and built-in materials. A file that is named twice is
/// taken once. A name that is a file is no pattern.
///
/// # Errors
/// A pattern that no file matches, a folder that cannot be listed, and `-`.
pub(super) fn expand(arguments: &[PathBuf]) -> Result<Vec<Input>> {
    let mut paths = Vec::new();
    for argument in arguments {
        if is_standard_input(argument) {
            bail!("-: expected files and built-in materials, found standard input");
        }
        match argument.to_str() {
            Some(pattern) if !argument.is_symlink() && !argument.exists() && is_pattern(pattern) => {
                paths.extend(matches(pattern)?);
            }
            _ => paths.push(argument.clone()),
        }
    }
    let mut seen = BTreeSet::new();
    paths.retain(|path| seen.insert(path.canonicalize().unwrap_or_else(|_| path.clone())));
    let names = names(&paths);
    Ok(names.into_iter().zip(paths).map(|(name, path)| Input { name, path }).collect())
}

fn is_pattern(text: &str) -> bool {
    text.contains(['*', '?', '['])
}

/// The files that match a pattern, in the order of their names.
fn matches(pattern: &str) -> Result<Vec<PathBuf>> {
    let options = MatchOptions { require_literal_leading_dot: true, ..MatchOptions::default() };
    let found = glob::glob_with(pattern, options)
        .with_context(|| format!("\"{pattern}\": expected a pattern of file names"))?;
    let mut files = Vec::new();
    for path in found {
        let path = path.with_context(|| format!("\"{pattern}\""))?;
        if !path.is_dir() {
            files.push(path);
        }
    }
    if files.is_empty() {
        bail!("\"{pattern}\": expected a pattern that files match, found none");
    }
    Ok(files)
}

/// A name for each path that differs from all others, also where capitals do not count: the stem of the file; where
/// several have the same one, the whole name of the file, and then as many of its folders as tell them apart.
fn names(paths: &[PathBuf]) -> Vec<String> {
    let mut levels = vec![0; paths.len()];
    loop {
        let names: Vec<String> = paths.iter().zip(&levels).map(|(path, &level)| name(path, level)).collect();
        let mut alike: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (index, name) in names.iter().enumerate() {
            alike.entry(name.to_lowercase()).or_default().push(index);
        }
        let mut is_changed = false;
        for index in alike.into_values().filter(|group| group.len() > 1).flatten() {
            if name(&paths[index], levels[index] + 1) != names[index] {
                levels[index] += 1;
                is_changed = true;
            }
        }
        if !is_changed {
            return numbered(names);
        }
    }
}

/// The name of a path: at level 0 its stem, at level 1 its file name, and one more of its folders at each level above.
fn name(path: &Path, level: usize) -> String {
    let text =
        |part: Option<&std::ffi::OsStr>| part.unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    if level == 0 {
        return text(path.file_stem());
    }
    let folders = path.parent().into_iter().flat_map(Path::components).filter_map(|part| match part {
        Component::Normal(part) => Some(part.to_string_lossy().into_owned()),
        _ => None,
    });
    let folders: Vec<String> = folders.collect();
    let mut parts = folders[folders.len().saturating_sub(level - 1)..].to_vec();
    parts.push(text(path.file_name()));
    parts.join("-")
}

/// Names with a number behind those that are still alike.
fn numbered(names: Vec<String>) -> Vec<String> {
    let all: BTreeSet<String> = names.iter().map(|name| name.to_lowercase()).collect();
    let mut taken = BTreeSet::new();
    let mut unique = Vec::with_capacity(names.len());
    for name in names {
        let mut chosen = name.clone();
        let mut number = 2;
        while taken.contains(&chosen.to_lowercase())
            || (chosen != name && all.contains(&chosen.to_lowercase()))
        {
            chosen = format!("{name}-{number}");
            number += 1;
        }
        taken.insert(chosen.to_lowercase());
        unique.push(chosen);
    }
    unique
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(paths: &[&str]) -> Vec<String> {
        names(&paths.iter().map(PathBuf::from).collect::<Vec<_>>())
    }

    #[test]
    fn names_are_as_short_as_they_differ() {
        assert_eq!(named(&["x/a.csv", "x/b.csv", "ward"]), ["a", "b", "ward"]);
        assert_eq!(named(&["x/a.csv", "x/a.bsdf", "b.csv"]), ["a.csv", "a.bsdf", "b"]);
        assert_eq!(named(&["x/y/a.csv", "z/y/a.csv", "a.bsdf"]), ["x-y-a.csv", "z-y-a.csv", "a.bsdf"]);
        assert_eq!(named(&["a.csv", "x/A.csv"]), ["a.csv", "x-A.csv"]);
        assert_eq!(named(&["x-a.csv", "x/a.csv", "a.csv", "./a.csv"])[..2], ["x-a", "x-a.csv"]);
    }

    #[test]
    fn names_always_differ() {
        let paths = ["a.csv", "/a.csv", "./a.csv", "../a.csv", "a.csv-2", "A.CSV", "a", "..", "/"];
        let names: BTreeSet<String> = named(&paths).iter().map(|name| name.to_lowercase()).collect();
        assert_eq!(names.len(), paths.len(), "{names:?}");
    }

    #[test]
    fn patterns_are_expanded_and_files_taken_once() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.csv", "a.csv", "c.txt", ".hidden.csv", "[x].csv"] {
            std::fs::write(folder.path().join(name), "x").unwrap();
        }
        std::fs::create_dir(folder.path().join("d.csv")).unwrap();
        let found = |names: &[&str]| {
            let paths: Vec<PathBuf> = names.iter().map(|name| folder.path().join(name)).collect();
            Ok::<_, anyhow::Error>(expand(&paths)?.into_iter().map(|input| input.name).collect::<Vec<_>>())
        };
        assert_eq!(found(&["*.csv"]).unwrap(), ["[x]", "a", "b"]);
        assert_eq!(found(&["b.csv", "[ab].csv", "c.txt"]).unwrap(), ["b", "a", "c"]);
        assert_eq!(found(&["[x].csv"]).unwrap(), ["[x]"]);
        assert!(found(&["*.none"]).unwrap_err().to_string().contains("found none"));
        assert!(found(&["a***.csv"]).unwrap_err().to_string().contains("expected a pattern"));
    }
}
