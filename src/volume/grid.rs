//! Where voxels are in the world.

use glam::{DAffine3, DMat3, DVec3};

use super::VolumeError;

/// Spacings and positions further from 1 than this are mistakes, and their squares would leave `f32` on the GPU.
const LARGEST_LENGTH: f64 = 1e12;

/// Below this volume of the parallelepiped of the three unit directions, they lie in one plane.
const SMALLEST_DETERMINANT: f64 = 1e-6;

/// A regular, possibly anisotropic and oblique, grid of voxels.
///
/// *Index space*: voxel (i, j, k) fills the cell [i, i+1) x [j, j+1) x [k, k+1), its centre is at +0.5.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Number of voxels along x (fastest in memory), y and z.
    pub dims: [u32; 3],
    /// Distance between neighbouring voxel centres along each index axis, in world units; positive.
    pub spacing: DVec3,
    /// World position of the *centre* of voxel (0, 0, 0).
    pub origin: DVec3,
    /// `direction[a]` is the unit world vector of index axis `a`; linearly independent.
    pub direction: [DVec3; 3],
}

impl Grid {
    /// An axis-aligned grid with the given spacing and the first voxel's centre at the origin.
    pub fn axis_aligned(dims: [u32; 3], spacing: DVec3) -> Self {
        Self { dims, spacing, origin: DVec3::ZERO, direction: [DVec3::X, DVec3::Y, DVec3::Z] }
    }

    /// A grid by what one step along each index axis is in the world; an error names `field` if the steps do not span
    /// space.
    pub(super) fn from_steps(
        field: &str,
        dims: [u32; 3],
        steps: [DVec3; 3],
        origin: DVec3,
    ) -> Result<Self, VolumeError> {
        let spacing = DVec3::from_array(steps.map(DVec3::length));
        check_spacing(field, spacing)?;
        // Adding 0 turns -0 into 0.
        let direction = steps.map(|step| step.normalize() + DVec3::ZERO);
        check_direction(field, direction)?;
        let origin = origin + DVec3::ZERO;
        check_origin(field, origin)?;
        Ok(Self { dims, spacing, origin, direction })
    }

    /// The grid with these directions of its axes. Rounded numbers make nearly unit vectors; any other length is part
    /// of the spacing. An error names `field` if they do not span space.
    pub(super) fn turned(self, field: &str, directions: [DVec3; 3]) -> Result<Self, VolumeError> {
        let unit = Self::from_steps(field, self.dims, directions, self.origin)?;
        let rounded = (unit.spacing - DVec3::ONE).abs().max_element() < 1e-3;
        let spacing = if rounded { self.spacing } else { self.spacing * unit.spacing };
        check_spacing(field, spacing)?;
        Ok(Self { spacing, ..unit })
    }

    /// Whether the grid maps index space to the world and back.
    ///
    /// # Errors
    /// Names `dims` with an empty axis, `spacing` outside 1e-12 to 1e12, `origin` not finite or beyond 1e12,
    /// `direction` not of unit length or all in one plane.
    pub fn check(&self) -> Result<(), VolumeError> {
        if self.dims.contains(&0) {
            let message = format!("{:?} has an empty axis; expected at least 1 voxel", self.dims);
            return Err(VolumeError::malformed("dims", message));
        }
        check_spacing("spacing", self.spacing)?;
        check_origin("origin", self.origin)?;
        check_direction("direction", self.direction)
    }

    /// The grid of blocks of `factor` voxels, `dims` of them, the first of which begins with the voxel `first`.
    pub(super) fn part(&self, first: [u32; 3], factor: [u32; 3], dims: [u32; 3]) -> Self {
        let steps =
            DVec3::from_array(std::array::from_fn(|axis| f64::from(first[axis]) + 0.5 * f64::from(factor[axis] - 1)))
                * self.spacing;
        let [x, y, z] = self.direction;
        let origin = self.origin + x * steps.x + y * steps.y + z * steps.z;
        let spacing = self.spacing * DVec3::from_array(factor.map(f64::from));
        Self { dims, spacing, origin, direction: self.direction }
    }

    /// Number of voxels.
    pub fn voxel_count(&self) -> u64 {
        self.dims.iter().map(|&n| u64::from(n)).product()
    }

    /// Dimensions as a vector.
    pub fn dims_vec(&self) -> DVec3 {
        DVec3::new(f64::from(self.dims[0]), f64::from(self.dims[1]), f64::from(self.dims[2]))
    }

    /// The smallest spacing `h`: one voxel step of ambient occlusion and of the ray caster.
    pub fn smallest_spacing(&self) -> f64 {
        self.spacing.min_element()
    }

    /// World position of an index-space position (METHODS: `world(p) = affine * (p - 0.5)`).
    pub fn world_from_index(&self) -> DAffine3 {
        let axes = DMat3::from_cols(
            self.direction[0] * self.spacing.x,
            self.direction[1] * self.spacing.y,
            self.direction[2] * self.spacing.z,
        );
        DAffine3::from_mat3_translation(axes, self.origin - axes * DVec3::splat(0.5))
    }

    /// Index-space position of a world position.
    pub fn index_from_world(&self) -> DAffine3 {
        self.world_from_index().inverse()
    }

    /// World position of the middle of the grid.
    pub fn center(&self) -> DVec3 {
        self.world_from_index().transform_point3(self.dims_vec() * 0.5)
    }

    /// The eight outer corners in world space.
    pub fn corners(&self) -> [DVec3; 8] {
        let world_from_index = self.world_from_index();
        std::array::from_fn(|c| {
            let unit = DVec3::new((c & 1) as f64, ((c >> 1) & 1) as f64, ((c >> 2) & 1) as f64);
            world_from_index.transform_point3(unit * self.dims_vec())
        })
    }
}

/// An error names `field` unless every spacing is within 1e-12 to 1e12.
pub(super) fn check_spacing(field: &str, spacing: DVec3) -> Result<(), VolumeError> {
    let allowed = LARGEST_LENGTH.recip()..=LARGEST_LENGTH;
    match spacing.to_array().iter().find(|length| !allowed.contains(length)) {
        Some(length) => Err(VolumeError::malformed(field, format!("{length} is not a spacing; expected {allowed:?}"))),
        None => Ok(()),
    }
}

/// An error names `field` unless the origin is finite and within 1e12.
pub(super) fn check_origin(field: &str, origin: DVec3) -> Result<(), VolumeError> {
    // Not `>`: NaN must fail.
    if origin.abs().cmple(DVec3::splat(LARGEST_LENGTH)).all() {
        Ok(())
    } else {
        Err(VolumeError::malformed(
            field,
            format!("{:?} is not a position within {LARGEST_LENGTH:e}", origin.to_array()),
        ))
    }
}

/// An error names `field` unless the directions are unit vectors that span space.
pub(super) fn check_direction(field: &str, direction: [DVec3; 3]) -> Result<(), VolumeError> {
    let [x, y, z] = direction;
    if !direction.iter().all(|d| (d.length() - 1.0).abs() < 1e-6) {
        return Err(VolumeError::malformed(field, format!("{x:.6} {y:.6} {z:.6} are not unit vectors")));
    }
    if DMat3::from_cols(x, y, z).determinant().abs() < SMALLEST_DETERMINANT {
        return Err(VolumeError::malformed(field, format!("{x:.6} {y:.6} {z:.6} lie in one plane")));
    }
    Ok(())
}
