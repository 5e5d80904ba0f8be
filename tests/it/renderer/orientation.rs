//! Where voxels appear in the picture: nothing is flipped, swapped or skewed.

use glam::DVec3;
use serde_json::json;
use spao_server::scene::{Camera, Projection, Scene};
use spao_server::volume::Grid;

use super::support::{Picture, Studio, oblique, volume_of};

const DIMS: [u32; 3] = [19, 13, 11];
const SIZE: [u32; 2] = [96, 64];

fn cameras(grid: &Grid) -> [Camera; 3] {
    let target = grid.center() + DVec3::new(1.0, -0.5, 0.3);
    let camera = |away: DVec3, up: DVec3, projection| Camera { eye: target + away, target, up, projection };
    [
        camera(DVec3::new(8.0, -45.0, 12.0), DVec3::Z, Projection::Perspective { fov_y_deg: 35.0 }),
        camera(DVec3::new(28.0, 19.0, -26.0), DVec3::new(0.2, 1.0, 0.1), Projection::Perspective { fov_y_deg: 50.0 }),
        camera(DVec3::new(-9.0, 21.0, 22.0), DVec3::new(0.0, 0.3, 1.0), Projection::Orthographic { height: 32.0 }),
    ]
}

/// Pixel coordinates of a world point, by textbook projection.
fn projected(camera: &Camera, point: DVec3) -> [f64; 2] {
    let forward = (camera.target - camera.eye).normalize();
    let right = forward.cross(camera.up).normalize();
    let up = right.cross(forward);
    let from_eye = point - camera.eye;
    let half_height = match camera.projection {
        Projection::Perspective { fov_y_deg } => from_eye.dot(forward) * (fov_y_deg.to_radians() / 2.0).tan(),
        Projection::Orthographic { height } => height / 2.0,
    };
    let [width, height] = SIZE.map(f64::from);
    [
        width / 2.0 + from_eye.dot(right) / half_height * height / 2.0,
        height / 2.0 - from_eye.dot(up) / half_height * height / 2.0,
    ]
}

/// Where the light of a picture has its centre of mass, in pixels; pixel centres are at +0.5.
fn centre_of_mass(picture: &Picture) -> [f64; 2] {
    let (mut x, mut y, mut sum) = (0.0, 0.0, 0.0);
    for (i, pixel) in picture.pixels.iter().enumerate() {
        let light = f64::from(pixel[0]);
        x += light * (f64::from(i as u32 % SIZE[0]) + 0.5);
        y += light * (f64::from(i as u32 / SIZE[0]) + 0.5);
        sum += light;
    }
    assert!(sum > 0.0, "nothing to see");
    [x / sum, y / sum]
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[test]
fn one_bright_voxel_appears_where_it_projects_to_and_nowhere_mirrored() {
    let voxel = [14, 3, 8];
    let [x, y, z] = voxel;
    let volume = oblique(volume_of(DIMS, |v| if v == voxel { 1000 } else { 0 }));
    let grid = volume.grid.clone();
    let mut studio = Studio::new(volume);
    let template = studio.scene(&json!({
        "transfer_function": {"points": [
            {"value": 300, "color": "#ffffff", "opacity": 0.0}, {"value": 1000, "color": "#ffffff", "opacity": 0.3}
        ]},
        "lighting": {"ambient": 1, "diffuse": 0, "specular": 0},
        "ambient_occlusion": {"method": "off"}
    }));
    for camera in cameras(&grid) {
        let found = centre_of_mass(&studio.picture(&Scene { camera: camera.clone(), ..template.clone() }, SIZE));
        let pixel_of = |v: [u32; 3]| {
            let centre = DVec3::from_array(v.map(f64::from)) + 0.5;
            projected(&camera, grid.world_from_index().transform_point3(centre))
        };
        let off = distance(found, pixel_of(voxel));
        assert!(off < 0.2, "found at {found:?}, expected at {:?}", pixel_of(voxel));
        // A neighbour, a mirrored axis or swapped axes would be seen.
        for wrong in [[18 - x, y, z], [x, 12 - y, z], [x, y, 10 - z], [x - 1, y, z], [y, x, z], [x, z, y]] {
            assert!(distance(found, pixel_of(wrong)) > 0.8, "{voxel:?} cannot be told from {wrong:?}");
        }
    }
}

#[test]
fn a_wide_picture_shows_more_aside_and_the_same_in_the_middle() {
    let mut studio = Studio::new(volume_of(DIMS, |[i, j, k]| (i * 31 + j * 17 + k * 7) as u16));
    let scene = studio.scene(&json!({"ambient_occlusion": {"method": "off"}}));
    let square = studio.picture(&scene, [40, 40]);
    let wide = studio.picture(&scene, [80, 40]);
    for y in 0..40 {
        for x in 0..40 {
            let worst = square.at(x, y).iter().zip(wide.at(x + 20, y)).map(|(a, b)| a.abs_diff(b)).max();
            assert!(worst <= Some(1), "pixel {x}, {y}");
        }
    }
}
