//! Ambient occlusion of resident volumes: what is cached, what is being computed, and from what it is updated.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::{Rc, Weak};

use super::resident::ResidentVolume;
use crate::ao::{Accessibility, AoBuild, AoCache, AoKey, AoSource, AoStages, AoWork, Pyramid, TileSet};
use crate::gpu::{Gpu, GpuError, GpuTexture};
use crate::scene::{AmbientOcclusion, AoMethod, Scene, TransferTable, opacity_table};
use crate::volume::{BRICK, VolumeId};

/// Pyramids that are kept, of different volumes or structures.
const MOST_PYRAMIDS: usize = 4;

/// Where accessibility is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coverage {
    /// In all bricks that a picture may look it up in.
    Visible,
    /// In all bricks.
    Everywhere,
}

/// What a picture or a download wants: the key of the result, and how to come by it.
#[derive(Clone, Debug)]
pub(super) struct Wish {
    pub(super) key: AoKey,
    pub(super) source: AoSource,
    settings: AmbientOcclusion,
    wanted: TileSet,
    /// Layer of bricks next to the camera.
    eye: f64,
}

/// Accessibility that can be used at once.
#[derive(Clone, Debug)]
pub(super) struct AtHand {
    pub(super) texture: Rc<GpuTexture>,
    pub(super) surface_reference: f64,
    pub(super) version: u64,
}

/// All of it.
#[derive(Debug, Default)]
pub(super) struct Occlusion {
    cache: AoCache,
    /// Builds under way, owned by the jobs that wait for them: a build that nobody wants ends at once.
    builds: HashMap<AoKey, Weak<RefCell<AoBuild>>>,
    /// Least recently used first.
    pyramids: Vec<KeptPyramid>,
    versions: u64,
}

/// Levels that are kept for the next edit.
#[derive(Debug)]
struct KeptPyramid {
    volume: VolumeId,
    structure: [u32; 2],
    pyramid: Rc<RefCell<Pyramid>>,
}

impl KeptPyramid {
    fn is_idle(&self) -> bool {
        Rc::strong_count(&self.pyramid) == 1
    }
}

impl Wish {
    /// What the scene's settings ask for. The method must not be `Off`.
    pub(super) fn new(resident: &ResidentVolume, scene: &Scene, coverage: Coverage) -> Self {
        let volume = &resident.volume;
        let settings = scene.ambient_occlusion;
        let opacities = opacity_table(&scene.transfer_function, &volume.code_map, volume.grid.smallest_spacing());
        let table = resident.transfer_table(scene);
        let contents = &resident.contents;
        let wanted = match (coverage, settings.method) {
            (Coverage::Visible, AoMethod::Spao) => TileSet::of(contents.dims, |brick| {
                let [low, high] = contents.wide_ranges[brick];
                table.any_visible(low, high)
            }),
            _ => TileSet::full(contents.dims),
        };
        let brick_distance = match settings.method {
            AoMethod::Raytraced => resident.occupancy(&table),
            AoMethod::Off | AoMethod::Spao => Vec::new(),
        };
        let eye = volume.grid.index_from_world().transform_point3(scene.camera.eye).z / f64::from(BRICK);
        let source = AoSource {
            values: resident.values.clone(),
            code_scale: resident.code_scale,
            max_code: volume.code_map.max_code,
            opacity_table: Rc::new(opacities),
            contents: contents.clone(),
            brick_distance: Rc::new(brick_distance),
        };
        let key = AoKey::new(&scene.volume, &source.opacity_table, &wanted, &settings);
        Self { key, source, settings, wanted, eye }
    }

    /// Levels that can be shared by results of different factors and opacities.
    fn structure(&self) -> [u32; 2] {
        match self.settings.method {
            AoMethod::Spao => [self.settings.levels, self.settings.halved_levels()],
            AoMethod::Off | AoMethod::Raytraced => [0, 0],
        }
    }

    /// Begins a build from a pyramid.
    pub(super) fn build(
        self,
        gpu: &Gpu,
        stages: &AoStages,
        pyramid: Rc<RefCell<Pyramid>>,
    ) -> Result<AoBuild, GpuError> {
        AoBuild::new(gpu, stages, pyramid, self.source, self.settings, self.wanted, self.eye)
    }

    /// Levels of nothing yet.
    pub(super) fn new_pyramid(&self, gpu: &Gpu) -> Result<Rc<RefCell<Pyramid>>, GpuError> {
        Pyramid::new(gpu, &self.source, &self.settings).map(|pyramid| Rc::new(RefCell::new(pyramid)))
    }
}

impl Occlusion {
    /// The finished result, if there is one.
    pub(super) fn finished(&mut self, key: &AoKey) -> Option<Rc<Accessibility>> {
        self.cache.get(key)
    }

    /// The build of this result that is under way.
    pub(super) fn under_way(&self, key: &AoKey) -> Option<Rc<RefCell<AoBuild>>> {
        let build = self.builds.get(key).and_then(Weak::upgrade);
        build.filter(|build| !build.borrow().has_failed())
    }

    /// The pyramid of the wish's volume and structure; `None` while another update of it is under way: to wait for that
    /// and to go on from there is less work than a build from nothing beside it. Rays need the first level alone, and
    /// may take minutes: nobody waits for them. A pyramid is not idle while it is held.
    pub(super) fn pyramid(&mut self, gpu: &Gpu, wish: &Wish) -> Result<Option<Rc<RefCell<Pyramid>>>, GpuError> {
        self.pyramids.retain(|kept| !kept.pyramid.borrow().is_broken());
        let (volume, structure) = (wish.key.volume().clone(), wish.structure());
        let fitting = |kept: &KeptPyramid| kept.volume == volume && kept.structure == structure;
        let traced = wish.settings.method == AoMethod::Raytraced;
        let found = self.pyramids.iter().position(|kept| fitting(kept) && (kept.is_idle() || !traced));
        if found.is_some_and(|at| !self.pyramids[at].is_idle()) {
            return Ok(None);
        }
        let kept = match found {
            Some(at) => self.pyramids.remove(at),
            None => KeptPyramid { volume, structure, pyramid: wish.new_pyramid(gpu)? },
        };
        let pyramid = kept.pyramid.clone();
        self.pyramids.push(kept);
        if self.pyramids.len() > MOST_PYRAMIDS {
            self.evict_pyramid();
        }
        Ok(Some(pyramid))
    }

    /// Begins a build from a pyramid.
    pub(super) fn build(
        &mut self,
        gpu: &Gpu,
        stages: &AoStages,
        wish: Wish,
        pyramid: Rc<RefCell<Pyramid>>,
    ) -> Result<Rc<RefCell<AoBuild>>, GpuError> {
        let key = wish.key.clone();
        let build = Rc::new(RefCell::new(wish.build(gpu, stages, pyramid)?));
        self.builds.retain(|_, b| b.strong_count() > 0);
        self.builds.insert(key, Rc::downgrade(&build));
        Ok(build)
    }

    /// Takes the result of a finished build; any job that waits for it may be the first to come.
    pub(super) fn finish(
        &mut self,
        gpu: &Gpu,
        key: &AoKey,
        build: &RefCell<AoBuild>,
        keep: bool,
    ) -> Result<Option<(Rc<Accessibility>, AoWork)>, GpuError> {
        let Some((accessibility, work)) = build.borrow_mut().finish(gpu, self.versions + 1)? else { return Ok(None) };
        self.versions = self.versions.max(accessibility.version);
        self.builds.remove(key);
        if keep {
            self.cache.insert(key.clone(), accessibility.clone());
        }
        Ok(Some((accessibility, work)))
    }

    /// What can be shown at once, and whether it is what is wished.
    pub(super) fn at_hand(&mut self, key: &AoKey) -> (Option<AtHand>, bool) {
        let whole = |a: Rc<Accessibility>| AtHand {
            texture: a.texture.clone(),
            surface_reference: a.surface_reference,
            version: a.version,
        };
        if let Some(exact) = self.cache.get(key) {
            return (Some(whole(exact)), true);
        }
        let under_way = self.builds.get(key).and_then(Weak::upgrade);
        if let Some((texture, surface_reference)) = under_way.and_then(|build| build.borrow().so_far()) {
            return (Some(AtHand { texture, surface_reference, version: self.versions }), false);
        }
        (self.cache.latest_of(key.volume()).map(whole), false)
    }

    /// Bytes that [`Self::evict_one`] could free, one call after the other.
    pub(super) fn evictable_bytes(&self) -> u64 {
        let idle = self.pyramids.iter().filter(|kept| kept.is_idle());
        self.cache.evictable_bytes() + idle.map(|kept| kept.pyramid.borrow().bytes()).sum::<u64>()
    }

    /// Drops something that can be computed again, of its kind what was not used for longest; false when there is
    /// nothing left. Pyramids are ten times as large as results, so they go first; the last pyramid, from which the
    /// next edit is computed, only after all results but two.
    pub(super) fn evict_one(&mut self) -> bool {
        let idle = self.pyramids.iter().filter(|kept| kept.is_idle()).count();
        (idle > 1 && self.evict_pyramid()) || self.cache.evict_one(2) || self.evict_pyramid() || self.cache.evict_one(0)
    }

    fn evict_pyramid(&mut self) -> bool {
        let idle = self.pyramids.iter().position(KeptPyramid::is_idle);
        idle.map(|at| self.pyramids.remove(at)).is_some()
    }

    /// Drops all that belongs to a volume; builds end with the jobs that hold them.
    pub(super) fn forget_volume(&mut self, volume: &VolumeId) {
        self.cache.forget_volume(volume);
        self.pyramids.retain(|kept| &kept.volume != volume);
        self.builds.retain(|key, build| key.volume() != volume && build.strong_count() > 0);
    }
}

impl ResidentVolume {
    /// The scene's transfer function for its ray steps.
    pub(super) fn transfer_table(&self, scene: &Scene) -> TransferTable {
        let grid = &self.volume.grid;
        let step = super::raycast::step_length(scene, grid);
        TransferTable::new(&scene.transfer_function, &self.volume.code_map, step, grid.smallest_spacing())
    }

    /// See [`super::brick_distance`].
    pub(super) fn occupancy(&self, table: &TransferTable) -> Vec<u8> {
        super::brick_distance(self.contents.dims, |brick| {
            let [low, high] = self.contents.ranges[brick];
            table.any_visible(low, high)
        })
    }
}
