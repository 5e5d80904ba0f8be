//! What an accessibility volume is known by.

use spao_server::ao::{AoKey, TileSet};
use spao_server::scene::{AmbientOcclusion, Radius};
use spao_server::volume::VolumeId;

use super::support::{hybrid, mipmap, n_buffer, raytraced};

fn key(settings: &AmbientOcclusion) -> AoKey {
    AoKey::new(&VolumeId("v_1".into()), &[0, 1, 65535], &TileSet::full([2, 3, 1]), settings)
}

/// All different from each other.
fn distinct() -> Vec<AmbientOcclusion> {
    let with_radius = |radius, levels| AmbientOcclusion { radius, ..raytraced(levels, 0.0, 64) };
    vec![
        n_buffer(6, 1.0),
        n_buffer(5, 1.0),
        n_buffer(6, 0.5),
        n_buffer(6, 0.0),
        mipmap(6, 1.0),
        mipmap(5, 1.0),
        hybrid(6, 1, 1.0),
        hybrid(6, 2, 1.0),
        raytraced(6, 1.0, 64),
        raytraced(6, 0.0, 64),
        raytraced(6, 0.0, 65),
        raytraced(5, 0.0, 64),
        with_radius(Radius::Voxels(6.0), 6),
        with_radius(Radius::Voxels(32.0), 6),
        with_radius(Radius::Unlimited, 6),
    ]
}

#[test]
fn settings_that_change_the_result_change_the_key() {
    let all = distinct();
    for (i, a) in all.iter().enumerate() {
        for b in &all[i + 1..] {
            assert_ne!(key(a), key(b), "{a:?} {b:?}");
        }
    }
}

#[test]
fn settings_that_a_method_does_not_read_do_not_change_the_key() {
    for settings in distinct() {
        let with = |change: &dyn Fn(&mut AmbientOcclusion)| {
            let mut changed = settings;
            change(&mut changed);
            assert_ne!(changed, settings);
            key(&changed)
        };
        // What a picture does with accessibility is no part of it.
        assert_eq!(with(&|s| s.strength = 0.25), key(&settings));
        assert_eq!(with(&|s| s.falloff = 2.0), key(&settings));
    }
    let spao = n_buffer(6, 1.0);
    assert_eq!(key(&AmbientOcclusion { rays: 7, ..spao }), key(&spao));
    assert_eq!(key(&AmbientOcclusion { radius: Radius::Unlimited, ..spao }), key(&spao));
    assert_eq!(key(&AmbientOcclusion { mip_levels: 3, ..spao }), key(&spao));
    assert_eq!(key(&AmbientOcclusion { mip_levels: 3, ..mipmap(6, 1.0) }), key(&mipmap(6, 1.0)));

    let rays = raytraced(6, 1.0, 64);
    assert_eq!(key(&AmbientOcclusion { structure: mipmap(6, 1.0).structure, mip_levels: 2, ..rays }), key(&rays));
    // Of the factor only whether there is a hemisphere; of the levels only how far they reach.
    assert_eq!(key(&raytraced(6, 0.5, 64)), key(&rays));
    for radius in [Radius::Voxels(6.0), Radius::Unlimited] {
        let (a, b) = (AmbientOcclusion { radius, ..rays }, AmbientOcclusion { radius, ..raytraced(3, 1.0, 64) });
        assert_eq!(key(&a), key(&b));
    }
}

#[test]
fn a_hybrid_at_either_end_is_what_it_is_equal_to() {
    assert_eq!(key(&hybrid(6, 0, 1.0)), key(&n_buffer(6, 1.0)));
    assert_eq!(key(&hybrid(6, 6, 1.0)), key(&mipmap(6, 1.0)));
}

#[test]
fn the_volume_and_every_opacity_are_part_of_the_key() {
    let settings = n_buffer(6, 1.0);
    let key =
        |volume: &str, table: &[u16]| AoKey::new(&VolumeId(volume.into()), table, &TileSet::full([1; 3]), &settings);
    assert_eq!(key("v_1", &[0, 1, 65535]), key("v_1", &[0, 1, 65535]));
    assert_ne!(key("v_1", &[0, 1, 65535]), key("v_2", &[0, 1, 65535]));
    assert_ne!(key("v_1", &[0, 1, 65535]), key("v_1", &[0, 1, 65534]));
    assert_ne!(key("v_1", &[0, 1, 65535]), key("v_1", &[0, 1, 65535, 0]));
    assert_eq!(key("v_1", &[]).volume(), &VolumeId("v_1".into()));
}

#[test]
fn the_bricks_that_have_accessibility_are_part_of_the_key() {
    let settings = n_buffer(6, 1.0);
    let key = |wanted: &TileSet| AoKey::new(&VolumeId("v_1".into()), &[0, 1, 65535], wanted, &settings);
    let one_of_six = |at| TileSet::of([2, 3, 1], |brick| brick == at);
    let sets = [TileSet::empty([2, 3, 1]), TileSet::full([2, 3, 1]), one_of_six(0), one_of_six(5)];
    for (i, a) in sets.iter().enumerate() {
        assert_eq!(key(a), key(&a.clone()));
        for b in &sets[i + 1..] {
            assert_ne!(key(a), key(b), "{a:?} {b:?}");
        }
    }
}
