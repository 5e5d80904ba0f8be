//! Exact box means M_w(x) (METHODS 1) from a summed-area table: no levels, no interpolation between windows.

use glam::DVec3;

use super::field::{OpacityField, dims_vec, voxel_count};

/// Means of α over axis-aligned cubes of any width at any place, α constant in each cell and 0 outside.
#[derive(Clone, Debug)]
pub struct BoxMean {
    dims: [u32; 3],
    /// ∫α over [0, i) x [0, j) x [0, k), at the (nx+1)(ny+1)(nz+1) corners of cells.
    prefix: Vec<f64>,
}

impl BoxMean {
    /// Sums up the field. Time and memory: one f64 a voxel.
    pub fn new(opacity: &OpacityField) -> Self {
        let dims = opacity.dims;
        let [nx, ny, nz] = dims.map(|n| n as usize);
        let mut table = Self { dims, prefix: vec![0.0; voxel_count(dims.map(|n| n + 1))] };
        for k in 0..nz {
            for j in 0..ny {
                let mut row = 0.0;
                for i in 0..nx {
                    row += opacity.alpha[(k * ny + j) * nx + i];
                    let (left, below, both) =
                        (table.corner([i + 1, j, k + 1]), table.corner([i + 1, j + 1, k]), table.corner([i + 1, j, k]));
                    let at = table.corner_index([i + 1, j + 1, k + 1]);
                    table.prefix[at] = row + left + below - both;
                }
            }
        }
        table
    }

    /// M_w(x): mean of α over the cube of width `width` > 0 voxels centred at index-space `centre`.
    pub fn mean(&self, centre: DVec3, width: f64) -> f64 {
        let low = centre - 0.5 * width;
        let high = centre + 0.5 * width;
        let mut sum = 0.0;
        for corner in 0..8 {
            let is_high = |a: usize| corner >> a & 1 == 1;
            let pick = |a: usize| if is_high(a) { high[a] } else { low[a] };
            let sign: f64 = (0..3).map(|a| if is_high(a) { 1.0 } else { -1.0 }).product();
            sum += sign * self.integral(DVec3::new(pick(0), pick(1), pick(2)));
        }
        sum / width.powi(3)
    }

    /// ∫α from the index-space origin to `position`. Trilinear inside each cell because α is constant there,
    /// and constant beyond the volume because α is 0 there: hence the clamp.
    fn integral(&self, position: DVec3) -> f64 {
        let p = position.max(DVec3::ZERO).min(dims_vec(self.dims));
        let base = p.floor().min(dims_vec(self.dims) - 1.0);
        let t = p - base;
        let [x, y, z] = base.to_array().map(|b| b as usize);
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        let row = |y: usize, z: usize| mix(self.corner([x, y, z]), self.corner([x + 1, y, z]), t.x);
        let slice = |z: usize| mix(row(y, z), row(y + 1, z), t.y);
        mix(slice(z), slice(z + 1), t.z)
    }

    fn corner(&self, corner: [usize; 3]) -> f64 {
        self.prefix[self.corner_index(corner)]
    }

    fn corner_index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * (self.dims[1] as usize + 1) + y) * (self.dims[0] as usize + 1) + x
    }
}
