//! The repository's own files, as texts that checks can read, and what such checks have in common.

use std::fs;
use std::path::Path;

/// A file of the tree: its path from the root, with `/`, and its text.
pub(crate) type Source = (String, String);

/// The repository's root.
pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The text of a file named from the root.
pub(crate) fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Every file below `folder` (from the root; "" is the root) with one of the extensions, sorted; not build output.
pub(crate) fn sources(folder: &str, extensions: &[&str]) -> Vec<Source> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        let Ok(entries) = fs::read_dir(root().join(&folder)) else {
            continue;
        };
        for entry in entries {
            let name = entry.expect("a folder that can be opened can be listed").file_name();
            let name = name.to_str().expect("our file names are UTF-8");
            if name.starts_with('.') || ["target", "node_modules", "__pycache__"].contains(&name) {
                continue;
            }
            let path = if folder.is_empty() { name.to_owned() } else { format!("{folder}/{name}") };
            if root().join(&path).is_dir() {
                folders.push(path);
            } else if extensions.iter().any(|extension| name.ends_with(&format!(".{extension}"))) {
                found.push((path.clone(), read(&path)));
            }
        }
    }
    found.sort();
    found
}

/// The path below `src/` in parts, without `.rs` and `mod`: `src/volume/grid.rs` is `[volume, grid]`.
pub(crate) fn module_path(path: &str) -> Vec<&str> {
    let path = path.strip_prefix("src/").unwrap_or(path);
    let path = path.strip_suffix(".rs").unwrap_or(path);
    path.split('/').filter(|part| *part != "mod").collect()
}

/// The text without line comments, so that a link in documentation is no dependency.
pub(crate) fn code_of(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// What names are made of.
pub(crate) fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Files that are not there, for showing that a check finds what it looks for.
pub(crate) fn in_memory(files: &[(&str, &str)]) -> Vec<Source> {
    files.iter().map(|(path, text)| ((*path).to_owned(), (*text).to_owned())).collect()
}

/// That a check found nothing.
#[track_caller]
pub(crate) fn assert_none(faults: &[String]) {
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

/// That the faults are exactly as many as given, and each holds its words.
#[track_caller]
pub(crate) fn assert_finds(faults: &[String], expected: &[&str]) {
    assert_eq!(faults.len(), expected.len(), "{faults:#?}");
    for words in expected {
        assert!(faults.iter().any(|fault| fault.contains(words)), "no {words:?} in {faults:#?}");
    }
}
