//! The instruction set that the kernels run in.

use fearless_simd::Level;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A set of vector instructions. All of them give the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Isa {
    /// 16 lanes: AVX-512 as Ice Lake has it.
    Avx512,
    /// 8 lanes: AVX2.
    Avx2,
    /// The instruction set that the program was compiled for; 4 lanes of SSE2 on x86-64.
    Portable,
}

/// Index in [`Isa::ALL`] of the best set that may be used.
static FASTEST_ALLOWED: AtomicUsize = AtomicUsize::new(0);

impl Isa {
    /// All of them, the fastest first.
    pub const ALL: [Self; 3] = [Self::Avx512, Self::Avx2, Self::Portable];

    /// The fastest one that this machine has, and that [`Self::limit`] allows.
    pub fn detect() -> Self {
        let most = FASTEST_ALLOWED.load(Ordering::Relaxed);
        Self::ALL.into_iter().skip(most).find(|isa| isa.is_available()).unwrap_or(Self::Portable)
    }

    /// Limits [`Self::detect`] in this process to `isa`, for benchmarks and tests: results do not
    /// depend on it. Steppers keep the set that they found when they were made.
    pub fn limit(isa: Self) {
        FASTEST_ALLOWED.store(Self::ALL.iter().position(|i| *i == isa).unwrap_or(0), Ordering::Relaxed);
    }

    /// Whether this machine has it.
    pub fn is_available(self) -> bool {
        self == Self::Portable || self.found().is_some()
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Avx512 => "AVX-512",
            Self::Avx2 => "AVX2",
            Self::Portable => "portable",
        }
    }

    /// The level to dispatch kernels on; the baseline where the machine lacks the instructions.
    pub(crate) fn level(self) -> Level {
        self.found().unwrap_or(Level::baseline())
    }

    #[cfg(target_arch = "x86_64")]
    fn found(self) -> Option<Level> {
        let best = Level::new();
        match self {
            Self::Avx512 => best.as_avx512().map(Level::Avx512),
            Self::Avx2 => best.as_avx2().map(Level::Avx2),
            Self::Portable => None,
        }
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn found(self) -> Option<Level> {
        None
    }
}
