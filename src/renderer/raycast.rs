//! The ray caster's parameters: a scene and a grid as the shader sees them.

use glam::{DMat3, DVec3, DVec4};

use super::exposure::Exposure;
use super::resident::LONGEST_GRADIENT;
use crate::gpu::uniform;
use crate::scene::{Scene, TransferTable};
use crate::volume::Grid;

/// Six sides of the clip box and the scene's eight planes.
const CLIP_PLANES: usize = 14;

uniform! {
    /// Parameters of `gradient`.
    GradientParams in "gradient" {
        dims: [u32; 3],
        first_slice: u32,
        normal_from_index: [[f32; 4]; 3],
        normalise: f32,
        max_length: f32,
        _padding: [u32; 2],
    }
}

uniform! {
    /// Light and coefficients; part of [`RaycastParams`].
    Light in "raycast" {
        direction: [f32; 4],
        color: [f32; 4],
        terms: [f32; 4],
        occlusion: [f32; 4],
    }
}

uniform! {
    /// Parameters of `raycast`.
    RaycastParams in "raycast" {
        light: Light,
        origin: [f32; 4],
        origin_du: [f32; 4],
        origin_dv: [f32; 4],
        forward: [f32; 4],
        dir_du: [f32; 4],
        dir_dv: [f32; 4],
        world_forward: [f32; 4],
        world_dir_du: [f32; 4],
        world_dir_dv: [f32; 4],
        index_from_normal: [[f32; 4]; 3],
        background: [f32; 4],
        clip_planes: [[f32; 4]; CLIP_PLANES],
        inverse_dims: [f32; 3],
        clip_plane_count: u32,
        dims: [f32; 3],
        step_length: f32,
        bricks: [u32; 3],
        entry_scale: f32,
        size: [u32; 2],
        last_entry: u32,
        gradient_scale: f32,
    }
}

/// World length between two samples of a ray.
pub(super) fn step_length(scene: &Scene, grid: &Grid) -> f64 {
    grid.smallest_spacing() / scene.rendering.sampling_rate
}

/// Optical depth of one step at which a value counts as fully opaque: 1 - e^-20 of the light is gone.
const OPAQUE_DEPTH: f64 = 20.0;

/// Running sum of the optical depth per step over a table's entries, one item more than entries. Each sum is split
/// into a large and a small part, so that differences are exact even behind opaque entries.
pub(super) fn depth_prefix(table: &TransferTable) -> Vec<[f32; 2]> {
    let mut sum = 0.0_f64;
    let mut prefix = Vec::with_capacity(table.opacity.len() + 1);
    for opacity in std::iter::once(0.0).chain(table.opacity.iter().map(|&o| f64::from(o))) {
        sum += (-(-opacity).ln_1p()).min(OPAQUE_DEPTH);
        prefix.push([sum as f32, (sum - f64::from(sum as f32)) as f32]);
    }
    prefix
}

/// Columns of h * transpose(index_from_world): index-space gradients to dimensionless world gradients.
pub(super) fn gradient_basis(grid: &Grid) -> [[f32; 4]; 3] {
    let basis: DMat3 = grid.index_from_world().matrix3.transpose() * grid.smallest_spacing();
    [basis.x_axis, basis.y_axis, basis.z_axis].map(|axis| vector(axis, 0.0))
}

/// Columns of h * index_from_world: world directions of length one smallest spacing to index space.
fn index_from_normal(grid: &Grid) -> [[f32; 4]; 3] {
    let basis: DMat3 = grid.index_from_world().matrix3 * grid.smallest_spacing();
    [basis.x_axis, basis.y_axis, basis.z_axis].map(|axis| vector(axis, 0.0))
}

/// The shader's view of a picture. `code_scale` is codes per stored value.
pub(super) fn raycast_params(
    scene: &Scene,
    grid: &Grid,
    table: &TransferTable,
    code_scale: f32,
    bricks: [u32; 3],
    size: [u32; 2],
    exposure: Exposure,
) -> RaycastParams {
    let index_from_world = grid.index_from_world();
    let rays = scene.camera.ray_basis(size[0], size[1]);
    let point = |p: DVec3| vector(index_from_world.transform_point3(p), 0.0);
    let direction = |d: DVec3| vector(index_from_world.transform_vector3(d), 0.0);
    let world = |d: DVec3| vector(d, 0.0);
    let planes = clip_planes(scene, grid);
    let mut clip_planes = [[0.0; 4]; CLIP_PLANES];
    for (slot, plane) in clip_planes.iter_mut().zip(&planes) {
        *slot = plane.to_array().map(|v| v as f32);
    }
    RaycastParams {
        light: light(scene, exposure),
        origin: point(rays.origin),
        origin_du: direction(rays.origin_du),
        origin_dv: direction(rays.origin_dv),
        forward: direction(rays.forward),
        dir_du: direction(rays.dir_du),
        dir_dv: direction(rays.dir_dv),
        world_forward: world(rays.forward),
        world_dir_du: world(rays.dir_du),
        world_dir_dv: world(rays.dir_dv),
        index_from_normal: index_from_normal(grid),
        background: scene.rendering.background.0.map(|v| v as f32),
        clip_planes,
        inverse_dims: grid.dims.map(|n| 1.0 / n as f32),
        clip_plane_count: planes.len() as u32,
        dims: grid.dims.map(|n| n as f32),
        step_length: step_length(scene, grid) as f32,
        bricks,
        entry_scale: code_scale * table.entries_per_code as f32,
        size,
        last_entry: table.opacity.len() as u32 - 1,
        gradient_scale: LONGEST_GRADIENT,
    }
}

fn light(scene: &Scene, exposure: Exposure) -> Light {
    let lighting = &scene.lighting;
    let [r, g, b] = lighting.color.0.map(|v| v as f32);
    let (towards, head_light) = match lighting.direction {
        Some(direction) => (direction, 0.0),
        None => (DVec3::ZERO, 1.0),
    };
    let terms = [lighting.ambient, lighting.diffuse, lighting.specular, lighting.shininess];
    Light {
        direction: vector(towards, head_light),
        color: [r, g, b, exposure.factor as f32],
        terms: terms.map(|v| v as f32),
        occlusion: [scene.ambient_occlusion.strength as f32, exposure.inverse_reference as f32, 0.0, 0.0],
    }
}

/// The clip box's sides and the clip planes, in index space: the kept side has dot(xyz, p) + w >= 0.
fn clip_planes(scene: &Scene, grid: &Grid) -> Vec<DVec4> {
    let mut planes: Vec<(DVec3, f64)> =
        scene.rendering.clip_planes.iter().map(|plane| (plane.normal, plane.d)).collect();
    if let Some(clip) = &scene.rendering.clip_box {
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            planes.push((axis, -axis.dot(clip.min)));
            planes.push((-axis, axis.dot(clip.max)));
        }
    }
    let world_from_index = grid.world_from_index();
    planes
        .into_iter()
        .map(|(normal, d)| {
            let offset = normal.dot(world_from_index.translation) + d;
            (world_from_index.matrix3.transpose() * normal).extend(offset)
        })
        .collect()
}

fn vector(v: DVec3, w: f64) -> [f32; 4] {
    v.extend(w).to_array().map(|c| c as f32)
}
