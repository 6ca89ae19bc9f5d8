//! The two types of numbers that a factor may have.

use fearless_simd::{Simd, SimdBase, f32x16, f64x8};
use std::ops::{Add, Div, Mul, Sub};

/// A floating-point number: `f32` or `f64`.
pub trait Real:
    Copy
    + Default
    + PartialOrd
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + 'static
{
    /// Numbers in a vector of 64 bytes: rows of a tile.
    const LANES: usize;
    /// 1.
    const ONE: Self;
    /// A vector of 64 bytes.
    type Vector<S: Simd>: SimdBase<S, Element = Self>;

    /// Whether it is neither infinite nor not a number.
    fn is_finite(self) -> bool;

    /// Square root.
    #[must_use]
    fn sqrt(self) -> Self;
}

impl Real for f32 {
    const LANES: usize = 16;
    const ONE: Self = 1.0;
    type Vector<S: Simd> = f32x16<S>;

    fn is_finite(self) -> bool {
        self.is_finite()
    }

    fn sqrt(self) -> Self {
        self.sqrt()
    }
}

impl Real for f64 {
    const LANES: usize = 8;
    const ONE: Self = 1.0;
    type Vector<S: Simd> = f64x8<S>;

    fn is_finite(self) -> bool {
        self.is_finite()
    }

    fn sqrt(self) -> Self {
        self.sqrt()
    }
}
