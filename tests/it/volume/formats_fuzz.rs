//! Files with faults that nobody would think of: refused or read, never a panic, and never more than the limits.

use spao_server::volume::{Format, Limits, format};

use super::dicom::tar;
use super::independent::{bytes_of, directory, expected};
use super::makers::zip_of;

/// Mutations of every file.
const ROUNDS: u64 = 150;

/// SplitMix64: the same faults every time.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

/// What headers do not expect, as text and as numbers of two to eight bytes.
const HOSTILE: [&[u8]; 22] = [
    b"-1",
    b"0",
    b"nan",
    b"inf",
    b"-1e308",
    b"99999999999999999999",
    b"4294967296",
    b"= ",
    b"\n",
    b"<",
    b">",
    b"\"",
    b"(((((",
    b"../x",
    b"LIST",
    &[0x00; 8],
    &[0xff; 8],
    &[0x7f, 0xff],
    &[0xff, 0x7f],
    &[0x00, 0x00, 0xc0, 0x7f],
    &[0x7f, 0xc0, 0x00, 0x00],
    &[0x00, 0x00, 0x80, 0xff],
];

/// The file with one to three faults; most of them where headers are.
fn mutated(file: &[u8], random: &mut Random) -> Vec<u8> {
    let mut file = file.to_vec();
    for _ in 0..=random.below(3) {
        let reach = if random.below(4) == 0 { file.len() } else { file.len().min(600) };
        let at = random.below(reach);
        let hostile = HOSTILE[random.below(HOSTILE.len())];
        let end = (at + hostile.len()).min(file.len());
        match random.below(6) {
            0 => file[at..].iter_mut().take(1).for_each(|byte| *byte ^= 1 << random.below(8)),
            1 => drop(file.splice(at..end, hostile.iter().copied())),
            2 => drop(file.splice(at..at, hostile.iter().copied())),
            3 => file.truncate(at),
            4 => drop(file.drain(at..end)),
            _ => {
                let piece = file[at..(at + 1 + random.below(40)).min(file.len())].to_vec();
                let to = random.below(file.len() + 1);
                drop(file.splice(to..to, piece));
            }
        }
    }
    file
}

/// Whether the file is read; anything but a volume within the limits or an error that says something is a fault.
fn is_read(format: Format, file: &[u8], limits: &Limits) -> bool {
    match format::read_bytes(file, format, None, limits) {
        Ok(volume) => {
            assert_eq!(volume.grid.voxel_count(), volume.voxels.len() as u64);
            assert!(volume.grid.check().is_ok());
            assert!(volume.host_bytes() <= limits.max_bytes);
            true
        }
        Err(error) => {
            assert!(!error.field().is_empty() && error.to_string().len() < 600, "{error}");
            false
        }
    }
}

#[test]
fn files_with_faults_are_read_or_refused() {
    let limits = Limits { max_axis: 64, max_voxels: 4096, max_bytes: 32768 };
    let mut random = Random(1);
    let (mut read, mut refused) = (0, 0);
    let folder = tempfile::tempdir().expect("a directory");
    for expected in expected() {
        let file = bytes_of(&expected.file);
        let format = Format::detect(None, None, &file).expect("a file of the fixtures");
        for round in 0..ROUNDS {
            let bad = mutated(&file, &mut random);
            if round % 10 == 0 {
                std::fs::write(folder.path().join(&expected.file), &bad).expect("written");
                if let Err(error) = format::peek_path(&expected.file, folder.path(), None) {
                    assert!(!error.field().is_empty() && error.to_string().len() < 600, "{error}");
                }
            }
            match is_read(format, &bad, &limits) {
                true => read += 1,
                false => refused += 1,
            }
            let _ = Format::detect(None, None, &bad);
        }
    }
    // Neither are all faults harmless nor are all files lost.
    assert!(read > 1000 && refused > 5000, "{read} read, {refused} refused");
}

#[test]
fn archives_of_a_header_and_its_data_with_faults_are_read_or_refused() {
    let limits = Limits { max_axis: 64, max_voxels: 4096, max_bytes: 32768 };
    let mut random = Random(3);
    let (mut read, mut refused) = (0, 0);
    for [header, data] in [["meta_beside.mhd", "meta_beside.raw"], ["meta_skip.mhd", "meta_skip.raw"]] {
        let files = [(header, &bytes_of(header)[..]), (data, &bytes_of(data)[..])];
        for archive in [tar(&files), zip_of(&files)] {
            let format = Format::detect(None, None, &archive).expect("valid");
            assert!(format == Format::MetaImage && is_read(format, &archive, &limits), "{header}");
            for _ in 0..4 * ROUNDS {
                match is_read(format, &mutated(&archive, &mut random), &limits) {
                    true => read += 1,
                    false => refused += 1,
                }
            }
        }
    }
    assert!(read > 100 && refused > 1000, "{read} read, {refused} refused");
}

#[test]
fn a_file_cut_off_anywhere_is_refused() {
    let limits = Limits::default();
    for expected in expected().iter().filter(|e| !e.file.ends_with(".mhd")) {
        let file = bytes_of(&expected.file);
        let format = Format::detect(None, None, &file).expect("a file of the fixtures");
        let find = |tag: &[u8]| file.windows(tag.len()).position(|window| window == tag);
        // Tags after the voxels, another array and a last line feed are not missed, and a number may be cut short.
        let needed = match expected.file.as_str() {
            name if name.ends_with(".vti") => {
                find(b"<AppendedData").or_else(|| Some(find(b"</DataArray>")? - 20)).expect("data") + 10
            }
            "meta_ascii.mha" => file.len() - 3,
            _ => file.len(),
        };
        for length in (0..needed).step_by(1 + needed / 60) {
            assert!(!is_read(format, &file[..length], &limits), "{length} bytes of {}", expected.file);
        }
        assert!(is_read(format, &file, &limits));
    }
}

#[test]
fn any_bytes_are_refused_by_every_reader() {
    let mut random = Random(2);
    let limits = Limits::default();
    for format in Format::all() {
        for _ in 0..200 {
            let length = random.below(1200);
            let bytes: Vec<u8> = (0..length).map(|_| random.next() as u8).collect();
            assert!(!is_read(format, &bytes, &limits), "{}", format.name());
        }
    }
}

#[test]
fn headers_with_data_elsewhere_survive_faults() {
    let root = tempfile::tempdir().expect("a directory");
    for file in ["meta_beside.raw", "meta_beside_compressed.zraw", "meta_skip.raw"] {
        std::fs::copy(directory().join(file), root.path().join(file)).expect("copied");
    }
    let mut random = Random(3);
    for file in ["meta_beside.mhd", "meta_beside_compressed.mhd", "meta_last.mhd"] {
        let header = bytes_of(file);
        for _ in 0..ROUNDS {
            std::fs::write(root.path().join("bad.mhd"), mutated(&header, &mut random)).expect("written");
            if let Err(error) = format::load_path("bad.mhd", root.path(), None, &Limits::default()) {
                assert!(!error.field().is_empty());
            }
        }
    }
}
