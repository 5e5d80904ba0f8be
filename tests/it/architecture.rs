//! The layers of ARCHITECTURE.md, checked against what each module really uses.

use std::collections::{BTreeMap, BTreeSet};

use crate::tree::{Source, assert_finds, assert_none, code_of, in_memory, is_word, module_path, read, sources};

/// What each module uses, by name.
type Edges = BTreeMap<String, BTreeSet<String>>;

fn leading_word(text: &str) -> &str {
    &text[..text.find(|c| !is_word(c)).unwrap_or(text.len())]
}

/// The first names of a path or of a braced group: `a::b` gives a, `{a::{b, c}, d}` gives a and d.
fn first_names(text: &str) -> Vec<&str> {
    let Some(group) = text.trim_start().strip_prefix('{') else {
        return vec![leading_word(text)];
    };
    let mut depth = 0;
    let mut names = vec![leading_word(group.trim_start())];
    for (at, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => break,
            '}' => depth -= 1,
            ',' if depth == 0 => names.push(leading_word(group[at + 1..].trim_start())),
            _ => {}
        }
    }
    names
}

/// Modules that the code of one file names, by `crate::`, by as many `super::` as lead to the crate's root, or, from
/// `main.rs`, by the library's name.
fn used_modules(path: &str, code: &str, modules: &BTreeSet<String>) -> BTreeSet<String> {
    let mut prefixes = vec!["crate::".to_owned(), "super::".repeat(module_path(path).len())];
    if path == "src/main.rs" {
        prefixes = vec!["spao_server::".to_owned()];
    }
    let mut used = BTreeSet::new();
    for prefix in &prefixes {
        for (at, _) in code.match_indices(prefix.as_str()) {
            if code[..at].ends_with(is_word) {
                continue;
            }
            let names = first_names(&code[at + prefix.len()..]);
            used.extend(names.into_iter().filter(|name| modules.contains(*name)).map(str::to_owned));
        }
    }
    used
}

/// Which module uses which, over all files of `src`; `lib.rs` only declares them.
fn used_edges(files: &[Source]) -> Edges {
    let files = files.iter().filter(|(path, _)| path != "src/lib.rs");
    let modules = files.clone().map(|(path, _)| module_path(path)[0].to_owned()).collect();
    let mut edges = Edges::new();
    for (path, text) in files {
        let module = module_path(path)[0];
        let mut used = used_modules(path, &code_of(text), &modules);
        used.remove(module);
        edges.entry(module.to_owned()).or_default().extend(used);
    }
    edges
}

/// The table under `## Layers`, from the top down: rows `| module | may use |`, names apart by commas.
fn layer_table(architecture: &str) -> Vec<(String, BTreeSet<String>)> {
    let section = architecture.split("\n## ").find(|section| section.starts_with("Layers\n")).unwrap_or("");
    let names = |cell: &str| -> Vec<String> {
        cell.split(',').map(|name| name.trim().trim_matches('`').to_owned()).filter(|name| !name.is_empty()).collect()
    };
    let rows = section.lines().filter(|line| line.starts_with('|')).skip(2);
    rows.filter_map(|row| {
        let cells: Vec<&str> = row.trim_matches('|').split('|').collect();
        Some((names(cells.first()?).pop()?, names(cells.get(1)?).into_iter().collect()))
    })
    .collect()
}

/// Where the table and the code disagree, in either direction, and where the table itself points up.
fn layer_faults(architecture: &str, files: &[Source]) -> Vec<String> {
    let table = layer_table(architecture);
    let edges = used_edges(files);
    let mut faults = Vec::new();
    for (row, (module, allowed)) in table.iter().enumerate() {
        for other in allowed {
            if !table[row + 1..].iter().any(|(below, _)| below == other) {
                faults.push(format!("the table lets {module} use {other}, which is not a row below it"));
            }
        }
        let Some(used) = edges.get(module) else {
            faults.push(format!("the table has {module}, which is no module"));
            continue;
        };
        faults.extend(used.difference(allowed).map(|other| format!("{module} uses {other}, which the table forbids")));
        faults
            .extend(allowed.difference(used).map(|other| format!("the table lets {module} use {other}; it does not")));
    }
    let missing = edges.keys().filter(|module| !table.iter().any(|(row, _)| row == *module));
    faults.extend(missing.map(|module| format!("the table lacks {module}, which uses {:?}", edges[module])));
    faults
}

/// The rows as the code would have them, in the order of the table.
fn true_rows(architecture: &str, files: &[Source]) -> String {
    let edges = used_edges(files);
    let row = |(module, _): (String, _)| {
        let used: Vec<_> = edges.get(&module)?.iter().map(|other| format!("`{other}`")).collect();
        Some(format!("| `{module}` | {} |\n", used.join(", ")))
    };
    layer_table(architecture).into_iter().filter_map(row).collect()
}

#[test]
fn modules_use_each_other_as_the_table_of_architecture_md_says() {
    let (architecture, files) = (read("ARCHITECTURE.md"), sources("src", &["rs"]));
    let mut faults = layer_faults(&architecture, &files);
    if !faults.is_empty() {
        faults.push(format!("\nthe rows as the code has them:\n{}", true_rows(&architecture, &files)));
    }
    assert_none(&faults);
}

#[test]
fn the_layer_check_finds_every_kind_of_disagreement() {
    let table =
        "# A\n\n## Layers\n\n| module | may use |\n|---|---|\n| `top` | `low` |\n| `low` | |\n\n## Next\n| x | y |\n";
    let good = [
        ("src/top.rs", "use crate::low::X;"),
        ("src/low/mod.rs", "// crate::top\nuse super::Y;"),
        ("src/lib.rs", "crate::x"),
    ];
    assert_none(&layer_faults(table, &in_memory(&good)));

    let with = |path, text| in_memory(&[good[0], (path, text), good[1]]);
    assert_finds(&layer_faults(table, &with("src/low/up.rs", "fn f() { crate::top::g() }")), &["low uses top"]);
    assert_finds(
        &layer_faults(table, &with("src/low/up.rs", "use crate::{\n  low::{self, z},\n  top};")),
        &["low uses top"],
    );
    assert_finds(&layer_faults(table, &with("src/low/up.rs", "use super::super::top;")), &["low uses top"]);
    assert_finds(&layer_faults(table, &with("src/new.rs", "")), &["lacks new"]);
    assert_finds(
        &layer_faults(table, &with("src/main.rs", "use spao_server::top;")),
        &["lacks main, which uses {\"top\"}"],
    );

    let idle = in_memory(&[("src/top.rs", ""), good[1]]);
    assert_finds(&layer_faults(table, &idle), &["lets top use low; it does not"]);
    assert_finds(
        &layer_faults(table, &in_memory(&good[..1])),
        &["low, which is no module", "lets top use low; it does not"],
    );
    let upward = table.replace("| `low` | |", "| `low` | `top` |");
    assert_finds(&layer_faults(&upward, &with("src/low/up.rs", "use crate::top;")), &["not a row below it"]);
    assert_finds(&layer_faults("no table", &in_memory(&good)), &["lacks top", "lacks low"]);
}
