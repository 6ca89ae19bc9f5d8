//! What the grasp experiments share: the appendix of a specimen alone in the cell, and trials of it side by side.

use crate::{Error, Result};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_specimen::{Organ, Specimen};
use trocar_workflow::phantoms;
use xxhash_rust::xxh3::Xxh3;

/// Where the appendix comes from.
#[derive(Clone, Debug)]
pub struct AppendixSource {
    /// A specimen folder; phantom A, recorded and reconstructed, when `None`.
    pub specimen: Option<PathBuf>,
    /// How the phantom is filmed.
    pub record: RecordOptions,
}

impl AppendixSource {
    /// The specimen without its other organs; they do not touch the appendix in the cell, where no two organs collide, and only cost time.
    pub(super) fn appendix(&self, output: &Path, progress: &dyn Progress) -> Result<Specimen> {
        let mut specimen = match &self.specimen {
            Some(folder) => Specimen::read(folder)?,
            None => phantoms::specimen("phantom-a", &self.record, &output.join("phantom-a"), progress)?,
        };
        let names = || specimen.organs.iter().map(|o| o.name.as_str()).collect::<Vec<_>>().join(", ");
        let Some(at) = specimen.organs.iter().position(|o| o.name == "appendix") else {
            return Err(Error::Mismatch(format!("the specimen has no organ 'appendix'; it has {}", names())));
        };
        specimen.organs = vec![specimen.organs.swap_remove(at)];
        Ok(specimen)
    }
}

/// The one organ of such a specimen, to be changed.
pub(super) fn with_organ(specimen: &Specimen, change: impl Fn(&mut Organ)) -> Specimen {
    let mut changed = specimen.clone();
    changed.organs.iter_mut().for_each(change);
    changed
}

/// Everything of a specimen that a trial depends on, in a few words.
pub(super) fn fingerprint(specimen: &Specimen) -> String {
    let mut hasher = Xxh3::new();
    let mut number = |value: f64| hasher.update(&value.to_bits().to_le_bytes());
    for organ in &specimen.organs {
        organ.body.vertices.iter().flat_map(|p| p.to_array()).for_each(&mut number);
        organ.body.tets.iter().flatten().for_each(|i| number(f64::from(*i)));
    }
    let organ = |o: &Organ| format!("{} {:?} {:?} {:?}", o.name, o.material, o.pins, o.base);
    let organs: Vec<String> = specimen.organs.iter().map(organ).collect();
    format!("{:016x} {:?} {}", hasher.digest(), specimen.up, organs.join("; "))
}

/// Does `run` for every item, several at once on `threads` threads (0: all there are), after `finished` others; the outcomes are in the items' order.
pub(super) fn side_by_side<T: Sync, R: Send>(
    stage: &str,
    items: &[T],
    (finished, threads): (usize, usize),
    progress: &dyn Progress,
    run: impl Fn(&T, &dyn Progress) -> Result<R> + Sync,
) -> Result<Vec<R>> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| Error::Mismatch(format!("{threads} threads cannot be started: {e}")))?;
    progress.begin(stage, (finished + items.len()) as u64);
    progress.advance(finished as u64);
    let quiet = Quiet(progress);
    let outcomes = pool.install(|| {
        let each = items.par_iter().with_max_len(1).map(|item| {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
            let outcome = run(item, &quiet);
            progress.advance(1);
            outcome
        });
        each.collect()
    });
    progress.end();
    outcomes
}

/// Lets a trial know that it is to stop and hears nothing of it: trials run at once.
struct Quiet<'a>(&'a dyn Progress);

impl Progress for Quiet<'_> {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _units: u64) {}
    fn end(&self) {}
    fn interrupted(&self) -> bool {
        self.0.interrupted()
    }
}
