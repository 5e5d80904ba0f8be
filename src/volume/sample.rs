//! The ten voxel types as one, for code that is generic over them.

use std::str::FromStr;

use bytemuck::Pod;

/// A voxel of any type.
pub(super) trait Sample: Pod + PartialOrd + Send + Sync + FromStr {
    /// The value; 64-bit integers beyond 2^53 are rounded.
    fn to_f64(self) -> f64;
}

macro_rules! samples {
    ($($t:ty),*) => {
        $(impl Sample for $t {
            #[inline]
            fn to_f64(self) -> f64 {
                self as f64
            }
        })*
    };
}
samples!(u8, i8, u16, i16, u32, i32, u64, i64, f32, f64);

/// `body` with `v` bound to the vector inside a [`super::Voxels`], whatever its type. A macro because a closure
/// cannot be generic.
macro_rules! with_voxels {
    ($voxels:expr, $v:ident => $body:expr) => {
        match $voxels {
            $crate::volume::Voxels::U8($v) => $body,
            $crate::volume::Voxels::I8($v) => $body,
            $crate::volume::Voxels::U16($v) => $body,
            $crate::volume::Voxels::I16($v) => $body,
            $crate::volume::Voxels::U32($v) => $body,
            $crate::volume::Voxels::I32($v) => $body,
            $crate::volume::Voxels::U64($v) => $body,
            $crate::volume::Voxels::I64($v) => $body,
            $crate::volume::Voxels::F32($v) => $body,
            $crate::volume::Voxels::F64($v) => $body,
        }
    };
}
pub(super) use with_voxels;
