//! What is derived from the voxels before a volume is shown.

use sha2::{Digest, Sha256};

use super::{Histogram, LoadStage, LoadWatch, MAX_BINS, Volume, VolumeError};

/// Bytes that are summed before anyone looks whether the volume is still wanted.
const PIECE: usize = 1 << 20;

/// See [`Volume::derive`].
#[derive(Clone, Debug, PartialEq)]
pub struct Derived {
    /// See [`Volume::histogram`].
    pub histogram: Histogram,
    /// See [`Volume::sha256_hex`].
    pub sha256: String,
}

impl Volume {
    /// All that is derived from the voxels; finds [`Volume::bricks`] too, so that nobody waits for them later. The
    /// watch is told, in the stage [`LoadStage::Preparing`].
    ///
    /// # Errors
    /// [`VolumeError::Cancelled`]; names `bins` unless it is 1 to [`MAX_BINS`].
    pub fn derive(&self, bins: u32, watch: &LoadWatch) -> Result<Derived, VolumeError> {
        if !(1..=MAX_BINS).contains(&bins) {
            return Err(VolumeError::malformed("bins", format!("{bins} is not in 1 to {MAX_BINS}")));
        }
        // Three passes over the voxels.
        watch.begin(LoadStage::Preparing, 3 * self.grid.voxel_count());
        self.prepare_bricks(watch)?;
        Ok(Derived { histogram: self.count(bins, watch)?, sha256: self.sum(watch)? })
    }

    /// SHA-256 of what the volume is, as 64 hex digits: dims, voxel type, geometry and voxels, in that order and in
    /// little-endian bytes, so that the same volume has the same sum whatever file it came from.
    pub fn sha256_hex(&self) -> String {
        self.sum(&LoadWatch::default()).expect("nobody can call it off")
    }

    fn sum(&self, watch: &LoadWatch) -> Result<String, VolumeError> {
        let mut sha = Sha256::new();
        for n in self.grid.dims {
            sha.update(n.to_le_bytes());
        }
        sha.update(self.voxels.voxel_type().name());
        let [x, y, z] = self.grid.direction;
        for v in [self.grid.spacing, self.grid.origin, x, y, z] {
            for component in v.to_array() {
                // Adding 0 turns -0 into 0.
                sha.update((component + 0.0).to_le_bytes());
            }
        }
        let voxel_bytes = self.voxels.voxel_type().bytes();
        for piece in self.voxels.little_endian_bytes().chunks(PIECE) {
            sha.update(piece);
            watch.step(piece.len() as u64 / voxel_bytes)?;
        }
        Ok(sha.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
    }
}
