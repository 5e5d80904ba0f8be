//! Loads that are watched: how far they are, and that they end when they are called off.

use std::sync::Arc;

use spao_server::volume::format::{load_watched, read_watched};
use spao_server::volume::{
    Choice, Limits, LoadStage, LoadWatch, ProceduralKind, ProceduralSpec, VolumeError, VolumeId,
};

use super::makers::{MAKERS, Made};
use super::procedural::KINDS;
use crate::support::renderer;

fn called_off() -> LoadWatch {
    let watch = LoadWatch::default();
    watch.cancel();
    watch
}

fn spec(kind: ProceduralKind) -> ProceduralSpec {
    ProceduralSpec { kind, dims: [9, 8, 7], seed: 0, spacing: None }
}

#[test]
fn progress_within_a_stage_never_falls_and_never_passes_one() {
    let watch = LoadWatch::new(LoadStage::Reading);
    assert_eq!((watch.progress().stage, watch.progress().fraction), (LoadStage::Reading, 0.0));
    watch.advance(5);
    assert_eq!(watch.progress().fraction, 0.0, "nobody has said how much there is");
    watch.begin(LoadStage::Reading, 10);
    watch.advance(5);
    assert_eq!(watch.progress().fraction, 0.5);
    watch.expect(90);
    assert_eq!(watch.progress().fraction, 0.5, "there is more than was known");
    watch.advance(70);
    assert_eq!(watch.progress().fraction, 0.75);
    watch.advance(1000);
    assert_eq!(watch.progress().fraction, 1.0);
    watch.report(LoadStage::Uploading, 0.25);
    assert_eq!((watch.progress().stage, watch.progress().fraction), (LoadStage::Uploading, 0.25));
    watch.report(LoadStage::Uploading, 0.1);
    assert_eq!(watch.progress().fraction, 0.25);
}

#[test]
fn every_format_tells_how_far_it_is_and_ends_when_it_is_called_off() {
    let made = Made::new([40, 30, 8]);
    for maker in &MAKERS {
        let bytes = (maker.make)(&made);
        let read =
            |watch: &LoadWatch| read_watched(&bytes, maker.format, None, &Choice::default(), &Limits::default(), watch);
        let watch = LoadWatch::default();
        read(&watch).expect("nobody calls it off");
        let progress = watch.progress();
        assert!(
            progress.stage == LoadStage::Reading && progress.fraction > 0.9,
            "{}: {progress:?}",
            maker.format.name()
        );
        let answer = read(&called_off());
        assert!(matches!(answer, Err(VolumeError::Cancelled)), "{}: {answer:?}", maker.format.name());
    }
}

#[test]
fn data_beside_a_header_and_folders_are_watched_too() {
    let folder = tempfile::tempdir().expect("a directory");
    let header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 40 30 20\nencoding: raw\ndata file: voxels.raw\n";
    let meta = "NDims = 3\nDimSize = 40 30 20\nElementType = MET_UCHAR\nElementDataFile = voxels.raw\n";
    std::fs::write(folder.path().join("a.nhdr"), header).expect("writable");
    std::fs::write(folder.path().join("a.mhd"), meta).expect("writable");
    std::fs::write(folder.path().join("voxels.raw"), vec![7; 24000]).expect("writable");
    std::fs::create_dir(folder.path().join("series")).expect("it is new");
    let dicom = MAKERS.iter().find(|maker| maker.format.name() == "dicom").expect("it is among them");
    std::fs::write(folder.path().join("series/a.dcm"), (dicom.make)(&Made::new([40, 30, 20]))).expect("writable");
    for path in ["a.nhdr", "a.mhd", "series"] {
        let load =
            |watch: &LoadWatch| load_watched(path, folder.path(), None, &Choice::default(), &Limits::default(), watch);
        let watch = LoadWatch::default();
        load(&watch).unwrap_or_else(|error| panic!("{path}: {error}"));
        assert!(watch.progress().fraction > 0.9, "{path}: {:?}", watch.progress());
        assert!(matches!(load(&called_off()), Err(VolumeError::Cancelled)), "{path}");
    }
}

#[test]
fn procedural_volumes_and_what_is_derived_of_them_end_when_they_are_called_off() {
    for kind in KINDS {
        let watch = LoadWatch::default();
        let volume = spec(kind).generate_watched(&Limits::default(), &watch).expect("nobody calls it off");
        assert_eq!((watch.progress().stage, watch.progress().fraction), (LoadStage::Reading, 1.0), "{kind:?}");
        assert_eq!(volume.voxels, spec(kind).generate(&Limits::default()).expect("valid").voxels);
        let answer = spec(kind).generate_watched(&Limits::default(), &called_off());
        assert!(matches!(answer, Err(VolumeError::Cancelled)), "{kind:?}");
        let derived = volume.derive(16, &watch).expect("nobody calls it off");
        assert_eq!((watch.progress().stage, watch.progress().fraction), (LoadStage::Preparing, 1.0), "{kind:?}");
        assert_eq!(derived.sha256, volume.sha256_hex());
        assert_eq!(derived.histogram, volume.histogram(16).expect("16 bins"));
        assert!(matches!(volume.derive(16, &called_off()), Err(VolumeError::Cancelled)), "{kind:?}");
        assert!(matches!(volume.derive(0, &watch), Err(VolumeError::Malformed { .. })));
    }
}

#[test]
fn an_upload_that_is_called_off_leaves_nothing_on_the_gpu() {
    let volume = Arc::new(spec(ProceduralKind::Boxes).generate(&Limits::default()).expect("valid"));
    let (id, renderer) = (VolumeId("v_called_off".into()), renderer());
    let upload =
        |watch: Arc<LoadWatch>| pollster::block_on(renderer.add_watched_volume(id.clone(), volume.clone(), watch));
    let answer = upload(Arc::new(called_off()));
    assert!(matches!(answer, Err(spao_server::renderer::RenderError::Cancelled)), "{answer:?}");
    assert_eq!(renderer.gpu_bytes(&id), None);
    let watch = Arc::new(LoadWatch::default());
    upload(watch.clone()).expect("nobody calls it off");
    assert_eq!(watch.progress().stage, LoadStage::Uploading);
    assert!(renderer.gpu_bytes(&id).is_some());
    pollster::block_on(renderer.remove_volume(id)).expect("it is there");
}
