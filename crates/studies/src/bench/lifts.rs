//! The benchmarks of grasps and of the cell, as the command line runs them.

use super::cell::{CellBench, CellBenchResult};
use super::grasp::{GraspBench, GraspBenchResult, GraspPhaseTiming};
use crate::Result;
use crate::names::{AppendixChoice, DesignName, SceneChoice};
use crate::study::{Job, Kind, Study};
use clap::Args;
use std::path::PathBuf;
use trocar_report::document::{Document, Section, Table};
use trocar_report::table::{count, fixed, percent};

/// What contact with the gripper costs in a grasp-lift of all organs.
#[derive(Clone, Debug, Args)]
pub struct GraspCost {
    /// The specimen.
    #[command(flatten)]
    pub specimen: AppendixChoice,
    /// How the jaws hold.
    #[arg(long, value_enum, default_value_t = DesignName::LivePose)]
    pub design: DesignName,
    /// Force with which the jaws close [N].
    #[arg(long, default_value_t = trocar_cell::JAW_FORCE)]
    pub jaw_force: f64,
    /// Times that the pair of runs, with contact and without, is repeated.
    #[arg(long, default_value_t = 3)]
    pub repeats: usize,
    /// Worker threads; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

/// Speed of the whole two-arm cell, and what its parts cost.
#[derive(Clone, Debug, Args)]
pub struct CellSpeed {
    /// The scene.
    #[command(flatten)]
    pub scene: SceneChoice,
    /// A specimen folder instead of the scene's specimen.
    #[arg(long, value_name = "FOLDER")]
    pub specimen: Option<PathBuf>,
    /// Worker threads; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

impl Study for GraspCost {
    const NAME: &'static str = "grasp";
    const KIND: Kind = Kind::Bench;
    const FOLDER: Option<&'static str> =
        Some("Folder for the phantom's recording and specimen; a finished recording in it is used again.");
    const KEEPS_OWN_FILES: bool = true;
    type Figures = GraspBenchResult;

    fn run(&self, job: &Job<'_>) -> Result<(GraspBenchResult, Document)> {
        let bench = GraspBench {
            specimen: self.specimen.specimen.clone(),
            record: self.specimen.recorded.options(),
            design: self.design.into(),
            jaw_force: self.jaw_force,
            repeats: self.repeats,
            threads: self.threads,
        };
        let result = bench.run(job.output(), job.progress)?;
        let document = grasp(&result);
        Ok((result, document))
    }
}

impl Study for CellSpeed {
    const NAME: &'static str = "cell";
    const KIND: Kind = Kind::Bench;
    const FOLDER: Option<&'static str> = None;
    type Figures = CellBenchResult;

    fn run(&self, job: &Job<'_>) -> Result<(CellBenchResult, Document)> {
        let bench = CellBench {
            scene: self.scene.scene.clone(),
            specimen: self.specimen.clone(),
            phantoms: self.scene.phantoms.clone(),
            threads: self.threads,
        };
        let result = bench.run(job.progress)?;
        let document = cell(&result);
        Ok((result, document))
    }
}

fn grasp(r: &GraspBenchResult) -> Document {
    let head = [
        "Phase",
        "Frames",
        "Contact [ms]",
        "Same motion [ms]",
        "Off [mm]",
        "Nothing [ms]",
        "Iterations",
        "Worst [ms]",
        "Own share",
        "Contact's share",
    ];
    let row = |p: &GraspPhaseTiming| {
        let iterations = [p.with_contact_iterations, p.same_motion_iterations, p.without_contact_iterations];
        vec![
            p.phase.to_owned(),
            p.frames.to_string(),
            fixed(p.with_contact_ms, 2),
            fixed(p.same_motion_ms, 2),
            fixed(p.same_motion_off_mm, 4),
            fixed(p.without_contact_ms, 2),
            iterations.map(|n| fixed(n, 0)).join("/"),
            fixed(p.worst_ms, 2),
            percent(p.own_share, 1),
            percent(p.contact_share, 1),
        ]
    };
    let lines = [
        "Same motion: every frame again without contact but with its forces. Nothing: no contact, no forces."
            .to_owned(),
        format!(
            "{}x real time with contact, {}x without; {} grasp, {}; {} organs, {} nodes, {} tets; {} threads on {}",
            fixed(r.real_time_factor, 2),
            fixed(r.real_time_factor_without_contact, 2),
            r.design,
            if r.held { "held" } else { "NOT held" },
            r.organs,
            count(r.nodes),
            count(r.tets),
            r.threads,
            r.machine.described()
        ),
    ];
    Document::new("Grasp", "What contact with the gripper costs")
        .with(Section::new("Phases", "").table(Table::new(head, r.phases.iter().map(row).collect())).lines(lines))
}

fn cell(r: &CellBenchResult) -> Document {
    let head = [
        "",
        "times real time",
        "arms [ms]",
        "contact of organs [ms]",
        "tissue [ms]",
        "rest [ms]",
        "median [ms]",
        "worst [ms]",
    ];
    let times = [r.arms_ms, r.contact_ms, r.tissue_ms, r.rest_ms, r.median_ms, r.worst_ms].map(|ms| fixed(ms, 2));
    let rows = vec![
        ["whole cell".to_owned(), fixed(r.real_time_factor, 2)].into_iter().chain(times).collect(),
        vec!["without contact of organs".to_owned(), fixed(r.real_time_factor_without_organ_contact, 2)],
    ];
    let line = format!(
        "a control period lasts {} ms; {} periods, {} organs, {} nodes, {} tets; the lift {}; {} threads on {}",
        fixed(r.period_ms, 1),
        r.periods,
        r.organs,
        count(r.nodes),
        count(r.tets),
        if r.attached { "held" } else { "did NOT hold" },
        r.threads,
        r.machine.described()
    );
    Document::new("Cell", "Speed of the two-arm cell")
        .with(Section::new("Control periods", "").table(Table::new(head, rows)).lines([line]))
}
