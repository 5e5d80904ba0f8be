//! Parameters of the ambient-occlusion passes: twins of the structs in their shaders.

use crate::gpu::uniform;

/// Levels 0..=8.
pub const MAX_LEVELS: usize = 9;

uniform! {
    /// One level of box means, as a shader sees it.
    LevelInfo in "ao_spao" {
        extent: [u32; 3],
        row_words: u32,
        slice_words: u32,
        first_slice: u32,
        inverse_scale: f32,
        lookup_offset: f32,
    }
}

uniform! {
    /// Parameters of `ao_classify`.
    ClassifyParams in "ao_classify" {
        level: LevelInfo,
        dims: [u32; 3],
        origin: u32,
        tiles: [u32; 3],
        code_scale: f32,
    }
}

uniform! {
    /// Parameters of `ao_mipmap_level`.
    MipmapParams in "ao_mipmap_level" {
        source: LevelInfo,
        target_level: LevelInfo,
        tiles: [u32; 3],
        first_flag: u32,
        offset: i32,
        _padding: [u32; 3],
    }
}

uniform! {
    /// Parameters of `ao_nbuffer_level`.
    NBufferParams in "ao_nbuffer_level" {
        source: LevelInfo,
        target_level: LevelInfo,
        tiles: [u32; 3],
        first_flag: u32,
        rows_log2: u32,
        shift_log2: u32,
        near: i32,
        _padding: u32,
        blocks: [u32; 2],
        _padding_2: [u32; 2],
        first_slices: [u32; 3],
        _padding_3: u32,
    }
}

uniform! {
    /// Parameters of `ao_collect`.
    CollectParams in "ao_collect" {
        tiles: [u32; 3],
        first_flag: u32,
        tile: [u32; 3],
        first_candidate: u32,
        source_blocks: [u32; 3],
        candidate_count: u32,
        source_extent: [u32; 3],
        scale: i32,
        offset: i32,
        distance: i32,
        dispatch: u32,
        _padding: u32,
    }
}

uniform! {
    /// Blocks of one level, as `ao_collect_bricks` sees them.
    LevelBlocks in "ao_collect_bricks" {
        blocks: [u32; 3],
        first_flag: u32,
    }
}

uniform! {
    /// Parameters of `ao_collect_bricks`.
    CollectBricksParams in "ao_collect_bricks" {
        levels: [LevelInfo; MAX_LEVELS],
        level_blocks: [LevelBlocks; MAX_LEVELS],
        bricks: [u32; 3],
        level_count: u32,
        first_candidate: u32,
        candidate_count: u32,
        dispatch: u32,
        half_offset: f32,
    }
}

uniform! {
    /// Parameters of `ao_spao`.
    SpaoParams in "ao_spao" {
        levels: [LevelInfo; MAX_LEVELS],
        inverse_sizes: [[f32; 4]; MAX_LEVELS],
        dims: [u32; 3],
        first_slice: u32,
        bricks: [u32; 3],
        row_words: u32,
        normalise: f32,
        normal_factor: f32,
        _padding: [u32; 2],
    }
}

uniform! {
    /// Parameters of `ao_raytraced`.
    RaytracedParams in "ao_raytraced" {
        level: LevelInfo,
        dims: [u32; 3],
        first_row: u32,
        bricks: [u32; 3],
        row_count: u32,
        row_words: u32,
        first_output_row: u32,
        ray_count: u32,
        hemisphere: u32,
        reach: f32,
        normalise: f32,
        _padding: [u32; 2],
    }
}

uniform! {
    /// Parameters of `ao_surface`.
    SurfaceParams in "ao_surface" {
        level: LevelInfo,
        dims: [u32; 3],
        origin: u32,
        bricks: [u32; 3],
        first_brick: u32,
    }
}
