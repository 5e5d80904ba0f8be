//! Sizes, headlines and words that do not belong, over every source file of the tree.

use std::collections::BTreeSet;

use crate::tree::{Source, assert_finds, assert_none, code_of, in_memory, is_word, module_path, sources};

const LONGEST_FILE: usize = 600;
const LONGEST_MEDIAN: usize = 200;

/// Files that are too long, and too long a median of the Rust files of `src`.
fn size_faults(files: &[Source]) -> Vec<String> {
    let lines = |text: &str| text.lines().count();
    let long = files.iter().filter(|(_, text)| lines(text) > LONGEST_FILE);
    let mut faults: Vec<_> = long.map(|(path, text)| format!("{path} has {} lines", lines(text))).collect();
    let rust = files.iter().filter(|(path, _)| path.starts_with("src/") && path.ends_with(".rs"));
    let mut lengths: Vec<_> = rust.map(|(_, text)| lines(text)).collect();
    lengths.sort_unstable();
    let median = lengths.get(lengths.len() / 2).copied().unwrap_or(0);
    if median >= LONGEST_MEDIAN {
        faults.push(format!("the median file of src has {median} lines"));
    }
    faults
}

/// Files whose first line does not say what they are.
fn missing_headlines(files: &[Source]) -> Vec<String> {
    let silent = files.iter().filter(|(_, text)| !text.starts_with("//! "));
    silent.map(|(path, _)| format!("{path} does not begin with a `//!` line")).collect()
}

/// Unfinished work and skipped tests anywhere; unit tests in `src`, which would compile the library twice.
fn unfinished(files: &[Source]) -> Vec<String> {
    // In two parts each, or this file would be a find.
    let everywhere = [("to", "do!("), ("unimple", "mented!("), ("#[ig", "nore"), ("TO", "DO"), ("FIX", "ME")]
        .map(|(a, b)| [a, b].concat());
    let in_src = ["#[cfg(", "test)]"].concat();
    let mut faults = Vec::new();
    for (path, text) in files {
        faults.extend(everywhere.iter().filter(|word| text.contains(*word)).map(|word| format!("{path} has {word}")));
        if path.starts_with("src/") && text.contains(&in_src) {
            faults.push(format!("{path} has {in_src}: tests live in tests/it"));
        }
    }
    faults
}

/// Code of the pure modules that names the GPU, the async runtime or HTTP.
fn impurities(files: &[Source]) -> Vec<String> {
    let mut faults = Vec::new();
    for (path, text) in
        files.iter().filter(|(path, _)| ["volume", "scene", "reference"].contains(&module_path(path)[0]))
    {
        let code = code_of(text);
        let words: BTreeSet<&str> = code.split(|c| !is_word(c)).collect();
        let strangers = ["wgpu", "tokio", "axum"].into_iter().filter(|name| words.contains(name));
        faults.extend(strangers.map(|name| format!("{path} names {name}")));
    }
    faults
}

#[test]
fn no_source_file_is_long() {
    let files = sources("", &["rs", "wgsl", "js", "py"]);
    assert!(files.iter().any(|(path, _)| path == "src/lib.rs"), "the walk finds src");
    assert_none(&size_faults(&files));
}

#[test]
fn the_size_check_finds_a_long_file_and_a_long_median() {
    let text = |lines: usize| "x\n".repeat(lines);
    let (longest, too_long, median) = (text(LONGEST_FILE), text(LONGEST_FILE + 1), text(LONGEST_MEDIAN));
    assert_none(&size_faults(&in_memory(&[("src/a.rs", ""), ("src/b.rs", ""), ("src/c.rs", &longest)])));
    assert_finds(&size_faults(&in_memory(&[("viewer/a.js", &too_long)])), &["viewer/a.js has 601 lines"]);
    assert_finds(&size_faults(&in_memory(&[("src/a.rs", "x"), ("src/b.rs", &median)])), &["median"]);
}

#[test]
fn every_source_file_says_what_it_is() {
    assert_none(&missing_headlines(&sources("src", &["rs"])));
    assert_finds(&missing_headlines(&in_memory(&[("a.rs", "//! What."), ("b.rs", "use x;\n//! Late.")])), &["b.rs"]);
}

#[test]
fn nothing_is_left_unfinished_or_skipped() {
    for folder in ["src", "shaders", "tests", "viewer", "benches", "clients"] {
        assert_none(&unfinished(&sources(folder, &["rs", "wgsl", "js", "html", "css", "py"])));
    }
}

#[test]
fn the_check_for_unfinished_work_finds_it() {
    let find = |path, parts: [&str; 2]| unfinished(&in_memory(&[(path, &parts.concat())]));
    assert_finds(&find("src/a.rs", ["fn f() { to", "do!() }"]), &["src/a.rs"]);
    assert_finds(&find("src/a.rs", ["unimple", "mented!(\"x\")"]), &["src/a.rs"]);
    assert_finds(&find("tests/it/a.rs", ["#[ig", "nore = \"slow\"]"]), &["tests/it/a.rs"]);
    assert_finds(&find("viewer/a.js", ["// FIX", "ME"]), &["viewer/a.js"]);
    assert_finds(&find("src/a.rs", ["#[cfg(", "test)]"]), &["tests live in"]);
    assert_none(&find("tests/it/a.rs", ["#[cfg(", "test)]"]));
}

#[test]
fn the_pure_modules_know_neither_gpu_nor_runtime_nor_http() {
    assert_none(&impurities(&sources("src", &["rs"])));
    let files =
        [("src/scene/a.rs", "// wgpu\nuse tokio::x;"), ("src/volume/b.rs", "axumatic"), ("src/gpu/c.rs", "wgpu")];
    assert_finds(&impurities(&in_memory(&files)), &["src/scene/a.rs names tokio"]);
}
