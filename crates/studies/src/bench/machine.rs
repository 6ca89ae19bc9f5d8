//! The machine on which speed is measured.

use serde::Serialize;
use trocar_report::table::count;
use trocar_tissue::Model;

/// The machine.
#[derive(Clone, Debug, Serialize)]
pub struct Machine {
    /// Logical cores.
    pub cores: usize,
    /// Load average over the last minute at the start, if the system reports it. A load above the
    /// number of cores makes the figures too low.
    pub load: Option<f64>,
}

/// What was stepped, and on what.
#[derive(Clone, Debug, Serialize)]
pub struct Setup {
    /// Number of organs.
    pub organs: usize,
    /// Number of nodes.
    pub nodes: usize,
    /// Number of elements.
    pub tets: usize,
    /// Worker threads.
    pub threads: usize,
    /// The machine.
    pub machine: Machine,
}

impl Setup {
    /// The organs of `model` on `threads` threads (0: all) of `machine`.
    pub fn new(model: &Model, threads: usize, machine: Machine) -> Self {
        let bodies = model.bodies();
        Self {
            organs: bodies.len(),
            nodes: bodies.iter().map(|b| b.len()).sum(),
            tets: bodies.iter().map(|b| b.tets().len()).sum(),
            threads: if threads == 0 { machine.cores } else { threads },
            machine,
        }
    }

    /// A text: sizes, threads and cores.
    pub fn described(&self) -> String {
        let (nodes, tets) = (count(self.nodes), count(self.tets));
        let machine = self.machine.described();
        format!("{} organs, {nodes} nodes, {tets} tets; {} threads on {machine}", self.organs, self.threads)
    }
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
