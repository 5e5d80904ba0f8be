//! The clients that come with the server: the Python package, and the JavaScript of docs/streaming.md.

use std::process::{Command, Output};

use crate::support::process::Process;
use crate::tree::{read, root};

const KEY: &str = "key-of-the-python-tests";

fn told(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// A Python that has what the client needs, in its folder.
fn python() -> Command {
    let ensured = Command::new(root().join("scripts/ensure-python.sh")).output().expect("bash runs scripts");
    assert!(ensured.status.success(), "{}", told(&ensured));
    let path = String::from_utf8(ensured.stdout).expect("UTF-8");
    let mut python = Command::new(path.trim());
    python.current_dir(root().join("clients/python")).env("PYTHONPATH", "src").env("PYTHONDONTWRITEBYTECODE", "1");
    python
}

#[test]
fn the_python_client_is_well_typed_and_works() {
    let cache = root().join("target/tools/python/mypy");
    let checked = python()
        .args(["-m", "mypy", "--strict", "src", "tests", "bench_stream.py", "--cache-dir"])
        .arg(cache)
        .output()
        .expect("it is installed");
    assert!(checked.status.success(), "{}", told(&checked));

    let server = Process::start(&["--volume", "procedural:gyroid:16", "--api-key", KEY]);
    let tested = python()
        .args(["-m", "unittest", "discover", "--start-directory", "tests"])
        .env("SPAO_URL", format!("http://{}", server.address))
        .env("SPAO_API_KEY", KEY)
        .output()
        .expect("it is installed");
    assert!(tested.status.success(), "{}", told(&tested));
    assert!(told(&tested).contains("Ran 10 tests"), "{}", told(&tested));
    server.stop_clean();
}

/// The script of a page.
fn script(page: &str) -> Option<&str> {
    let (_, rest) = page.split_once("<script type=\"module\">\n")?;
    rest.split_once("</script>").map(|(script, _)| script)
}

#[test]
fn the_javascript_client_of_the_documentation_is_short_and_correct() {
    let documentation = read("docs/streaming.md");
    let script = script(&documentation).expect("the page has a client");
    let lines = script.lines().count();
    assert!(lines < 40, "{lines} lines");
    let promise = format!("in {lines} lines of JavaScript");
    assert!(documentation.contains(&promise), "the page says how many lines there are: {promise}");
    for said in ["'hello'", "'ack'", "'update'", "'welcome'", "resume_token"] {
        assert!(script.contains(said), "{said}");
    }
    let node = |script: &str| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("client.mjs");
        std::fs::write(&path, script).expect("writable");
        Command::new("node").arg("--check").arg(path).output()
    };
    if let Ok(checked) = node(script) {
        assert!(checked.status.success(), "{}", told(&checked));
        let broken = node("const = 1;").expect("it ran before");
        assert!(!broken.status.success());
    }
}
