//! Single-precision lanes over the machine's vector instructions, chosen at run time.
//!
//! A kernel is written once over [`Lanes`], as a [`Task`], and compiled for every instruction set. Lanes never meet (there is no sum over lanes) and no
//! multiplication is fused with an addition, so that all instruction sets give the same bits.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod portable;

use glam::Vec3A;
use std::ops::{Add, Div, Mul, Sub};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Lanes of a [`Block`].
pub(crate) const BLOCK: usize = 16;

/// As many numbers as the widest registers hold; narrower ones take it in parts.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Block<T>(pub [T; BLOCK]);

/// A set of vector instructions. All of them give the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Isa {
    /// 16 lanes: AVX-512 F and DQ.
    Avx512,
    /// 8 lanes: AVX2.
    Avx2,
    /// Whatever the compiler makes of plain code.
    Portable,
}

/// Place in [`Isa::ALL`] of the best that may be used.
static MOST: AtomicUsize = AtomicUsize::new(0);

impl Isa {
    /// All of them, the fastest first.
    pub const ALL: [Self; 3] = [Self::Avx512, Self::Avx2, Self::Portable];

    /// The fastest one that this machine has, and that [`Self::limit`] allows.
    pub fn detect() -> Self {
        let most = MOST.load(Ordering::Relaxed);
        Self::ALL.into_iter().skip(most).find(|isa| isa.is_available()).unwrap_or(Self::Portable)
    }

    /// Makes [`Self::detect`] in this process find nothing better than `isa`, for benchmarks and tests: results do not depend on it. Steppers keep what they found
    /// when they were made.
    pub fn limit(isa: Self) {
        MOST.store(Self::ALL.iter().position(|i| *i == isa).unwrap_or(0), Ordering::Relaxed);
    }

    /// Whether this machine has it.
    pub fn is_available(self) -> bool {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2"),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx512 | Self::Avx2 => false,
            Self::Portable => true,
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Avx512 => "AVX-512",
            Self::Avx2 => "AVX2",
            Self::Portable => "portable",
        }
    }

    /// Runs a kernel with these instructions, or with portable ones where the machine lacks them.
    pub(crate) fn run<T: Task>(self, task: T) -> T::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 if self.is_available() => avx512::run(task),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 if self.is_available() => avx2::run(task),
            _ => task.run(portable::Portable),
        }
    }
}

/// A kernel. Its `run` and all it calls in its inner loops must be `#[inline(always)]`, and neither closures nor iterators' adaptors that take one: only what is
/// inlined for certain is compiled with the lanes' instructions; the rest calls every one of them.
pub(crate) trait Task {
    type Output;
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}

/// The instructions of one [`Isa`]. A value of this type is the proof that the machine has them, and makes the first registers' worth of numbers.
///
/// `part` says which part of a block is meant: it has `BLOCK / WIDTH` parts. Masks have the part's first lane in their lowest bit.
pub(crate) trait Lanes: Copy {
    /// Lanes of a register.
    const WIDTH: usize;
    /// Parts of a block.
    const PARTS: usize = BLOCK / Self::WIDTH;
    /// A register of numbers.
    type F: Copy + Add<Output = Self::F> + Sub<Output = Self::F> + Mul<Output = Self::F> + Div<Output = Self::F>;

    /// The same number in all lanes.
    fn splat(self, value: f32) -> Self::F;
    fn load(self, from: &Block<f32>, part: usize) -> Self::F;
    fn store(self, value: Self::F, to: &mut Block<f32>, part: usize);
    /// `a` where it is less, else `b`.
    fn min(self, a: Self::F, b: Self::F) -> Self::F;
    /// `a` where it is more, else `b`.
    fn max(self, a: Self::F, b: Self::F) -> Self::F;
    fn abs(self, a: Self::F) -> Self::F;
    /// `magnitude`, not negative, with the sign of `sign`; 0 where `sign` is 0.
    fn signed(self, magnitude: Self::F, sign: Self::F) -> Self::F;
    /// Where `a < b`.
    fn less(self, a: Self::F, b: Self::F) -> u16;
    /// `yes` where the mask's bit is set, else `no`.
    fn select(self, mask: u16, yes: Self::F, no: Self::F) -> Self::F;
    #[allow(unsafe_code, reason = "bounds checks of sixteen rows would cost a tenth of the sweep")]
    /// The coordinates of points, turned from rows into registers.
    ///
    /// # Safety
    /// Each of the part's `offsets` [bytes] is 16 times the index of one of `points`.
    unsafe fn rows(self, points: &[Vec3A], offsets: &Block<u32>, part: usize) -> [Self::F; 3];
}

/// Three registers of three blocks.
#[inline(always)]
pub(crate) fn load3<L: Lanes>(lanes: L, from: &[Block<f32>; 3], part: usize) -> [L::F; 3] {
    [lanes.load(&from[0], part), lanes.load(&from[1], part), lanes.load(&from[2], part)]
}

/// Three registers into three blocks.
#[inline(always)]
pub(crate) fn store3<L: Lanes>(lanes: L, value: [L::F; 3], to: &mut [Block<f32>; 3], part: usize) {
    lanes.store(value[0], &mut to[0], part);
    lanes.store(value[1], &mut to[1], part);
    lanes.store(value[2], &mut to[2], part);
}


#[inline(always)]
pub(crate) fn minus<L: Lanes>(a: [L::F; 3], b: [L::F; 3]) -> [L::F; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn scaled<L: Lanes>(k: L::F, a: [L::F; 3]) -> [L::F; 3] {
    [k * a[0], k * a[1], k * a[2]]
}

#[inline(always)]
pub(crate) fn dot<L: Lanes>(a: [L::F; 3], b: [L::F; 3]) -> L::F {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross<L: Lanes>(a: [L::F; 3], b: [L::F; 3]) -> [L::F; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `mask`'s bits of a part.
#[inline(always)]
pub(crate) fn part_of<L: Lanes>(mask: u16, part: usize) -> u16 {
    (u32::from(mask) >> (part * L::WIDTH)) as u16 & ((1u32 << L::WIDTH) - 1) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One of everything, for each part of a block.
    struct Everything {
        points: Vec<Vec3A>,
    }

    impl Task for Everything {
        type Output = Vec<u32>;

        #[inline(always)]
        #[allow(unsafe_code, reason = "rows needs indices that are in range")]
        fn run<L: Lanes>(self, lanes: L) -> Vec<u32> {
            let block = |k: f32| Block(std::array::from_fn(|i| ((i as f32 + 1.0) * k).sin()));
            let (a, b, mut out) = (block(0.7), block(1.9), [Block([0.0f32; BLOCK]); 11]);
            let mut sign = b;
            sign.0[3] = 0.0;
            let offsets = Block(std::array::from_fn(|i| 16 * ((i as u32 * 7) % 19)));
            let mut masks = 0u32;
            for part in 0..L::PARTS {
                let (x, y) = (lanes.load(&a, part), lanes.load(&b, part));
                // SAFETY: below 19 points.
                let rows = unsafe { lanes.rows(&self.points, &offsets, part) };
                let less = lanes.less(x, y);
                masks |= u32::from(less) << (part * L::WIDTH);
                let selected = lanes.select(part_of::<L>(0b0110_1001_1010_0011, part), x, y);
                let signed = lanes.signed(lanes.splat(2.5), lanes.load(&sign, part));
                let all = [
                    x + y * x - x / y,
                    lanes.min(x, y),
                    lanes.max(x, y),
                    lanes.abs(x),
                    signed,
                    selected,
                    lanes.select(less, x, y),
                    rows[0],
                    rows[1],
                    rows[2],
                    x * y + x,
                ];
                for (value, out) in all.into_iter().zip(&mut out) {
                    lanes.store(value, out, part);
                }
            }
            let bits = out.iter().flat_map(|b| b.0).map(f32::to_bits);
            bits.chain([masks]).collect()
        }
    }

    #[test]
    fn all_instruction_sets_give_the_same_bits() {
        let points = || (0..19).map(|i| Vec3A::new(i as f32, i as f32 + 0.25, -(i as f32))).collect();
        let expected = Isa::Portable.run(Everything { points: points() });
        assert_eq!(expected[4 * BLOCK + 3], 0);
        assert_eq!(f32::from_bits(expected[8 * BLOCK + 2]), 14.25);
        for isa in Isa::ALL {
            assert_eq!(isa.run(Everything { points: points() }), expected, "{}", isa.name());
        }
    }
}
