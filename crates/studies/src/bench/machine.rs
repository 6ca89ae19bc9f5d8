//! What figures of speed depend on besides the program.

use serde::Serialize;

/// The machine and what of it is used.
#[derive(Clone, Debug, Serialize)]
pub struct Machine {
    /// Logical cores.
    pub cores: usize,
    /// Average number of runnable tasks over the last minute at the beginning, where the system
    /// tells: more than the cores and the figures are too low.
    pub load: Option<f64>,
}

impl Machine {
    /// This machine.
    pub fn here() -> Self {
        let load = std::fs::read_to_string("/proc/loadavg").ok();
        Self {
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            load: load.and_then(|text| text.split(' ').next().and_then(|word| word.parse().ok())),
        }
    }

    /// In words: cores, and the load where the system tells.
    pub fn described(&self) -> String {
        let load = self.load.map_or(String::new(), |l| format!(", load {l:.1} at the beginning"));
        format!("{} cores{load}", self.cores)
    }
}
