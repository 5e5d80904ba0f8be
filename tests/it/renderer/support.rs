//! Volumes, scenes, and the comparison of pictures with their twin.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use glam::DVec3;
use rayon::prelude::*;
use serde_json::{Value, json};
use spao_server::gpu::GpuOptions;
use spao_server::reference::{Exposure, RaycastInput, Raycaster, ValueField};
use spao_server::renderer::{AoPolicy, FrameRequest, RenderError, Renderer};
use spao_server::scene::{Scene, SceneDocument};
use spao_server::session::volume_facts;
use spao_server::volume::{Grid, Limits, ProceduralKind, ProceduralSpec, Volume, VolumeId, Voxels, format};

/// Pixels along both sides of most pictures.
pub(super) const SIZE: u32 = 64;

/// The CT head: 128 x 128 x 105.
pub(super) fn ct_head() -> Arc<Volume> {
    static HEAD: OnceLock<Arc<Volume>> = OnceLock::new();
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let load = || format::load_path("visible-human-head-128.nrrd", &directory, None, &Limits::default());
    HEAD.get_or_init(|| Arc::new(load().expect("the fixture loads"))).clone()
}

pub(super) fn procedural(kind: ProceduralKind, dims: [u32; 3]) -> Volume {
    ProceduralSpec { kind, dims, seed: 5, spacing: None }.generate(&Limits::default()).expect("the dims are small")
}

/// 8 bits, only three values beside 0, hard edges, and no two axes alike.
pub(super) fn boxes() -> Volume {
    procedural(ProceduralKind::Boxes, [37, 29, 23])
}

/// 8 bits and smooth.
pub(super) fn gyroid() -> Volume {
    procedural(ProceduralKind::Gyroid, [26, 31, 28])
}

/// 16-bit values by formula.
pub(super) fn volume_of(dims: [u32; 3], value: impl Fn([u32; 3]) -> u16) -> Volume {
    let [nx, ny, nz] = dims;
    let voxels = (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k]))).map(value).collect();
    Volume::new(Grid::axis_aligned(dims, DVec3::ONE), Voxels::U16(voxels)).expect("a valid volume")
}

/// The volume in another place: unequal spacing, and axes neither the world's nor at right angles.
pub(super) fn oblique(mut volume: Volume) -> Volume {
    volume.grid.spacing = DVec3::new(1.0, 1.3, 1.9);
    volume.grid.origin = DVec3::new(30.0, -20.0, 5.0);
    volume.grid.direction = [
        DVec3::new(0.9, 0.3, -0.1).normalize(),
        DVec3::new(-0.4, 1.0, 0.2).normalize(),
        DVec3::new(0.1, 0.2, 1.0).normalize(),
    ];
    volume.grid.check().expect("a valid grid");
    volume
}

/// A renderer with one volume on it.
pub(super) struct Studio {
    pub(super) renderer: Renderer,
    pub(super) volume: Arc<Volume>,
    pub(super) id: VolumeId,
}

impl Studio {
    pub(super) fn new(volume: impl Into<Arc<Volume>>) -> Self {
        Self::with_options(volume, &GpuOptions::default())
    }

    pub(super) fn with_options(volume: impl Into<Arc<Volume>>, options: &GpuOptions) -> Self {
        // A missing adapter fails the test: a skipped test proves nothing.
        let mut renderer = Renderer::new(options).expect("tests need an adapter; a software one will do");
        let (volume, id) = (volume.into(), VolumeId("v_1".into()));
        renderer.add_volume(id.clone(), volume.clone()).expect("the volume fits");
        Self { renderer, volume, id }
    }

    /// A scene from a document; what it does not say is as clients get it.
    pub(super) fn scene(&self, document: &Value) -> Scene {
        scene_of(&self.id, &self.volume, document)
    }

    /// sRGB-encoded with straight alpha, rows from the top.
    pub(super) fn picture(&mut self, scene: &Scene, [width, height]: [u32; 2]) -> Picture {
        self.try_picture(scene, [width, height]).expect("the picture is drawn")
    }

    pub(super) fn try_picture(&mut self, scene: &Scene, [width, height]: [u32; 2]) -> Result<Picture, RenderError> {
        let request = FrameRequest { scene: Arc::new(scene.clone()), width, height, ao_policy: AoPolicy::Exact };
        let frame = self.renderer.render(&request)?;
        assert_eq!([frame.width, frame.height, 4 * width * height], [width, height, frame.rgba.len() as u32]);
        Ok(Picture {
            size: [width, height],
            pixels: frame.rgba.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect(),
        })
    }

    /// A at voxel centres as the GPU has it, `None` where ambient occlusion is off.
    pub(super) fn accessibility(&mut self, scene: &Scene) -> Vec<f64> {
        let computed = self.renderer.accessibility(Arc::new(scene.clone())).expect("accessibility is computed");
        computed.values.into_iter().map(f64::from).collect()
    }
}

pub(super) fn scene_of(id: &VolumeId, volume: &Volume, document: &Value) -> Scene {
    let mut json = json!({"volume": id.0});
    json_patch::merge(&mut json, document);
    let histogram = volume.histogram(256).expect("256 bins are allowed");
    let facts = volume_facts(id, volume, &histogram);
    SceneDocument::from_json(&json).expect("a valid document").complete(&facts).expect("a valid scene")
}

/// A picture of the GPU.
#[derive(Clone, PartialEq)]
pub(super) struct Picture {
    pub(super) size: [u32; 2],
    pub(super) pixels: Vec<[u8; 4]>,
}

impl Picture {
    pub(super) fn at(&self, x: u32, y: u32) -> [u8; 4] {
        self.pixels[(y * self.size[0] + x) as usize]
    }
}

/// Something that is done to a scene, and its name.
pub(super) type Change<'a> = (&'a str, &'a dyn Fn(&mut Scene));

/// The f64 twin of a renderer: the values that its codes stand for.
pub(super) struct Twin<'a> {
    volume: &'a Volume,
    values: ValueField,
}

impl<'a> Twin<'a> {
    pub(super) fn new(volume: &'a Volume) -> Self {
        let codes: Vec<u16> =
            (0..volume.voxels.len()).map(|i| volume.code_map.code_from_value(volume.voxels.value(i))).collect();
        Self { volume, values: ValueField::from_codes(volume.grid.dims, &codes, &volume.code_map) }
    }

    /// Straight-alpha colours of some pixels, 0 to 1.
    pub(super) fn pixels(
        &self,
        scene: &Scene,
        light: &Light<'_>,
        [width, height]: [u32; 2],
        pixels: &[[u32; 2]],
    ) -> Vec<[f64; 4]> {
        let caster = Raycaster::new(RaycastInput {
            grid: &self.volume.grid,
            values: &self.values,
            code_map: &self.volume.code_map,
            scene,
            accessibility: light.accessibility,
            exposure: light.exposure,
            width,
            height,
        });
        pixels.par_iter().map(|&[x, y]| caster.pixel(x, y)).collect()
    }
}

/// Accessibility and exposure of a twin's picture.
pub(super) struct Light<'a> {
    pub(super) accessibility: Option<&'a [f64]>,
    pub(super) exposure: Exposure,
}

/// Ambient occlusion off.
pub(super) const UNOCCLUDED: Light<'static> = Light { accessibility: None, exposure: Exposure::NONE };

/// How far pixels are apart in their worst channel, in steps of an 8-bit display. Colours are compared as they
/// count, multiplied by alpha.
#[derive(Clone, Debug)]
pub(super) struct Difference {
    pub(super) mean: f64,
    /// 99 of 100 pixels are at most this far apart.
    pub(super) percentile_99: f64,
    pub(super) worst: f64,
}

impl Difference {
    pub(super) fn between(a: impl IntoIterator<Item = [f64; 4]>, b: impl IntoIterator<Item = [f64; 4]>) -> Self {
        let premultiplied = |[r, g, b, a]: [f64; 4]| [r * a, g * a, b * a, a];
        let mut a = a.into_iter().map(premultiplied);
        let mut b = b.into_iter().map(premultiplied);
        let mut steps = Vec::new();
        loop {
            match (a.next(), b.next()) {
                (Some(a), Some(b)) => {
                    let worst = (0..4).map(|c| 255.0 * (a[c] - b[c]).abs()).fold(0.0, f64::max);
                    assert!(a.iter().chain(&b).all(|c| c.is_finite()), "{a:?} {b:?}");
                    steps.push(worst);
                }
                (None, None) => break,
                _ => panic!("not as many pixels"),
            }
        }
        steps.sort_by(f64::total_cmp);
        let last = steps.len() - 1;
        Self {
            mean: steps.iter().sum::<f64>() / steps.len() as f64,
            percentile_99: steps[(0.99 * last as f64).round() as usize],
            worst: steps[last],
        }
    }

    pub(super) fn between_pictures(a: &Picture, b: &Picture) -> Self {
        assert_eq!(a.size, b.size);
        Self::between(a.pixels.iter().copied().map(unit), b.pixels.iter().copied().map(unit))
    }

    pub(super) fn is_within(&self, mean: f64, percentile_99: f64, worst: f64) -> bool {
        self.mean <= mean && self.percentile_99 <= percentile_99 && self.worst <= worst
    }
}

/// 0 to 255 to 0 to 1.
pub(super) fn unit(pixel: [u8; 4]) -> [f64; 4] {
    pixel.map(|c| f64::from(c) / 255.0)
}

/// Every pixel of a picture.
pub(super) fn all_pixels([width, height]: [u32; 2]) -> Vec<[u32; 2]> {
    (0..height).flat_map(|y| (0..width).map(move |x| [x, y])).collect()
}

/// The same pixels on every run, evenly at random.
pub(super) fn some_pixels([width, height]: [u32; 2], count: u64) -> Vec<[u32; 2]> {
    let pixel = |n: u64| {
        let mut z = n.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        [(z as u32) % width, ((z >> 32) as u32) % height]
    };
    (0..count).map(pixel).collect()
}
