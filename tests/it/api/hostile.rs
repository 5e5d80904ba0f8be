//! Hostile files sent to the real program: refused with a field, and nothing of them remains.

use std::fs;
use std::io::Write;
use std::path::Path;

use serde_json::{Value, json};

use crate::support::process::Process;
use crate::volume::makers::{MAKERS, Made, tiff_file};

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).expect("to memory");
    encoder.finish().expect("to memory")
}

fn tar(name: &str, kind: tar::EntryType, bytes: &[u8]) -> Vec<u8> {
    let mut header = tar::Header::new_ustar();
    header.set_size(bytes.len() as u64);
    header.set_entry_type(kind);
    header.as_mut_bytes()[..name.len()].copy_from_slice(name.as_bytes());
    header.set_link_name("/etc/passwd").expect("it is short");
    header.set_cksum();
    let mut archive = tar::Builder::new(Vec::new());
    archive.append(&header, bytes).expect("memory is written");
    archive.into_inner().expect("memory is written")
}

/// Files by name, none of which is a volume.
fn hostile() -> Vec<(String, Vec<u8>)> {
    let sound = Made::new([4, 3, 2]);
    let wrong = [
        ("empty", Made::new([4, 0, 2])),
        ("vast", Made { dims: [1 << 40; 3], ..sound.clone() }),
        ("short", Made { values: sound.values[1..].to_vec(), ..sound.clone() }),
        ("nan", Made { values: vec![f32::NAN; 24], ..sound.clone() }),
        ("infinite", Made { values: vec![f32::INFINITY; 24], ..sound.clone() }),
    ];
    let mut files = Vec::new();
    for maker in &MAKERS {
        let ending = maker.format.name().replace("metaimage", "mha").replace("nifti", "nii").replace("dicom", "dcm");
        for (what, made) in &wrong {
            files.push((format!("{what}.{ending}"), (maker.make)(made)));
        }
        let flat = Made { spacing: [1.0, f64::NAN, 1.0], ..sound.clone() };
        if maker.has_spacing {
            files.push((format!("nowhere.{ending}"), (maker.make)(&flat)));
            files.push((format!("nowhere.{ending}.gz"), gzip(&(maker.make)(&flat))));
        }
        let whole = (maker.make)(&sound);
        files.push((format!("cut.{ending}"), whole[..whole.len() / 2].to_vec()));
        let wrapped = gzip(&whole);
        files.push((format!("cut.{ending}.gz"), wrapped[..wrapped.len() / 2].to_vec()));
        files.push((format!("twice.{ending}.gz"), gzip(&wrapped)));
    }
    let endless = [&b"NRRD0005\n"[..], &vec![0; 64 << 20]].concat();
    files.push(("endless.nrrd.gz".into(), gzip(&endless)));
    let dicom = (MAKERS[6].make)(&sound);
    files.push(("out.tar".into(), tar("../../out.dcm", tar::EntryType::Regular, &dicom)));
    files.push(("absolute.tar".into(), tar("/etc/out.dcm", tar::EntryType::Regular, &dicom)));
    files.push(("link.tar".into(), tar("a.dcm", tar::EntryType::Symlink, b"")));
    files.push(("hard_link.tar".into(), tar("a.dcm", tar::EntryType::Link, b"")));
    let page = vec![[0x100, 4, 1, 4], [0x101, 4, 1, 4], [0x111, 4, 1 << 30, 8], [0x117, 4, 1 << 30, 8]];
    files.push(("strips.tif".into(), tiff_file(&[0; 64], &[page])));
    files
}

/// Status and body of an answer, whatever it is.
fn ask(process: &Process, path: &str, content_type: &str, body: &[u8]) -> (u16, Value) {
    let request = ureq::post(process.url(path)).header("content-type", content_type);
    let request = request.config().http_status_as_error(false).build();
    let mut answer = request.send(body).expect("an answer");
    let text = answer.body_mut().read_to_string().expect("a text");
    (answer.status().as_u16(), serde_json::from_str(&text).expect("JSON"))
}

/// What is wrong with an answer that should refuse.
fn fault(status: u16, answer: &Value) -> Option<String> {
    let error = &answer["error"];
    let names_a_field = error["details"]["path"].as_str().is_some_and(|path| !path.is_empty());
    // Where even the format is not known, that is what is said.
    let is_named = names_a_field || error["code"] == "unknown_format";
    let says = error["message"].as_str().is_some_and(|message| (10..2000).contains(&message.len()));
    let refused = (400..500).contains(&status) && is_named && says;
    (!refused).then(|| format!("{status} {answer}"))
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("it is there");
    let mut names: Vec<_> =
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn the_check_of_answers_notices_what_is_not_a_refusal() {
    let answer =
        |path: &str| json!({ "error": { "code": "malformed", "message": "long enough", "details": { "path": path } } });
    assert_eq!(fault(400, &answer("sizes")), None);
    assert!(fault(500, &answer("sizes")).is_some() && fault(400, &answer("")).is_some());
    assert!(fault(201, &json!({ "id": "v_1" })).is_some());
}

#[test]
fn hostile_files_are_refused_with_a_field_and_leave_nothing() {
    let data = tempfile::tempdir().expect("a directory");
    let folder = data.path().to_str().expect("temporary paths are UTF-8");
    let process = Process::start(&["--data-dir", folder]);
    let volume = json!({ "source": { "procedural": { "kind": "gyroid", "dims": [16, 16, 16] } } });
    process.post("/v1/volumes", &volume);
    let state = || (process.get_json("/v1/volumes"), process.get_json("/v1/server")["memory"].clone());
    let before = state();
    let resident = process.resident_bytes();
    let files = hostile();
    assert!(files.len() > 70, "{}", files.len());
    let mut faults = Vec::new();
    for (name, bytes) in &files {
        fs::write(data.path().join(name), bytes).expect("writable");
        let format = name.split('.').nth(1).unwrap_or_default();
        let path = json!({ "source": { "path": name } }).to_string();
        let answers = [
            ask(&process, &format!("/v1/volumes?format={format}"), "application/octet-stream", bytes),
            ask(&process, "/v1/volumes", "application/octet-stream", bytes),
            ask(&process, "/v1/volumes?dry_run=true", "application/octet-stream", bytes),
            ask(&process, "/v1/volumes", "application/json", path.as_bytes()),
        ];
        let found = answers.iter().filter_map(|(status, answer)| fault(*status, answer));
        faults.extend(found.map(|fault| format!("{name}: {fault}")));
        // Of a dry run by path only the header is looked at.
        let (status, answer) = ask(&process, "/v1/volumes?dry_run=true", "application/json", path.as_bytes());
        assert!(status == 200 || fault(status, &answer).is_none(), "{name}: {status} {answer}");
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert_eq!(state(), before);
    let mut expected: Vec<_> = files.iter().map(|(name, _)| name.clone()).collect();
    expected.sort();
    assert_eq!(names(data.path()), expected, "nothing is written beside them");
    // What allocators keep is some tens of MiB, whatever was claimed.
    let grown = process.resident_bytes().saturating_sub(resident);
    assert!(grown < 400 << 20, "{grown} bytes more than before");
    process.stop_clean();
}
