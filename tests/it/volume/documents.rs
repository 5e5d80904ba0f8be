//! What the documents say of formats, against the table of formats and the messages in the code.

use spao_server::volume::{Format, VolumeError, format};

use crate::tree::{assert_finds, assert_none, read, sources};

/// Rows under a heading: cells without the outer bars.
fn rows(page: &str, heading: &str) -> Vec<Vec<String>> {
    let section = page.split("\n## ").find(|section| section.starts_with(heading)).unwrap_or("");
    let rows = section.lines().filter(|line| line.starts_with('|')).skip(2);
    rows.map(|row| row.trim_matches('|').split(" | ").map(|cell| cell.trim().to_owned()).collect()).collect()
}

/// Formats without a row, and rows without a format.
fn format_faults(page: &str) -> Vec<String> {
    let rows: Vec<_> = rows(page, "What is read").into_iter().map(|cells| cells[0].clone()).collect();
    let names: Vec<_> = Format::all().map(|format| format!("`{}`", format.name())).collect();
    let missing = names.iter().filter(|name| !rows.contains(name)).map(|name| format!("no row for {name}"));
    let strange = rows.iter().filter(|row| !names.contains(row)).map(|row| format!("{row} is not a format"));
    missing.chain(strange).collect()
}

/// Messages of the page that the code does not have.
fn message_faults(page: &str, code: &str) -> Vec<String> {
    let messages = rows(page, "What is refused").into_iter().map(|cells| cells[2].trim_matches('"').to_owned());
    messages.filter(|message| !code.contains(message)).map(|message| format!("nothing says `{message}`")).collect()
}

/// The code of the volumes, with strings that go on in the next line in one piece.
fn code() -> String {
    let files = sources("src/volume", &["rs"]).into_iter().map(|(_, text)| text);
    let mut code = String::new();
    for line in files.collect::<String>().lines() {
        code.push_str(line.trim_start().trim_end_matches('\\'));
        if !line.ends_with('\\') {
            code.push('\n');
        }
    }
    code
}

#[test]
fn every_format_stands_in_the_table_of_formats() {
    let page = read("docs/formats.md");
    assert_none(&format_faults(&page));
    assert_finds(
        &format_faults(&page.replace("| `vti` | `.vti` |", "| `vtj` | `.vti` |")),
        &["no row for `vti`", "`vtj`"],
    );
}

#[test]
fn files_of_the_table_are_recognised_by_their_names() {
    for cells in rows(&read("docs/formats.md"), "What is read") {
        for ending in cells[1].split(", ").map(|ending| ending.trim_matches(['`', '.'])) {
            for name in [ending.to_owned(), format!("{ending}.gz"), format!("{ending}.zst")] {
                assert_eq!(format!("`{}`", Format::from_name(&name).expect(&name).name()), cells[0]);
            }
            assert_eq!(format::bare_name(&format!("a.b.{ending}.gz")), "a.b");
        }
    }
}

#[test]
fn messages_of_the_table_are_those_of_the_code() {
    let (page, code) = (read("docs/formats.md"), code());
    assert!(rows(&page, "What is refused").len() > 20);
    assert_none(&message_faults(&page, &code));
    assert_finds(&message_faults(&page.replace("unpack it once", "unpack it twice"), &code), &["unpack it twice"]);
}

#[test]
fn the_contract_and_the_readme_name_every_format() {
    let contract: serde_json::Value = serde_json::from_str(&read("src/api/openapi.json")).expect("JSON");
    let parameters = contract["paths"]["/v1/volumes"]["post"]["parameters"].as_array().expect("parameters");
    let parameter = parameters.iter().find(|parameter| parameter["name"] == "format").expect("the format");
    let names: Vec<_> = Format::all().map(Format::name).collect();
    assert_eq!(parameter["schema"]["enum"], serde_json::json!(names));
    let readme = read("README.md");
    let error = Format::from_name("?").expect_err("no format");
    assert!(matches!(error, VolumeError::Unsupported { .. }));
    for name in names {
        assert!(readme.contains(&format!("`{name}`")) && error.to_string().contains(name), "{name}");
    }
}
