//! The instruction set that a schedule's kernels run in, for figures of speed.

use crate::Schedule;
use fearless_simd::Level;

impl Schedule {
    /// Name of the instruction set of this schedule's kernels on this machine: the quasi-Newton method chooses the widest at run time, sweeps are what the program was
    /// compiled for.
    pub fn isa(&self) -> &'static str {
        match self {
            Self::QuasiNewton(_) => chosen(Level::new()),
            Self::Descent(_) => chosen(Level::baseline()),
        }
    }
}

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
fn chosen(level: Level) -> &'static str {
    if level.as_avx512().is_some() {
        "avx512"
    } else if level.as_avx2().is_some() {
        "avx2"
    } else if level.as_sse4_2().is_some() {
        "sse4.2"
    } else if level.as_sse2().is_some() {
        "sse2"
    } else {
        "portable"
    }
}

#[cfg(target_arch = "aarch64")]
fn chosen(level: Level) -> &'static str {
    if level.as_neon().is_some() { "neon" } else { "portable" }
}

#[cfg(not(any(target_arch = "x86", target_arch = "x86_64", target_arch = "aarch64")))]
fn chosen(_: Level) -> &'static str {
    "portable"
}
