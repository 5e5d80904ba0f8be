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
        width: f32,
    }
}

uniform! {
    /// Parameters of `ao_classify`.
    ClassifyParams in "ao_classify" {
        level: LevelInfo,
        dims: [u32; 3],
        first_slice: u32,
        slice_count: u32,
        code_scale: f32,
        _padding: [u32; 2],
    }
}

uniform! {
    /// Parameters of `ao_mipmap_level`.
    MipmapParams in "ao_mipmap_level" {
        source: LevelInfo,
        target_level: LevelInfo,
        first_slice: u32,
        slice_count: u32,
        _padding: [u32; 2],
    }
}

uniform! {
    /// Parameters of `ao_nbuffer_level`.
    NBufferParams in "ao_nbuffer_level" {
        source: LevelInfo,
        target_level: LevelInfo,
        first_slice: u32,
        slice_count: u32,
        shift_log2: u32,
        _padding: u32,
    }
}

uniform! {
    /// Parameters of `ao_spao`.
    SpaoParams in "ao_spao" {
        levels: [LevelInfo; MAX_LEVELS],
        dims: [u32; 3],
        first_slice: u32,
        slice_count: u32,
        row_words: u32,
        normalise: f32,
        normal_factor: f32,
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
        first_row: u32,
        row_count: u32,
        row_words: u32,
        _padding: [u32; 2],
    }
}
