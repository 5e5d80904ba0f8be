//! Volumes, scenes, and the comparison of accessibility volumes with their twin.

use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, OnceLock};

use glam::DVec3;
use rayon::prelude::*;
use spao_server::ao::{LevelLayout, WorkLists};
use spao_server::reference::{OpacityField, RaytracedAo, SpaoAo, ValueField};
use spao_server::render_thread::RenderHandle;
use spao_server::scene::{
    AmbientOcclusion, AoMethod, AoStructure, Camera, ControlPoint, Lighting, Projection, Rendering, Rgb, Scene,
    TransferFunction, Viewport,
};
use spao_server::volume::{Grid, Limits, ProceduralKind, ProceduralSpec, Volume, VolumeId, Voxels, format};

use crate::support::renderer;

/// One step of an 8-bit display, in which errors are told.
pub(super) const DISPLAY_STEP: f64 = 1.0 / 255.0;

/// The CT head: 128 x 128 x 105.
pub(super) fn ct_head() -> Arc<Volume> {
    static HEAD: OnceLock<Arc<Volume>> = OnceLock::new();
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let load = || format::load_path("visible-human-head-128.nrrd", &directory, None, &Limits::default());
    HEAD.get_or_init(|| Arc::new(load().expect("the fixture loads"))).clone()
}

/// One box along x, two along y, three along z; odd sizes.
pub(super) fn boxes() -> Arc<Volume> {
    procedural(ProceduralKind::Boxes, [61, 47, 33])
}

pub(super) fn procedural(kind: ProceduralKind, dims: [u32; 3]) -> Arc<Volume> {
    let spec = ProceduralSpec { kind, dims, seed: 5, spacing: None };
    Arc::new(spec.generate(&Limits::default()).expect("the dims are small"))
}

/// A volume of 16-bit values with the given spacing.
pub(super) fn volume_of(dims: [u32; 3], spacing: DVec3, value: impl Fn([u32; 3]) -> u16) -> Arc<Volume> {
    let [nx, ny, nz] = dims;
    let voxels = (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k]))).map(value).collect();
    Arc::new(Volume::new(Grid::axis_aligned(dims, spacing), Voxels::U16(voxels)).expect("a valid volume"))
}

/// Sparse values without any symmetry, 0 or 100 to 1000. The highest, 1009, is such that no gradient is exactly as long
/// as the shortest that gives rays a hemisphere: rounding would decide.
pub(super) fn random_volume(dims: [u32; 3], spacing: DVec3) -> Arc<Volume> {
    volume_of(dims, spacing, |voxel| match voxel {
        [0, 0, 0] => 1009,
        [i, j, k] => {
            let random = hash(u64::from((k * 4096 + j) * 4096 + i));
            if random % 10 < 3 { 100 + (random >> 8) as u16 % 901 } else { 0 }
        }
    })
}

/// The same number for the same seed, with all bits as good as random.
pub(super) fn hash(seed: u64) -> u64 {
    let mut z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// White, with these opacities at these values.
pub(super) fn opacities(points: &[(f64, f64)]) -> TransferFunction {
    let point = |&(value, opacity)| ControlPoint { value, color: Rgb::WHITE, opacity };
    TransferFunction { points: points.iter().map(point).collect(), opacity_unit_distance: None }
}

/// Transfer functions of the CT head, in Hounsfield units.
pub(super) fn head_transfer_functions() -> [(&'static str, TransferFunction); 3] {
    [
        ("opaque bone", opacities(&[(250.0, 0.0), (350.0, 1.0)])),
        ("soft skin and bone", opacities(&[(-400.0, 0.0), (-200.0, 0.1), (-50.0, 0.02), (200.0, 0.05), (500.0, 0.8)])),
        ("fog", opacities(&[(-900.0, 0.0), (-300.0, 0.02), (1000.0, 0.05)])),
    ]
}

/// SPAO over N-buffers.
pub(super) fn n_buffer(levels: u32, normal_factor: f64) -> AmbientOcclusion {
    AmbientOcclusion { levels, normal_factor, ..AmbientOcclusion::default() }
}

/// SPAO over mip levels.
pub(super) fn mipmap(levels: u32, normal_factor: f64) -> AmbientOcclusion {
    AmbientOcclusion { structure: AoStructure::Mipmap, ..n_buffer(levels, normal_factor) }
}

/// SPAO over `mip_levels` mip levels and N-buffers on the last of them.
pub(super) fn hybrid(levels: u32, mip_levels: u32, normal_factor: f64) -> AmbientOcclusion {
    AmbientOcclusion { structure: AoStructure::Hybrid, mip_levels, ..n_buffer(levels, normal_factor) }
}

/// The reference with so many rays.
pub(super) fn raytraced(levels: u32, normal_factor: f64, rays: u32) -> AmbientOcclusion {
    AmbientOcclusion { method: AoMethod::Raytraced, rays, ..n_buffer(levels, normal_factor) }
}

/// The work of a build from nothing in which every tile and every brick takes part.
pub(super) fn all_work(dims: [u32; 3], layouts: &[LevelLayout]) -> WorkLists {
    let all = |places: [u32; 3]| (0..places.iter().product()).collect::<Vec<u32>>();
    let bricks = all(dims.map(|n| n.div_ceil(8)));
    WorkLists { levels: layouts.iter().map(|l| all(l.tiles())).collect(), bricks: bricks.clone(), wanted: bricks }
}

/// A scene that looks at the whole volume.
pub(super) fn scene_of(
    id: &VolumeId,
    volume: &Volume,
    transfer_function: &TransferFunction,
    settings: AmbientOcclusion,
) -> Scene {
    let center = volume.grid.center();
    let size = volume.grid.dims_vec() * volume.grid.spacing;
    Scene {
        volume: id.clone(),
        transfer_function: transfer_function.clone(),
        camera: Camera {
            eye: center + DVec3::new(0.3, -2.0, 0.4) * size.max_element(),
            target: center,
            up: DVec3::Z,
            projection: Projection::Perspective { fov_y_deg: 40.0 },
        },
        ambient_occlusion: settings,
        lighting: Lighting::default(),
        rendering: Rendering::default(),
        viewport: Viewport::default(),
    }
}

/// A volume on a render thread, taken off it when dropped.
pub(super) struct Subject {
    pub(super) id: VolumeId,
    pub(super) volume: Arc<Volume>,
    pub(super) renderer: RenderHandle,
}

impl Subject {
    /// On everybody's renderer.
    pub(super) fn new(volume: Arc<Volume>) -> Self {
        Self::on(renderer(), volume)
    }

    pub(super) fn on(renderer: RenderHandle, volume: Arc<Volume>) -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let id = VolumeId(format!("ao-test-{}", NEXT.fetch_add(1, Ordering::Relaxed)));
        pollster::block_on(renderer.add_volume(id.clone(), volume.clone())).expect("the volume fits");
        Self { id, volume, renderer }
    }

    pub(super) fn scene(&self, transfer_function: &TransferFunction, settings: AmbientOcclusion) -> Scene {
        scene_of(&self.id, &self.volume, transfer_function, settings)
    }

    /// A at every voxel centre, by the GPU.
    pub(super) fn accessibility(&self, transfer_function: &TransferFunction, settings: AmbientOcclusion) -> Vec<f32> {
        let scene = Arc::new(self.scene(transfer_function, settings));
        let result = pollster::block_on(self.renderer.accessibility(scene)).expect("the build succeeds");
        assert_eq!((result.dims, result.first, result.step), (self.volume.grid.dims, [0.5; 3], [1.0; 3]));
        assert!(result.values.iter().all(|a| (0.0..=1.0).contains(a)), "accessibility is in [0, 1]");
        result.values
    }
}

impl Drop for Subject {
    fn drop(&mut self) {
        let _ = pollster::block_on(self.renderer.remove_volume(self.id.clone()));
    }
}

/// What the twin reads, from the values in the file's units and not from codes.
pub(super) struct Fields {
    pub(super) opacity: OpacityField,
    pub(super) values: ValueField,
}

impl Fields {
    pub(super) fn new(volume: &Volume, transfer_function: &TransferFunction) -> Self {
        let dims = volume.grid.dims;
        let values: Vec<f64> = (0..volume.voxels.len()).map(|i| volume.voxels.value(i)).collect();
        let spacing = volume.grid.smallest_spacing();
        Self {
            opacity: OpacityField::from_values(dims, &values, transfer_function, spacing),
            values: ValueField::from_values(dims, &values, &volume.code_map),
        }
    }

    /// The twin of the settings, at voxels by their number.
    pub(super) fn twin(&self, settings: &AmbientOcclusion, voxels: &[usize]) -> Vec<f64> {
        self.twin_off_centre(settings, voxels, DVec3::ZERO)
    }

    /// The same at a distance from the voxels' centres.
    pub(super) fn twin_off_centre(&self, settings: &AmbientOcclusion, voxels: &[usize], offset: DVec3) -> Vec<f64> {
        let [nx, ny, _] = self.opacity.dims.map(|n| n as usize);
        let at = |&i: &usize| DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / nx / ny) as f64) + 0.5 + offset;
        match settings.method {
            AoMethod::Off => vec![1.0; voxels.len()],
            AoMethod::Spao => {
                let twin = SpaoAo::new(&self.opacity, &self.values, settings);
                voxels.par_iter().map(|i| twin.accessibility(at(i))).collect()
            }
            AoMethod::Raytraced => {
                let twin = RaytracedAo::new(&self.opacity, &self.values, settings);
                voxels.par_iter().map(|i| twin.accessibility(at(i))).collect()
            }
        }
    }
}

/// Numbers of at most `count` voxels of a volume: all of them, or random ones.
pub(super) fn some_voxels(volume: &Volume, count: usize) -> Vec<usize> {
    let all = volume.voxels.len();
    if all <= count {
        return (0..all).collect();
    }
    (0..count as u64).map(|n| (hash(n) % all as u64) as usize).collect()
}

/// How far accessibility is from the twin's.
#[derive(Clone, Copy, Debug)]
pub(super) struct Errors {
    /// Largest |difference|.
    pub(super) largest: f64,
    /// Root of the mean squared difference.
    pub(super) rms: f64,
}

impl Errors {
    pub(super) fn between(gpu: &[f32], voxels: &[usize], twin: &[f64]) -> Self {
        assert_eq!(voxels.len(), twin.len());
        let differences: Vec<f64> = voxels.iter().zip(twin).map(|(&i, &a)| f64::from(gpu[i]) - a).collect();
        assert!(differences.iter().all(|d| d.is_finite()));
        let largest = differences.iter().fold(0.0, |worst: f64, d| worst.max(d.abs()));
        let mean_square = differences.iter().map(|d| d * d).sum::<f64>() / differences.len() as f64;
        Self { largest, rms: mean_square.sqrt() }
    }

    /// Whether both are as small as they should be.
    pub(super) fn are_within(self, largest: f64, rms: f64) -> bool {
        self.largest <= largest && self.rms <= rms
    }
}

/// Runs a build on the GPU and compares it with its twin at up to `count` voxels.
pub(super) fn errors(
    subject: &Subject,
    transfer_function: &TransferFunction,
    settings: AmbientOcclusion,
    count: usize,
) -> Errors {
    let gpu = subject.accessibility(transfer_function, settings);
    let voxels = some_voxels(&subject.volume, count);
    let twin = Fields::new(&subject.volume, transfer_function).twin(&settings, &voxels);
    Errors::between(&gpu, &voxels, &twin)
}

#[test]
fn the_comparison_measures_the_largest_and_the_mean_difference() {
    let errors = Errors::between(&[0.5, 0.0, 0.75, 0.25], &[0, 2, 3], &[0.5, 0.5, 0.25]);
    assert_eq!((errors.largest, errors.rms), (0.25, (0.0625_f64 / 3.0).sqrt()));
    assert!(errors.are_within(0.25, 0.15));
    assert!(!errors.are_within(0.24, 0.15) && !errors.are_within(0.25, 0.14));
}
