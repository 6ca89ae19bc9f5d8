//! Rollouts of the six controllers on both tissue backends, and on lattices of several sizes of
//! cells: whether another physics judges policies alike.

use super::rollouts::campaign;
use crate::names::SceneChoice;
use crate::study::{Job, Kind, Study};
use crate::{Error, Result};
use clap::Args;
use serde::Serialize;
use trocar_campaign::{BackendsResult, Campaign, CampaignResult};
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::Card;
use trocar_report::table::{count, fixed, or_dash};
use trocar_scene::BackendName;

/// Rollouts of the six controllers on both tissue backends, on the same seeds, and on lattices of
/// several sizes of cells: whether they rank policies alike; resumable.
#[derive(Clone, Debug, Args)]
pub struct BackendsExperiment {
    /// The scene.
    #[command(flatten)]
    pub scene: SceneChoice,
    /// Rollouts of all six controllers together, on each backend.
    #[arg(long, default_value_t = 140)]
    pub rollouts: usize,
    /// Edges of the cells of further lattices (mm), separated by commas.
    #[arg(long, value_name = "MM", value_delimiter = ',', default_values_t = [3.0, 4.0, 6.0])]
    pub cells: Vec<f64>,
    /// Rollouts of all six controllers together, on each of these lattices.
    #[arg(long, value_name = "ROLLOUTS", default_value_t = 24)]
    pub cell_rollouts: usize,
    /// Seed of the first rollout of each controller; each further rollout has the next seed.
    #[arg(long, default_value_t = 1000)]
    pub seed: u64,
    /// Rollouts in parallel; as many as the machine has cores by default. The result does not
    /// depend on it.
    #[arg(long, default_value_t = 0)]
    pub jobs: usize,
}

/// The rollouts on a lattice.
#[derive(Clone, Debug, Serialize)]
pub struct CellRow {
    /// Edge of the lattice's cells (mm).
    pub cell_mm: f64,
    /// Finished rollouts.
    pub rollouts: usize,
    /// Rollouts that attached the organ of the task.
    pub attached: usize,
    /// Of these, those that held it to the end.
    pub held_to_end: usize,
    /// Rollouts that passed all stages.
    pub passed: usize,
    /// The same of each controller, with its name.
    pub passed_by_policy: Vec<(String, usize)>,
    /// Rollouts that diverged.
    pub diverged: usize,
    /// Largest number of inverted cells in any frame.
    pub inverted_peak: usize,
}

/// Figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct BackendsFigures {
    /// Kendall's tau-b of the controllers' ranks by mean score on both backends; none if a backend
    /// gives all controllers one score.
    pub kendall_tau: Option<f64>,
    /// Its 95% interval, by drawing seeds anew.
    pub kendall_interval: Option<[f64; 2]>,
    /// Pearson's correlation of the controllers' mean scores.
    pub pearson: Option<f64>,
    /// The largest difference of two controllers' mean scores on tetrahedra that the lattice ranks
    /// the other way round.
    pub max_rank_violation: f64,
    /// The campaigns on both backends.
    pub both: BackendsResult,
    /// The lattices.
    pub cells: Vec<CellRow>,
}

impl Study for BackendsExperiment {
    const NAME: &'static str = "backends";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> =
        Some("Output folder of campaigns and report. Finished rollouts in it are used again.");
    type Figures = BackendsFigures;

    fn run(&self, job: &Job<'_>) -> Result<(BackendsFigures, Document)> {
        for (option, rollouts) in [("rollouts", self.rollouts), ("cell-rollouts", self.cell_rollouts)] {
            if rollouts == 0 {
                return Err(Error::Mismatch(format!("--{option} 0: must be at least 1")));
            }
        }
        if let Some(twice) = (1..self.cells.len()).find(|k| self.cells[..*k].contains(&self.cells[*k])) {
            return Err(Error::Mismatch(format!("--cells: {} is given twice", self.cells[twice])));
        }
        job.claim()?;
        let campaign = campaign(&self.scene, self.rollouts, self.seed, self.jobs)?;
        let output = job.output().join("both");
        let both = campaign.run_on(&BackendName::ALL, Some(self.rollouts), &output, job.progress)?;
        let cells = self.cells.iter().map(|cell| self.on_lattice(*cell, job)).collect::<Result<_>>()?;
        let Some(agreement) = both.agreements.first() else {
            return Err(Error::Mismatch("no rollout ran on both backends".to_owned()));
        };
        let figures = BackendsFigures {
            kendall_tau: agreement.kendall_tau,
            kendall_interval: agreement.kendall_interval,
            pearson: agreement.pearson,
            max_rank_violation: agreement.max_rank_violation,
            cells,
            both,
        };
        let document = document(&figures);
        Ok((figures, document))
    }
}

impl BackendsExperiment {
    fn on_lattice(&self, cell_mm: f64, job: &Job<'_>) -> Result<CellRow> {
        let campaign = Campaign {
            backend: Some(BackendName::Lattice),
            cell_mm: Some(cell_mm),
            ..campaign(&self.scene, self.cell_rollouts, self.seed, self.jobs)?
        };
        let output = job.output().join(format!("lattice-{cell_mm}-mm"));
        let (store, manifest, by) = campaign.run_episodes(&output, Some(self.cell_rollouts), job.progress)?;
        Ok(CellRow::of(cell_mm, &store.write_results(&manifest, &by)?))
    }
}

impl CellRow {
    fn of(cell_mm: f64, made: &CampaignResult) -> Self {
        let policies = &made.policies;
        Self {
            cell_mm,
            rollouts: made.episodes,
            attached: policies.iter().map(|p| p.attached).sum(),
            held_to_end: policies.iter().map(|p| p.held_to_end).sum(),
            passed: made.passed,
            passed_by_policy: policies.iter().map(|p| (p.policy.clone(), p.passed)).collect(),
            diverged: policies.iter().map(|p| p.ends.diverged).sum(),
            inverted_peak: policies.iter().map(|p| p.inverted_peak).max().unwrap_or(0),
        }
    }
}

fn document(figures: &BackendsFigures) -> Document {
    let diverged = figures.both.backends.iter().flat_map(|of| &of.result.policies).map(|p| p.ends.diverged);
    let diverged: usize = diverged.sum::<usize>() + figures.cells.iter().map(|row| row.diverged).sum::<usize>();
    let interval = figures.kendall_interval.map_or_else(
        || "of the mean scores".to_owned(),
        |[low, high]| format!("of the mean scores; 95%: {} to {}", fixed(low, 2), fixed(high, 2)),
    );
    let cards = [
        Card::new("Kendall\u{2019}s tau", or_dash(figures.kendall_tau, 2), interval),
        Card::new("Largest rank violation", fixed(figures.max_rank_violation, 2), "of scores between 0 and 1"),
        Card::new("Diverged", count(diverged), "of all rollouts").met(diverged == 0),
    ];
    let lead = "The same seeds on both backends. Controllers are ranked by mean score. A rank violation is the \
                difference of two scores on tetrahedra that the lattice ranks the other way round.";
    let agreement = Section::new("Agreement", lead).cards(cards).table(figures.both.agreement());
    let controllers = Section::new("Controllers", "").table(figures.both.policies());
    let differ = "Seeds on which a controller passed on one backend alone; p: McNemar\u{2019}s exact test.";
    let differences = Section::new("Where they differ", differ).table(figures.both.differences());
    let mut document = Document::new("Two tissue backends", "Whether tetrahedra and lattice judge controllers alike")
        .with(agreement)
        .with(controllers)
        .with(differences);
    if !figures.cells.is_empty() {
        let lead = "The first seeds again, on lattices whose cells have other edges.";
        document = document.with(Section::new("Sizes of cells", lead).table(sizes(&figures.cells)));
    }
    document
}

fn sizes(rows: &[CellRow]) -> Table {
    let by_policy = |row: &CellRow| {
        row.passed_by_policy.iter().map(|(name, passed)| format!("{name} {passed}")).collect::<Vec<_>>().join(", ")
    };
    Table::of(
        rows,
        &[
            ("Cell (mm)", &|row| row.cell_mm.to_string()),
            ("Rollouts", &|row| count(row.rollouts)),
            ("Attached", &|row| count(row.attached)),
            ("Held", &|row| format!("{} of {}", row.held_to_end, row.attached)),
            ("Passed", &|row| count(row.passed)),
            ("Passed, by controller", &|row| by_policy(row)),
            ("Diverged", &|row| count(row.diverged)),
            ("Inverted", &|row| count(row.inverted_peak)),
        ],
    )
}
