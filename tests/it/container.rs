//! What the container files promise, as far as it can be checked without a container engine.

use std::path::Path;

use crate::tree::{Source, assert_finds, assert_none, in_memory, read, root, sources};

/// Instructions of a Dockerfile in order: keyword and the rest, continued lines joined, comments dropped.
fn instructions(dockerfile: &str) -> Vec<(String, String)> {
    let lines = dockerfile.lines().filter(|line| !line.trim_start().starts_with('#'));
    let joined = lines.collect::<Vec<_>>().join("\n").replace("\\\n", " ");
    let split = joined.lines().filter_map(|line| line.trim().split_once(' '));
    split.map(|(keyword, rest)| (keyword.to_owned(), rest.trim().to_owned())).collect()
}

/// Sources of the `COPY` instructions that read the repository.
fn copied(dockerfile: &str) -> Vec<String> {
    let copies =
        instructions(dockerfile).into_iter().filter(|(keyword, rest)| keyword == "COPY" && !rest.starts_with("--from"));
    copies
        .flat_map(|(_, rest)| {
            let mut paths: Vec<_> = rest.split_whitespace().map(str::to_owned).collect();
            paths.pop();
            paths
        })
        .collect()
}

/// The words of an exec form; nothing if it is not one.
fn exec_form(rest: &str) -> Option<Vec<String>> {
    serde_json::from_str(rest).ok()
}

/// Broken promises of the image: see the texts.
fn dockerfile_faults(dockerfile: &str) -> Vec<String> {
    let all = instructions(dockerfile);
    let last_stage = all.iter().rposition(|(keyword, _)| keyword == "FROM").unwrap_or(0);
    let last =
        |keyword: &str| all[last_stage..].iter().rfind(|(k, _)| k == keyword).map_or("", |(_, rest)| rest.as_str());
    let mut faults = Vec::new();
    let mut expect = |holds: bool, fault: &str| {
        if !holds {
            faults.push(fault.to_owned());
        }
    };
    expect(
        exec_form(last("ENTRYPOINT")) == Some(vec!["spao-server".to_owned()]),
        "ENTRYPOINT is not [\"spao-server\"]",
    );
    let command = exec_form(last("CMD")).unwrap_or_default();
    expect(command.first().is_some_and(|word| word == "serve"), "CMD is not an exec form of `serve`");
    expect(!command.iter().any(|word| word == "--no-auth"), "the image runs open");
    let user = last("USER").split(':').next().unwrap_or("");
    expect(!["", "0", "root"].contains(&user), "the image runs as root");
    let probe = last("HEALTHCHECK").split_once("CMD ").and_then(|(_, probe)| exec_form(probe));
    expect(probe.is_some_and(|words| words == ["spao-server", "healthcheck"]), "HEALTHCHECK is not the binary's own");
    expect(last("STOPSIGNAL") == "SIGTERM", "the image is not stopped by SIGTERM, which drains");
    expect(last("EXPOSE") == "8080", "port 8080 is not exposed");
    let capabilities = last("ENV").strip_prefix("NVIDIA_DRIVER_CAPABILITIES=").unwrap_or("");
    expect(capabilities.split(',').any(|name| name == "graphics"), "an NVIDIA GPU would come without Vulkan");
    let packages = last("RUN");
    for package in ["libvulkan1", "mesa-vulkan-drivers", "ca-certificates", "libegl1", "libxext6"] {
        expect(packages.split_whitespace().any(|word| word == package), &format!("{package} is not installed"));
    }
    faults
}

/// Files that the image is to copy and that are missing, or that .dockerignore (`*`, then `!` lines) keeps out.
fn copy_faults(dockerfile: &str, dockerignore: &str, exists: impl Fn(&str) -> bool) -> Vec<String> {
    let admitted: Vec<_> = dockerignore.lines().filter_map(|line| line.strip_prefix('!')).collect();
    let mut faults = Vec::new();
    for path in copied(dockerfile) {
        if !exists(&path) {
            faults.push(format!("COPY {path}: no such file"));
        }
        if !admitted.iter().any(|folder| Path::new(&path).starts_with(folder)) {
            faults.push(format!("COPY {path}: .dockerignore keeps it out"));
        }
    }
    faults
}

/// Files that the code includes when it is compiled, and that the image's build does not copy.
fn included_but_not_copied(dockerfile: &str, files: &[Source]) -> Vec<String> {
    let copied = copied(dockerfile);
    let mut faults = Vec::new();
    for (path, text) in files {
        // The first literal: the file, or with `concat!` the folder it is in.
        let includes =
            text.split("include_").skip(1).filter(|rest| rest.starts_with("str!(") || rest.starts_with("bytes!("));
        let names = includes.filter_map(|rest| rest.split('"').nth(1));
        for name in names {
            let mut parts: Vec<&str> = path.split('/').collect();
            parts.pop();
            for part in name.trim_end_matches('/').split('/') {
                match part {
                    ".." => {
                        parts.pop();
                    }
                    _ => parts.push(part),
                }
            }
            faults.extend(not_copied(&copied, path, &parts.join("/")));
        }
        // A folder that is embedded as a whole, named from the root.
        for rest in text.split("#[folder = \"").skip(1) {
            let folder = rest.split('"').next().unwrap_or_default();
            faults.extend(not_copied(&copied, path, folder.trim_end_matches('/')));
        }
    }
    faults
}

fn not_copied(copied: &[String], path: &str, included: &str) -> Option<String> {
    let found = copied.iter().any(|folder| Path::new(included).starts_with(folder));
    (!found).then(|| format!("{path} includes {included}, which the image's build does not copy"))
}

/// Broken promises of a compose file: keys are demanded, the image does not run open, a GPU file demands a GPU.
fn compose_faults(compose: &str, gpu: bool) -> Vec<String> {
    let has = |words: &str| compose.lines().any(|line| !line.trim_start().starts_with('#') && line.contains(words));
    let mut faults = Vec::new();
    let mut expect = |holds: bool, fault: &str| {
        if !holds {
            faults.push(fault.to_owned());
        }
    };
    expect(has("SPAO_API_KEYS: ${SPAO_API_KEYS:?") || has("file: compose.yaml"), "no key is demanded");
    expect(!has("--no-auth"), "the server runs open");
    expect(!gpu || has("- --require-gpu"), "the GPU is not demanded of the server");
    expect(!gpu || (has("driver: nvidia") && has("capabilities: [gpu]")), "no GPU is reserved");
    faults
}

#[test]
fn the_image_keeps_its_promises() {
    let dockerfile = read("docker/Dockerfile");
    assert_none(&dockerfile_faults(&dockerfile));
    assert_none(&copy_faults(&dockerfile, &read(".dockerignore"), |path| root().join(path).exists()));
    assert_none(&included_but_not_copied(&dockerfile, &sources("src", &["rs"])));
    assert!(copied(&dockerfile).iter().any(|path| path == "src"), "COPY lines are found");
    assert!(!root().join("build.rs").exists() || copied(&dockerfile).iter().any(|path| path == "build.rs"));
}

#[test]
fn the_image_check_finds_every_broken_promise() {
    let dockerfile = read("docker/Dockerfile");
    let broken = |from: &str, to: &str, fault: &str| {
        assert!(dockerfile.contains(from), "{from}");
        assert_finds(&dockerfile_faults(&dockerfile.replace(from, to)), &[fault]);
    };
    broken("ENTRYPOINT [\"spao-server\"]", "ENTRYPOINT spao-server", "ENTRYPOINT");
    broken("CMD [\"serve\", ", "CMD serve [", "exec form");
    broken("CMD [\"serve\", ", "CMD [\"serve\", \"--no-auth\", ", "runs open");
    broken("USER 10001:10001", "USER root", "as root");
    broken("USER 10001:10001\n", "", "as root");
    broken("CMD [\"spao-server\", \"healthcheck\"]", "CMD curl localhost", "HEALTHCHECK");
    broken("STOPSIGNAL SIGTERM", "STOPSIGNAL SIGKILL", "SIGTERM");
    broken("EXPOSE 8080", "EXPOSE 80", "8080");
    broken("=graphics,", "=", "without Vulkan");
    broken(" mesa-vulkan-drivers", "", "mesa-vulkan-drivers");

    let (copies, ignore) = ("FROM a\nCOPY src/x data \\\n  b/\nCOPY --from=a /c /c\n", "*\n!src\n!data\n");
    assert_none(&copy_faults(copies, ignore, |_| true));
    assert_finds(&copy_faults(copies, ignore, |path| path != "data"), &["data: no such file"]);
    assert_finds(&copy_faults(copies, "*\n!data", |_| true), &["src/x: .dockerignore"]);

    let include = ["const A: &str = include_", "str!(\"../../viewer/a.html\");"].concat();
    let files = in_memory(&[("src/api/a.rs", &include)]);
    assert_none(&included_but_not_copied("COPY viewer viewer", &files));
    assert_finds(&included_but_not_copied("COPY src src", &files), &["viewer/a.html"]);

    let include = ["include_", "bytes!(concat!(\"../shaders/\", $name))"].concat();
    let files = in_memory(&[("src/a.rs", &include)]);
    assert_none(&included_but_not_copied("COPY shaders b", &files));
    assert_finds(&included_but_not_copied("COPY src src", &files), &["includes shaders,"]);

    let files = in_memory(&[("src/a.rs", "#[folder = \"pages/\"]\nstruct Files;")]);
    assert_none(&included_but_not_copied("COPY pages pages", &files));
    assert_finds(&included_but_not_copied("COPY src src", &files), &["includes pages,"]);
}

#[test]
fn the_compose_files_demand_keys_and_a_gpu_where_they_promise_one() {
    let (cpu, gpu) = (read("docker/compose.yaml"), read("docker/compose.nvidia.yaml"));
    assert_none(&compose_faults(&cpu, false));
    assert_none(&compose_faults(&gpu, true));
    assert_finds(&compose_faults(&cpu.replace(":?", ":-"), false), &["no key"]);
    assert_finds(&compose_faults(&gpu.replace("--require-gpu", "--no-auth"), true), &["runs open", "not demanded"]);
    assert_finds(&compose_faults(&gpu.replace("driver: nvidia", ""), true), &["reserved"]);
}
