//! The machine on which a study runs.

use serde::Serialize;
use trocar_report::table::count;
use trocar_tissue::{Isa, Model};

/// The machine.
#[derive(Clone, Debug, Serialize)]
pub struct Machine {
    /// Logical cores.
    pub cores: usize,
    /// The processor, by the name that the system gives it. Linux on x86 gives one.
    pub processor: Option<String>,
    /// The instruction set of the tissue's kernels.
    pub isa: &'static str,
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
            processor: std::fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| processor_in(&text)),
            isa: Isa::detect().name(),
            load: load.and_then(|text| text.split(' ').next().and_then(|word| word.parse().ok())),
        }
    }

    /// A text: cores, processor and instruction set.
    pub fn name(&self) -> String {
        let processor = self.processor.as_ref().map_or(String::new(), |name| format!("{name}, "));
        format!("{} cores ({processor}{})", self.cores, self.isa)
    }

    /// The same text, and the load if known.
    pub fn described(&self) -> String {
        let load = self.load.map_or(String::new(), |l| format!(", load {l:.1} at the start"));
        self.name() + &load
    }
}

/// The first processor's name in the text of `/proc/cpuinfo`.
fn processor_in(text: &str) -> Option<String> {
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'))?.1;
    Some(name.split_whitespace().collect::<Vec<_>>().join(" ")).filter(|name| !name.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_a_processor_is_found() {
        let text = "processor\t: 0\nmodel\t\t: 2\nmodel name\t: Intel(R)  Xeon(R) CPU @ 2.50GHz\n";
        assert_eq!(processor_in(text).unwrap(), "Intel(R) Xeon(R) CPU @ 2.50GHz");
        assert_eq!(processor_in("processor\t: 0\nBogoMIPS\t: 50.00\n"), None);
    }
}
