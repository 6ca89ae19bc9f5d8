//! The studies of lifts of the appendix, as the command line runs them: Table II and Fig. 7(f).

use super::element_quality::{ElementQualityExperiment, ElementQualityResult, ElementQualityRow};
use super::grasp_designs::{GraspDesignRow, GraspDesignsExperiment, GraspDesignsResult};
use super::lift_trials::{AppendixSource, Condition};
use super::trials::resumed;
use crate::Result;
use crate::names::{AppendixChoice, millimetres};
use crate::study::{Job, Kind, Study};
use clap::{Args, ValueEnum};
use trocar_report::document::{Document, Section, Table};
use trocar_report::table::{count, fixed};

/// In what the appendix is lifted.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum ConditionName {
    /// In the whole cell: organs touch each other, and a dynamic arm works through its port.
    Cell,
    /// The appendix alone, lifted by an ideal arm without a port.
    Appendix,
    /// Both, one after the other.
    Both,
}

impl ConditionName {
    fn conditions(self) -> Vec<Condition> {
        match self {
            Self::Cell => vec![Condition::Cell],
            Self::Appendix => vec![Condition::Appendix],
            Self::Both => vec![Condition::Cell, Condition::Appendix],
        }
    }
}

/// Table II and Fig. 7(a) to (c): four ways to hold the appendix, at five places and from three sides, and again after a drag.
#[derive(Clone, Debug, Args)]
pub struct GraspDesigns {
    /// The appendix.
    #[command(flatten)]
    pub appendix: AppendixChoice,
    /// In what the appendix is lifted: the whole cell, alone, or both.
    #[arg(long, value_enum, default_value_t = ConditionName::Both)]
    pub condition: ConditionName,
    /// Lift of the jaws (mm).
    #[arg(long, default_value = "15", value_parser = millimetres)]
    pub lift: f64,
    /// Force with which the jaws close [N].
    #[arg(long, default_value_t = trocar_cell::JAW_FORCE)]
    pub jaw_force: f64,
    /// Trials at once; as many as the machine has threads by default. The figures do not depend on it.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

/// Fig. 7(f): whether elements invert when the appendix is lifted 15 and 30 mm, at five moduli and with two pin rules.
#[derive(Clone, Debug, Args)]
pub struct ElementQuality {
    /// The appendix.
    #[command(flatten)]
    pub appendix: AppendixChoice,
    /// In what the appendix is lifted: the whole cell, alone, or both.
    #[arg(long, value_enum, default_value_t = ConditionName::Both)]
    pub condition: ConditionName,
    /// Force with which the jaws close (N), the same for all moduli.
    #[arg(long, default_value_t = trocar_cell::JAW_FORCE)]
    pub jaw_force: f64,
    /// Run all cases a second time with a jaw force in proportion to the modulus (--jaw-force at 12 kPa), so that
    /// tissue of every modulus is squeezed alike: a second table.
    #[arg(long)]
    pub scaled_force: bool,
    /// Cases at once; as many as the machine has threads by default. The figures do not depend on it.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

/// Help of `--output` of both.
const FOLDER: &str = "Folder for recording, specimen, trials and report. A finished recording in it is used again, and so are \
                      finished trials of the same settings: an interrupted run resumes where it stopped.";

impl Study for GraspDesigns {
    const NAME: &'static str = "grasp-designs";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> = Some(FOLDER);
    const KEEPS_OWN_FILES: bool = true;
    type Figures = GraspDesignsResult;

    fn run(&self, job: &Job<'_>) -> Result<(GraspDesignsResult, Document)> {
        let experiment = GraspDesignsExperiment {
            appendix: AppendixSource {
                specimen: self.appendix.specimen.clone(),
                record: self.appendix.recorded.options(),
            },
            conditions: self.condition.conditions(),
            lift: self.lift,
            jaw_force: self.jaw_force,
            threads: self.threads,
        };
        let result = experiment.run(job.output(), job.progress)?;
        let document = designs(&result);
        Ok((result, document))
    }
}

impl Study for ElementQuality {
    const NAME: &'static str = "element-quality";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> = Some(FOLDER);
    const KEEPS_OWN_FILES: bool = true;
    type Figures = ElementQualityResult;

    fn run(&self, job: &Job<'_>) -> Result<(ElementQualityResult, Document)> {
        let experiment = ElementQualityExperiment {
            appendix: AppendixSource {
                specimen: self.appendix.specimen.clone(),
                record: self.appendix.recorded.options(),
            },
            conditions: self.condition.conditions(),
            jaw_force: self.jaw_force,
            scaled: self.scaled_force,
            threads: self.threads,
        };
        let result = experiment.run(job.output(), job.progress)?;
        let document = quality(&result);
        Ok((result, document))
    }
}

fn designs(r: &GraspDesignsResult) -> Document {
    let head = [
        "Condition",
        "Design",
        "Held",
        "Diverged",
        "Lift [mm]",
        "Slip [mm]",
        "Snap [mm]",
        "Step [mm]",
        "Inverted",
        "Least volume",
        "Suspensions",
    ];
    let range = |ends: Option<(f64, f64)>| match ends {
        None => "\u{2013}".to_owned(),
        Some((least, most)) if most - least < 0.05 => fixed(most, 2),
        Some((least, most)) => format!("{} to {}", fixed(least, 1), fixed(most, 1)),
    };
    let ours = |row: &GraspDesignRow| {
        vec![
            row.condition.name().to_owned(),
            row.design.clone(),
            format!("{}/{}", row.held, row.trials),
            row.diverged.to_string(),
            fixed(row.lift_median_mm, 2),
            fixed(row.slip_median_mm, 3),
            range(row.snap_least_mm.zip(row.snap_mm)),
            fixed(row.activation_step_median_mm, 3),
            row.inverted_peak.to_string(),
            fixed(row.min_volume_ratio, 2),
            suspensions(row.suspensions),
        ]
    };
    let paper = |row: &GraspDesignRow| {
        row.paper.map(|p| {
            let cells = [
                "(paper)".to_owned(),
                row.design.clone(),
                format!("{}/{}", p.held, p.trials),
                p.diverged.to_string(),
                fixed(p.lift_mm, 1),
                fixed(p.slip_mm, 2),
                range(p.snap_mm),
            ];
            let empty = head.len() - cells.len();
            cells.into_iter().chain(std::iter::repeat_n(String::new(), empty)).collect::<Vec<_>>()
        })
    };
    let rows = r.rows.iter().flat_map(|row| std::iter::once(ours(row)).chain(paper(row))).collect();
    let what = format!(
        "the appendix: {} nodes, {} tets, {} kPa, {} kg/m3; {} mm lift, jaws of {} N",
        count(r.nodes),
        count(r.tets),
        r.modulus_kpa,
        r.density_kg_m3,
        r.lift_mm,
        r.jaw_force_n
    );
    let meaning = "Medians, as the paper's. Snap: what the grasp prescribes, zero by construction for live-pose and \
                   compliant. Step: what moves in the grasp's first frame. Suspensions: contacts disabled / contacts of \
                   blades disabled / organs relaxed.";
    let lines = [meaning.to_owned(), what].into_iter().chain(resumed(&r.resumed, "trials"));
    Document::new("Grasp designs", "Four ways to hold the appendix")
        .with(Section::new("Table II", "").table(Table::new(head, rows)).lines(lines))
}

fn suspensions([contacts, blades, relaxed]: [usize; 3]) -> String {
    format!("{contacts}/{blades}/{relaxed}")
}

fn quality(r: &ElementQualityResult) -> Document {
    let head = [
        "Condition",
        "Design",
        "Pins",
        "Lift [mm]",
        "E [kPa]",
        "Jaws [N]",
        "Inverted",
        "Diverged",
        "Least volume",
        "Yielded",
        "Follows",
        "Slip [mm]",
        "Step [mm]",
        "Pull [N]",
        "Held",
        "Suspensions",
        "Note",
    ];
    let yes = |b: bool| if b { "yes" } else { "no" }.to_owned();
    let row = |row: &ElementQualityRow| {
        vec![
            row.condition.name().to_owned(),
            row.design.clone(),
            row.pins.clone(),
            fixed(row.lift_mm, 0),
            fixed(row.modulus_kpa, 0),
            fixed(row.jaw_force_n, 2),
            row.inverted_peak.to_string(),
            yes(row.diverged),
            fixed(row.min_volume_ratio, 3),
            row.yielded_substeps.to_string(),
            fixed(row.follow_ratio, 3),
            fixed(row.slip_mm, 2),
            fixed(row.activation_step_mm, 2),
            fixed(row.peak_constraint_n, 2),
            yes(row.held),
            suspensions(row.suspensions),
            row.why.clone().unwrap_or_default(),
        ]
    };
    let table = |scaled: bool| {
        let rows: Vec<Vec<String>> = r.rows.iter().filter(|c| c.scaled == scaled).map(row).collect();
        (!rows.is_empty()).then(|| Table::new(head, rows))
    };
    let what = format!("the appendix: {} nodes, {} tets; jaws of {} N", count(r.nodes), count(r.tets), r.jaw_force_n);
    let lines = std::iter::once(what).chain(resumed(&r.resumed, "cases"));
    let scaled = table(true).map(|t| Section::new("Jaw force in proportion to the modulus", "").table(t));
    Document::new("Element quality", "Lifts of the appendix against its pins")
        .with_all(table(false).map(|t| Section::new("Fig. 7(f)", "").table(t)))
        .with_all(scaled)
        .with(Section::new("Settings", "").lines(lines))
}
