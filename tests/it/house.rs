//! What the Makefile, the CI script and the container files run: the commands, and the flags they pass to the real binary.

use std::collections::BTreeSet;
use std::process::{Command, Output};

use crate::tree::{assert_finds, assert_none, read, root};

/// Words of a text that could be commands or flags, comments apart.
fn words(text: &str) -> Vec<String> {
    let code = text.lines().filter(|line| !line.trim_start().starts_with('#'));
    let words = code.flat_map(|line| line.split(|c: char| !(c.is_ascii_alphanumeric() || c == '-')));
    words.map(str::to_owned).collect()
}

/// Every `--flag` after the last word `serve`.
fn serve_flags(text: &str) -> BTreeSet<String> {
    let words = words(text);
    let Some(serve) = words.iter().rposition(|word| word == "serve") else {
        return BTreeSet::new();
    };
    words.into_iter().skip(serve).filter(|word| word.len() > 2 && word.starts_with("--")).collect()
}

/// Flags of a text that the help does not name.
fn unknown_flags(text: &str, help: &str) -> Vec<String> {
    let known = words(help);
    serve_flags(text).into_iter().filter(|flag| !known.contains(flag)).collect()
}

/// What `make target` would run, without running it.
fn recipe(target: &str) -> String {
    let mut make = Command::new("make");
    // The tests run below `make test`, whose flags are not meant for this one.
    make.env_remove("MAKEFLAGS").env_remove("MAKELEVEL").env_remove("MFLAGS");
    let output = make.args(["--dry-run", target]).current_dir(root()).output().expect("make is what runs the tests");
    assert!(output.status.success(), "{}", stderr(&output));
    String::from_utf8(output.stdout).expect("recipes are UTF-8")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn server(arguments: &[&str]) -> String {
    let output =
        Command::new(env!("CARGO_BIN_EXE_spao-server")).args(arguments).output().expect("the binary was built");
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    String::from_utf8(output.stdout).expect("help is UTF-8")
}

#[test]
fn every_flag_that_the_makefile_and_the_container_files_pass_exists() {
    let help = server(&["serve", "--help"]);
    for path in ["docker/Dockerfile", "docker/compose.nvidia.yaml"] {
        let text = read(path);
        assert!(serve_flags(&text).contains("--volume"), "{path}: flags are found");
        assert_none(&unknown_flags(&text, &help));
    }
    assert_none(&unknown_flags(&recipe("run"), &help));
    assert_finds(&unknown_flags("serve --addr x --adr y", "  --addr <ADDR>"), &["--adr"]);
    server(&["healthcheck", "--help"]);
}

#[test]
fn make_run_and_make_test_need_no_other_command() {
    let (run, test) = (recipe("run"), recipe("test"));
    for recipe in [&run, &test] {
        assert!(recipe.starts_with("scripts/ensure-vulkan.sh\n"), "{recipe}");
    }
    let volume = run.split("--volume ").nth(1).and_then(|rest| rest.split_whitespace().next()).expect("a demo volume");
    assert!(root().join(volume).is_file(), "{volume}");
    for promised in
        ["fmt --check", "clippy", "-D warnings", "cargo doc", "cargo-deny.sh bans licenses sources", "cargo test"]
    {
        assert!(test.contains(promised), "`make test` lacks {promised}");
    }
}

#[test]
fn ci_runs_what_the_readme_promises() {
    let (script, readme) = (read(".ci/run"), read("README.md"));
    let commands: Vec<_> = script.lines().filter(|line| line.starts_with("make ")).collect();
    assert_eq!(commands, ["make test"]);
    for promise in ["make run", "make test"] {
        assert!(readme.contains(promise), "README.md does not name `{promise}`");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_vulkan_driver_that_is_named_but_missing_is_an_error_and_installs_nothing() {
    let mut script = Command::new("/bin/bash");
    script.arg("scripts/ensure-vulkan.sh").env("PATH", "/nowhere").env("VK_DRIVER_FILES", "/nowhere/icd.json");
    let output = script.current_dir(root()).output().expect("bash is where Debian has it");
    assert!(!output.status.success());
    assert!(
        stderr(&output).contains("VK_DRIVER_FILES") && stderr(&output).contains("/nowhere/icd.json"),
        "{}",
        stderr(&output)
    );
}
