//! Finished accessibility volumes, by what they were computed from.

use std::rc::Rc;

use sha2::{Digest, Sha256};

use super::build::Accessibility;
use super::tiles::TileSet;
use crate::scene::{AmbientOcclusion, AoMethod, Radius};
use crate::volume::VolumeId;

/// Results kept besides the one in use, so that undo, presets and toggles come back at once.
const KEPT_RESULTS: usize = 8;

/// Everything that a result depends on, and nothing else: two scenes with equal keys share one result.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct AoKey {
    volume: VolumeId,
    /// Digest of the opacity table and of the bricks that have accessibility.
    contents: [u8; 32],
    method: AoMethod,
    /// Settings that the method reads; the others are zero.
    numbers: [u64; 6],
}

impl AoKey {
    /// The key of these settings. Call with a method other than `Off`.
    /// `wanted`: the bricks that have accessibility.
    pub fn new(volume: &VolumeId, opacity_table: &[u16], wanted: &TileSet, settings: &AmbientOcclusion) -> Self {
        let numbers = match settings.method {
            AoMethod::Off => [0; 6],
            AoMethod::Spao => [
                u64::from(settings.levels),
                u64::from(settings.halved_levels()),
                settings.normal_factor.to_bits(),
                0,
                0,
                0,
            ],
            AoMethod::Raytraced => {
                let (kind, reach) = match settings.radius {
                    Radius::SameAsLevels => (0, u64::from(settings.levels)),
                    Radius::Voxels(reach) => (1, reach.to_bits()),
                    Radius::Unlimited => (2, 0),
                };
                let hemisphere = u64::from(settings.normal_factor != 0.0);
                [0, 0, hemisphere, u64::from(settings.rays), kind, reach]
            }
        };
        let sha = Sha256::new_with_prefix(bytemuck::cast_slice::<u16, u8>(opacity_table)).chain_update(wanted.bytes());
        Self { volume: volume.clone(), contents: sha.finalize().into(), method: settings.method, numbers }
    }

    /// The volume that the result is of.
    pub fn volume(&self) -> &VolumeId {
        &self.volume
    }
}

/// The most recently used results, newest last.
#[derive(Debug, Default)]
pub struct AoCache {
    results: Vec<(AoKey, Rc<Accessibility>)>,
}

impl AoCache {
    /// The result for `key`, which counts as used now.
    pub fn get(&mut self, key: &AoKey) -> Option<Rc<Accessibility>> {
        let at = self.results.iter().position(|r| &r.0 == key)?;
        let result = self.results.remove(at);
        let accessibility = result.1.clone();
        self.results.push(result);
        Some(accessibility)
    }

    /// The result of `volume` that was used last, whatever it was computed from.
    pub fn latest_of(&self, volume: &VolumeId) -> Option<Rc<Accessibility>> {
        self.results.iter().rev().find(|r| &r.0.volume == volume).map(|r| r.1.clone())
    }

    /// Keeps a result; the least recently used one goes when there are too many.
    pub fn insert(&mut self, key: AoKey, accessibility: Rc<Accessibility>) {
        self.results.retain(|r| r.0 != key);
        self.results.push((key, accessibility));
        if self.results.len() > KEPT_RESULTS {
            self.results.remove(0);
        }
    }

    /// Bytes of the results that nobody else holds.
    pub fn evictable_bytes(&self) -> u64 {
        let unused = self.results.iter().filter(|r| Rc::strong_count(&r.1) == 1);
        unused.map(|r| r.1.texture.bytes()).sum()
    }

    /// Drops the least recently used result that nobody else holds, unless only `keep` results are left; false when
    /// there is none.
    pub fn evict_one(&mut self, keep: usize) -> bool {
        let unused = self.results.iter().position(|r| Rc::strong_count(&r.1) == 1);
        let at = unused.filter(|_| self.results.len() > keep);
        at.map(|at| self.results.remove(at)).is_some()
    }

    /// Drops all results of a volume.
    pub fn forget_volume(&mut self, volume: &VolumeId) {
        self.results.retain(|r| &r.0.volume != volume);
    }
}
