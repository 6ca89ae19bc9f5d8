//! The machine on which speed is measured.

use serde::Serialize;

/// The machine.
#[derive(Clone, Debug, Serialize)]
pub struct Machine {
    /// Logical cores.
    pub cores: usize,
    /// Load average over the last minute at the start, if the system reports it. A load above the
    /// number of cores makes the figures too low.
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

    /// A text: cores, and the load if known.
    pub fn described(&self) -> String {
        let load = self.load.map_or(String::new(), |l| format!(", load {l:.1} at the start"));
        format!("{} cores{load}", self.cores)
    }
}
