//! The instruction set that a schedule's kernels run in: one choice for both kinds of lanes.

use crate::{Isa, Schedule};
use fearless_simd::Level;

impl Isa {
    /// The same choice for kernels over `fearless_simd`'s vectors.
    pub(crate) fn level(self) -> Level {
        let best = Level::new();
        #[cfg(target_arch = "x86_64")]
        if self == Self::Avx2
            && let Some(avx2) = best.as_avx2()
        {
            return Level::Avx2(avx2);
        }
        if self == Self::Portable { Level::baseline() } else { best }
    }
}

impl Schedule {
    /// Name of the instruction set of this schedule's kernels on this machine; the comparators in double precision have what the program was compiled for.
    pub fn isa(&self) -> &'static str {
        match self {
            Self::QuasiNewton(_) | Self::Descent(_) => Isa::detect().name(),
            Self::SemiImplicit(_) | Self::Xpbd(_) | Self::Newton(_) => Isa::Portable.name(),
        }
    }
}
