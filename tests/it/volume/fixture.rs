//! The committed CT head.

use std::path::Path;

use glam::DVec3;
use spao_server::volume::{Format, Limits, VoxelType, Voxels, format};

use super::FIXTURE;

#[test]
fn the_ct_head_loads_with_its_geometry_and_range() {
    let path = Path::new(FIXTURE);
    let directory = path.parent().expect("a directory");
    let name = path.file_name().and_then(|n| n.to_str()).expect("a name");
    let volume = format::load_path(name, directory, None, &Limits::default()).expect("the fixture loads");
    assert_eq!(volume.grid.dims, [128, 128, 105]);
    assert_eq!(volume.grid.spacing, DVec3::splat(2.0));
    assert_eq!(volume.grid.origin, DVec3::new(128.5, 128.5, 1524.5));
    assert_eq!(volume.grid.direction, [DVec3::X, DVec3::Y, DVec3::Z]);
    assert_eq!(volume.host_bytes(), 128 * 128 * 105 * 2);
    let Voxels::I16(values) = &volume.voxels else { panic!("{}", volume.voxels.voxel_type()) };
    let range = [values.iter().min(), values.iter().max()].map(|v| f64::from(*v.expect("not empty")));
    assert_eq!(volume.code_map.value_range(), range);
    assert!(volume.code_map.lossless && volume.code_map.step == 1.0);
    assert!(range[0] <= -1000.0 && range[1] >= 1000.0, "Hounsfield units of air and bone: {range:?}");

    let peeked = format::peek_path(name, directory, None).expect("the header is read");
    assert_eq!((peeked.dims, peeked.voxel_type), ([128, 128, 105], VoxelType::I16));
    assert_eq!(peeked.spacing, Some([2.0; 3]));

    let bytes = std::fs::read(path).expect("the fixture is there");
    let uploaded = format::read_bytes(&bytes, Format::Nrrd, None, &Limits::default()).expect("the fixture loads");
    assert_eq!(uploaded.sha256_hex(), volume.sha256_hex());
}
