//! Structs and constants that Rust and WGSL both declare.

use std::collections::BTreeSet;

use spao_server::ao::{
    ClassifyParams, CollectBricksParams, CollectParams, LevelBlocks, LevelInfo, MAX_LEVELS, MipmapParams,
    NBufferParams, RaytracedParams, SpaoParams, SurfaceParams,
};
use spao_server::gpu::{Uniform, assemble, stems};
use spao_server::renderer::{GradientParams, Light, RaycastParams};
use spao_server::scene::MAX_CLIP_PLANES;
use spao_server::volume::BRICK;

fn module(stem: &str) -> naga::Module {
    let assembled = assemble(stem, &[("LEVELS", 8)], &[]).unwrap_or_else(|e| panic!("{e}"));
    assembled.parse().unwrap_or_else(|e| panic!("{e}"))
}

/// How a struct differs from its twin; empty when it does not.
fn differences<T: Uniform>() -> Vec<String> {
    let module = module(T::STEM);
    let Some((_, twin)) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(T::WGSL_NAME)) else {
        return vec![format!("{} has no struct {}", T::STEM, T::WGSL_NAME)];
    };
    let naga::TypeInner::Struct { members, span } = &twin.inner else {
        return vec![format!("{} is no struct", T::WGSL_NAME)];
    };
    let theirs = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset as usize));
    let ours = T::offsets().into_iter().map(|(name, offset)| (name.to_owned(), offset));
    let (ours, theirs): (Vec<_>, Vec<_>) = (ours.collect(), theirs.collect());
    let mut found = Vec::new();
    if ours != theirs {
        found.push(format!("{}: {ours:?} here, {theirs:?} in the shader", T::WGSL_NAME));
    }
    if size_of::<T>() != *span as usize {
        found.push(format!("{}: {} bytes here, {span} in the shader", T::WGSL_NAME, size_of::<T>()));
    }
    found
}

#[test]
fn every_struct_is_laid_out_like_its_twin() {
    let all = [
        differences::<ClassifyParams>(),
        differences::<CollectBricksParams>(),
        differences::<CollectParams>(),
        differences::<GradientParams>(),
        differences::<LevelInfo>(),
        differences::<LevelBlocks>(),
        differences::<Light>(),
        differences::<MipmapParams>(),
        differences::<NBufferParams>(),
        differences::<RaycastParams>(),
        differences::<RaytracedParams>(),
        differences::<SpaoParams>(),
        differences::<SurfaceParams>(),
    ];
    assert_eq!(all.concat(), [""; 0]);
}

#[test]
fn every_uniform_block_of_every_shader_has_a_twin() {
    fn name<T: Uniform>() -> (&'static str, &'static str) {
        (T::STEM, T::WGSL_NAME)
    }
    let compared: BTreeSet<(&str, &str)> = [
        name::<ClassifyParams>(),
        name::<CollectBricksParams>(),
        name::<CollectParams>(),
        name::<GradientParams>(),
        name::<MipmapParams>(),
        name::<NBufferParams>(),
        name::<RaycastParams>(),
        name::<RaytracedParams>(),
        name::<SpaoParams>(),
        name::<SurfaceParams>(),
    ]
    .into();
    // Passes that only serve measurements keep their structs to themselves.
    let served = || stems().filter(|stem| !stem.starts_with("bench_"));
    for stem in served() {
        let module = module(stem);
        let uniforms = module.global_variables.iter().filter(|(_, v)| v.space == naga::AddressSpace::Uniform);
        let names: Vec<_> = uniforms.map(|(_, v)| module.types[v.ty].name.clone().unwrap_or_default()).collect();
        assert_eq!(names.len(), 1, "{stem} has one uniform block, at binding 0");
        assert!(compared.contains(&(stem, names[0].as_str())), "{stem} declares {names:?}");
    }
    assert_eq!(compared.len(), served().count());
}

/// Declares a wrong twin of `MipmapParams`.
macro_rules! wrong_twin {
    ($name:ident, $wgsl:literal, { $($field:ident : $ty:ty),* }) => {
        #[repr(C)]
        #[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
        struct $name { $($field: $ty),* }

        impl Uniform for $name {
            const STEM: &'static str = "ao_mipmap_level";
            const WGSL_NAME: &'static str = $wgsl;
            fn offsets() -> Vec<(&'static str, usize)> {
                let all = [$((stringify!($field), std::mem::offset_of!($name, $field))),*];
                all.into_iter().filter(|f| !f.0.starts_with('_')).collect()
            }
        }
    };
}

wrong_twin!(Right, "MipmapParams", {
    source: LevelInfo, target_level: LevelInfo, tiles: [u32; 3], first_flag: u32, offset: i32, _padding: [u32; 3]
});
wrong_twin!(Swapped, "MipmapParams", {
    source: LevelInfo, target_level: LevelInfo, tiles: [u32; 3], offset: i32, first_flag: u32, _padding: [u32; 3]
});
wrong_twin!(Shifted, "MipmapParams", {
    source: LevelInfo, target_level: LevelInfo, _padding: u32, tiles: [u32; 3], first_flag: u32, offset: i32,
    _end: [u32; 2]
});
wrong_twin!(Unpadded, "MipmapParams", {
    source: LevelInfo, target_level: LevelInfo, tiles: [u32; 3], first_flag: u32, offset: i32
});
wrong_twin!(Short, "MipmapParams", {
    source: LevelInfo, target_level: LevelInfo, tiles: [u32; 3], first_flag: u32, _padding: [u32; 4]
});
wrong_twin!(Nameless, "MipmapParameters", { source: LevelInfo });

#[test]
fn the_comparison_of_twins_notices_order_offset_size_and_name() {
    assert_eq!(differences::<Right>(), [""; 0]);
    let counts = [
        differences::<Swapped>().len(),
        differences::<Shifted>().len(),
        differences::<Unpadded>().len(),
        differences::<Short>().len(),
        differences::<Nameless>().len(),
    ];
    assert_eq!(counts, [1; 5]);
}

/// The constants of a module with this name, as numbers.
fn constants(module: &naga::Module, name: &str) -> Vec<f64> {
    let named = module.constants.iter().filter(|(_, c)| c.name.as_deref() == Some(name));
    let number = |init| match module.global_expressions[init] {
        naga::Expression::Literal(naga::Literal::F32(value)) => f64::from(value),
        naga::Expression::Literal(naga::Literal::U32(value)) => f64::from(value),
        ref other => panic!("{name} is {other:?}"),
    };
    named.map(|(_, c)| number(c.init)).collect()
}

#[test]
fn shaders_that_leap_over_bricks_agree_on_their_size() {
    let mut leaping = 0;
    for stem in stems() {
        let module = module(stem);
        let leaps = module.global_variables.iter().any(|(_, v)| v.name.as_deref() == Some("brick_distance"));
        let expected = if leaps { vec![f64::from(BRICK)] } else { Vec::new() };
        assert_eq!(constants(&module, "BRICK"), expected, "{stem}");
        leaping += usize::from(leaps);
    }
    assert_eq!((BRICK, leaping), (8, 2));
}

/// Items of a fixed-size array in a uniform block.
fn array_length(stem: &str, block: &str, field: &str) -> u32 {
    let module = module(stem);
    let (_, block) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(block)).expect("the block is there");
    let naga::TypeInner::Struct { members, .. } = &block.inner else { panic!("{:?}", block.inner) };
    let member = members.iter().find(|m| m.name.as_deref() == Some(field)).expect("the field is there");
    match module.types[member.ty].inner {
        naga::TypeInner::Array { size: naga::ArraySize::Constant(length), .. } => length.get(),
        ref other => panic!("{field} is {other:?}"),
    }
}

#[test]
fn arrays_in_uniform_blocks_hold_as_much_as_settings_allow() {
    for (stem, block, field) in [
        ("ao_spao", "SpaoParams", "levels"),
        ("ao_spao", "SpaoParams", "inverse_sizes"),
        ("ao_collect_bricks", "CollectBricksParams", "levels"),
        ("ao_collect_bricks", "CollectBricksParams", "level_blocks"),
    ] {
        assert_eq!(array_length(stem, block, field) as usize, MAX_LEVELS, "{block}.{field}");
    }
    let sides_of_the_clip_box = 6;
    let planes = array_length("raycast", "RaycastParams", "clip_planes");
    assert_eq!(planes as usize, MAX_CLIP_PLANES + sides_of_the_clip_box);
}

#[test]
fn the_ray_casting_steps_of_shader_and_reference_are_the_same() {
    // The reference's own step is tested by counting its samples.
    assert_eq!(constants(&module("ao_raytraced"), "STEP"), [0.5]);
}
