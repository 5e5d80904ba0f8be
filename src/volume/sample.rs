//! The ten voxel types as one, for code that is generic over them.

use std::str::FromStr;

use bytemuck::Pod;

use super::Voxels;

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

/// A voxel of which means can be had in its own type.
pub(super) trait Average: Sample {
    /// Sum of many values, exact or as good as.
    type Total: Copy + Default + Send;

    /// Adds the value to a sum and counts it; NaN does nothing.
    fn add_to(&self, sum: &mut (Self::Total, u64));

    /// The mean of what was counted; of nothing, NaN.
    fn mean(sum: (Self::Total, u64)) -> Self;

    /// Values as the voxels of a volume.
    fn into_voxels(values: Vec<Self>) -> Voxels;
}

macro_rules! integer_means {
    ($($t:ty, $variant:ident, $total:ty;)*) => {
        $(impl Average for $t {
            type Total = $total;

            #[inline]
            fn add_to(&self, sum: &mut (Self::Total, u64)) {
                sum.0 += <$total>::from(*self);
                sum.1 += 1;
            }

            fn mean((total, count): (Self::Total, u64)) -> Self {
                let (total, count) = (i128::from(total), i128::from(count.max(1)));
                // Rounded to the nearest, halves away from 0.
                let doubled = 2 * total + if total < 0 { -count } else { count };
                // A mean lies between the values.
                (doubled / (2 * count)) as Self
            }

            fn into_voxels(values: Vec<Self>) -> Voxels {
                Voxels::$variant(values)
            }
        })*
    };
}
// A volume has fewer than 2^31 voxels of 32 bits, or its sums would not fit; i128 holds those of 64 bits.
integer_means! {
    u8, U8, i64;
    i8, I8, i64;
    u16, U16, i64;
    i16, I16, i64;
    u32, U32, i64;
    i32, I32, i64;
    u64, U64, i128;
    i64, I64, i128;
}

/// From here on values are summed by themselves, scaled down, so that no sum overflows.
const HUGE: f64 = 1e280;

/// What huge values are divided by.
const HUGE_SCALE: f64 = (1_u128 << 120) as f64;

macro_rules! float_means {
    ($($t:ty, $variant:ident;)*) => {
        $(impl Average for $t {
            /// Of values, and of huge ones over [`HUGE_SCALE`].
            type Total = [f64; 2];

            #[inline]
            fn add_to(&self, ([total, huge], count): &mut (Self::Total, u64)) {
                let value = f64::from(*self);
                if value.abs() < HUGE {
                    *total += value;
                } else if value.is_nan() {
                    return;
                } else {
                    *huge += value / HUGE_SCALE;
                }
                *count += 1;
            }

            fn mean(([total, huge], count): (Self::Total, u64)) -> Self {
                // 0 / 0 is NaN, as it should be.
                (total / count as f64 + huge / count as f64 * HUGE_SCALE) as Self
            }

            fn into_voxels(values: Vec<Self>) -> Voxels {
                Voxels::$variant(values)
            }
        })*
    };
}
float_means! {
    f32, F32;
    f64, F64;
}

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
