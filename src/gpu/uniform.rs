//! Structs that exist twice, here and in a shader.

/// A uniform block with its twin in WGSL. A test compares names and offsets with what naga reads.
pub trait Uniform: bytemuck::Pod {
    /// The shader that declares the twin.
    const STEM: &'static str;
    /// The twin's name.
    const WGSL_NAME: &'static str;
    /// `(field, byte offset)`, padding left out.
    fn offsets() -> Vec<(&'static str, usize)>;
}

/// Declares a [`Uniform`]: the struct and the list of its offsets cannot differ.
/// Fields whose name begins with `_` are padding.
macro_rules! uniform {
    ($(#[$meta:meta])* $name:ident in $stem:literal { $($field:ident : $ty:ty),* $(,)? }) => {
        $(#[$meta])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
        #[allow(missing_docs, reason = "the shader documents the fields")]
        pub struct $name { $(pub $field: $ty),* }

        impl $crate::gpu::Uniform for $name {
            const STEM: &'static str = $stem;
            const WGSL_NAME: &'static str = stringify!($name);
            fn offsets() -> Vec<(&'static str, usize)> {
                [$((stringify!($field), std::mem::offset_of!($name, $field))),*]
                    .into_iter()
                    .filter(|f| !f.0.starts_with('_'))
                    .collect()
            }
        }
    };
}
pub(crate) use uniform;
