//! Fig. 6(c): phantoms A, B and C released in the cell, and their speed after one second.

use crate::Result;
use crate::names::{Recorded, SolverName, phantoms_or_papers};
use crate::study::{Job, Kind, Study};
use clap::Args;
use serde::Serialize;
use trocar_cell::{FRAME, World};
use trocar_core::Progress;
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{count, fixed, percent};
use trocar_workflow::solver_named;
use trocar_workflow::{check_interrupted, phantoms};

/// Target: every specimen is below this speed (m/s)
const SETTLED_SPEED: f64 = 0.01;
/// after this time (s).
const AFTER: f64 = 1.0;

/// Simulated time (s).
const SECONDS: f64 = 1.5;

/// The paper's figures (section VII-C): phantom, speed after a second (m/s), share of fixed nodes.
const PAPER: [(&str, f64, f64); 3] =
    [("phantom-a", 0.007, 0.416), ("phantom-b", 0.136, 0.211), ("phantom-c", 0.029, 0.066)];

/// Fig. 6(c): how fast phantoms A, B and C come to rest in the cell.
#[derive(Clone, Debug, Args)]
pub struct SettlingExperiment {
    /// Phantoms; phantom-a, phantom-b and phantom-c by default.
    #[arg(long = "phantom")]
    pub phantoms: Vec<String>,
    /// The solver.
    #[arg(long, value_enum, default_value_t = SolverName::Fast)]
    pub schedule: SolverName,
    /// Worker threads; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// How they are recorded.
    #[command(flatten)]
    pub recorded: Recorded,
}

/// Figures of one organ.
#[derive(Clone, Debug, Serialize)]
pub struct SettlingOrgan {
    /// Name.
    pub organ: String,
    /// Share of pinned nodes.
    pub pinned: f64,
    /// Largest node speed in any frame (m/s).
    pub peak_speed_m_s: f64,
    /// Largest node speed after a second (m/s).
    pub speed_m_s: f64,
}

/// Figures of one phantom.
#[derive(Clone, Debug, Serialize)]
pub struct SettlingRow {
    /// Name.
    pub phantom: String,
    /// Number of nodes.
    pub nodes: usize,
    /// Number of elements.
    pub tets: usize,
    /// Share of pinned nodes.
    pub pinned: f64,
    /// Share of pinned nodes in the paper.
    pub paper_pinned: Option<f64>,
    /// Largest node speed in any frame (m/s).
    pub peak_speed_m_s: f64,
    /// Largest node speed after a second (m/s).
    pub speed_m_s: f64,
    /// The same in the paper (m/s).
    pub paper_speed_m_s: Option<f64>,
    /// Whether the speed is below 0.01 m/s from one second on.
    pub settled: bool,
    /// Time after which the speed stays below 0.01 m/s (s).
    pub settled_after_s: Option<f64>,
    /// Why it ended early, if it did.
    pub event: Option<String>,
    /// Organs.
    pub organs: Vec<SettlingOrgan>,
    /// Time (s) and largest node speed (m/s) of each frame.
    pub speeds: Vec<(f64, f64)>,
}

/// Figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct SettlingResult {
    /// All phantoms.
    pub phantoms: Vec<SettlingRow>,
    /// Name of the schedule.
    pub schedule: String,
}

impl Study for SettlingExperiment {
    const NAME: &'static str = "settling";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> =
        Some("Output folder of recordings, specimens and report. Finished recordings in it are used again.");
    type Figures = SettlingResult;

    fn run(&self, job: &Job<'_>) -> Result<(SettlingResult, Document)> {
        let schedule = solver_named(self.schedule.name())?;
        job.claim()?;
        let named = phantoms_or_papers(&self.phantoms);
        let mut rows = Vec::with_capacity(named.len());
        for phantom in &named {
            let specimen = phantoms::specimen(
                phantom,
                &self.recorded.options(),
                None,
                &job.output().join(phantom),
                phantoms::AfterUse::Keep,
                job.progress,
            )?;
            rows.push(released(phantom, World::new(&specimen, schedule, self.threads)?, job.progress)?);
        }
        let result = SettlingResult { phantoms: rows, schedule: self.schedule.name().to_owned() };
        let document = document(&result)?;
        Ok((result, document))
    }
}

fn released(phantom: &str, mut world: World, progress: &dyn Progress) -> Result<SettlingRow> {
    let frames = (SECONDS / FRAME).round() as usize;
    let after = (AFTER / FRAME).round() as usize;
    let share = |pinned: &[bool]| pinned.iter().filter(|p| **p).count() as f64 / pinned.len() as f64;
    let mut organs: Vec<SettlingOrgan> = world
        .model
        .bodies()
        .iter()
        .map(|b| SettlingOrgan {
            organ: b.name().to_owned(),
            pinned: share(b.pinned()),
            peak_speed_m_s: 0.0,
            speed_m_s: f64::NAN,
        })
        .collect();
    let (mut speeds, mut event) = (Vec::with_capacity(frames), None);
    progress.begin(phantom, frames as u64);
    for frame in 1..=frames {
        check_interrupted(progress)?;
        let report = world.step(&[]);
        progress.advance(1);
        speeds.push((frame as f64 * FRAME, report.max_speed));
        for (b, organ) in organs.iter_mut().enumerate() {
            let nodes = 0..world.model.bodies()[b].len();
            let speed = nodes.map(|i| world.state.velocity(&world.model, b, i).length()).fold(0.0, f64::max);
            organ.peak_speed_m_s = organ.peak_speed_m_s.max(speed);
            if frame == after {
                organ.speed_m_s = speed;
            }
        }
        if let Some(divergence) = report.divergence {
            event = Some(divergence.to_string());
            break;
        }
    }
    progress.end();
    let fast = speeds.iter().rposition(|s| s.1 >= SETTLED_SPEED);
    let settled_after_s = match fast {
        _ if event.is_some() => None,
        None => Some(0.0),
        Some(last) => speeds.get(last + 1).map(|s| s.0),
    };
    let paper = PAPER.iter().find(|p| p.0 == phantom);
    let bodies = &world.model.bodies();
    let pinned: Vec<bool> = bodies.iter().flat_map(|b| b.pinned().iter().copied()).collect();
    Ok(SettlingRow {
        phantom: phantom.to_owned(),
        nodes: pinned.len(),
        tets: bodies.iter().map(|b| b.tets().len()).sum(),
        pinned: share(&pinned),
        paper_pinned: paper.map(|p| p.2),
        peak_speed_m_s: speeds.iter().map(|s| s.1).fold(0.0, f64::max),
        speed_m_s: speeds.get(after - 1).map_or(f64::NAN, |s| s.1),
        paper_speed_m_s: paper.map(|p| p.1),
        settled: settled_after_s.is_some_and(|s| s <= AFTER + 0.5 * FRAME),
        settled_after_s,
        event,
        organs,
        speeds,
    })
}

fn document(result: &SettlingResult) -> Result<Document> {
    let lead = format!(
        "Each phantom is recorded, reconstructed and released in the cell in its recorded shape (schedule {}). \
         The plot shows the largest node speed at the end of each frame. The dashed \
         line is {SETTLED_SPEED} m/s, the target after a second.",
        page::escape(&result.schedule)
    );
    let line = |(k, speeds): (usize, &Vec<(f64, f64)>)| Line::new(speeds.clone(), colors::organ(k));
    let plot = Plot {
        title: "Largest node speed",
        x: "time since release (s)",
        y: "speed (m/s)",
        lines: result.phantoms.iter().map(|p| &p.speeds).enumerate().map(line).collect(),
        limits: vec![SETTLED_SPEED],
        log_y: true,
        ..Plot::default()
    };
    let legend = page::legend(result.phantoms.iter().enumerate().map(|(k, p)| (p.phantom.as_str(), colors::organ(k))));
    let settled = result.phantoms.iter().filter(|p| p.settled).count();
    let card = Card::new(
        "Settled within a second",
        format!("{settled} of {}", result.phantoms.len()),
        "below 0.01 m/s; paper one of three",
    );
    let section = Section::new("Settling", lead)
        .cards([card.met(settled == result.phantoms.len())])
        .plot(&plot, &format!("<b>Fig. 6(c).</b>{legend}"))?;
    Ok(Document::new("Settling", "Phantoms released in the cell")
        .with(section)
        .with(beside_paper(result))
        .with(organs(result)))
}

fn beside_paper(result: &SettlingResult) -> Section {
    let settled =
        |p: &SettlingRow| p.settled_after_s.map_or("not within 1.5 s".to_owned(), |s| format!("{} s", fixed(s, 2)));
    let table = Table::of(
        &result.phantoms,
        &[
            ("Phantom", &|p| p.phantom.clone()),
            ("Nodes", &|p| count(p.nodes)),
            ("Tetrahedra", &|p| count(p.tets)),
            ("Pinned", &|p| percent(p.pinned, 1)),
            ("(paper)", &|p| p.paper_pinned.map_or(String::new(), |s| percent(s, 1))),
            ("Peak (m/s)", &|p| fixed(p.peak_speed_m_s, 3)),
            ("After 1 s (m/s)", &|p| fixed(p.speed_m_s, 4)),
            ("(paper)", &|p| p.paper_speed_m_s.map_or(String::new(), |s| fixed(s, 3))),
            ("Settled after", &|p| settled(p)),
            ("Event", &|p| p.event.clone().unwrap_or_default()),
        ],
    );
    Section::new("Beside the paper", "").table(table)
}

fn organs(result: &SettlingResult) -> Section {
    let table = Table::of(
        result.phantoms.iter().flat_map(|p| p.organs.iter().map(move |o| (p, o))),
        &[
            ("Organ", &|(_, o)| o.organ.clone()),
            ("Phantom", &|(p, _)| p.phantom.clone()),
            ("Pinned", &|(_, o)| percent(o.pinned, 1)),
            ("Peak (m/s)", &|(_, o)| fixed(o.peak_speed_m_s, 3)),
            ("After 1 s (m/s)", &|(_, o)| fixed(o.speed_m_s, 4)),
        ],
    );
    Section::new("Organs", "").table(table.on_page_only())
}
