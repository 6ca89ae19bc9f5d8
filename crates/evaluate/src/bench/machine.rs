//! What figures of speed depend on besides the program.

use serde::Serialize;

/// The machine and what of it is used.
#[derive(Clone, Debug, Serialize)]
pub struct Machine {
    /// Instruction set of the solver's kernels.
    pub isa: &'static str,
    /// Widest instruction set that the processor has.
    pub widest_isa: &'static str,
    /// Logical cores.
    pub cores: usize,
    /// Average number of runnable tasks over the last minute at the beginning, where the system tells: more than the cores and the figures are too low.
    pub load: Option<f64>,
}

impl Machine {
    /// This machine.
    pub fn here() -> Self {
        let load = std::fs::read_to_string("/proc/loadavg").ok();
        Self {
            isa: compiled_isa(),
            widest_isa: widest_isa(),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            load: load.and_then(|text| text.split(' ').next().and_then(|word| word.parse().ok())),
        }
    }
}

/// What the program was compiled for: its kernels do not choose at run time.
fn compiled_isa() -> &'static str {
    if cfg!(target_feature = "avx512f") {
        "avx512"
    } else if cfg!(target_feature = "avx2") {
        "avx2"
    } else if cfg!(target_feature = "sse2") {
        "sse2"
    } else if cfg!(target_feature = "neon") {
        "neon"
    } else {
        "portable"
    }
}

#[cfg(target_arch = "x86_64")]
fn widest_isa() -> &'static str {
    if std::arch::is_x86_feature_detected!("avx512f") {
        "avx512"
    } else if std::arch::is_x86_feature_detected!("avx2") {
        "avx2"
    } else {
        "sse2"
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn widest_isa() -> &'static str {
    compiled_isa()
}
