//! Fig. 6(c): phantoms A, B and C released into the cell; how fast they still move after a second.

use crate::{Error, Result, pages};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;
use trocar_cell::{FRAME, World};
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_workflow::REPORT;
use trocar_workflow::phantoms;
use trocar_workflow::solver_named;

/// The file that makes a folder one of this experiment's.
const MARKER: &str = "settling.json";

/// Speed under which every specimen must be ... [m/s]
pub(crate) const SETTLED: f64 = 0.01;
/// ... after this long [s].
const AFTER: f64 = 1.0;

/// How long is simulated [s].
const SECONDS: f64 = 1.5;

/// What the paper says (section VII-C): phantom, speed after a second [m/s], share of the nodes that are fixed.
const PAPER: [(&str, f64, f64); 3] =
    [("phantom-a", 0.007, 0.416), ("phantom-b", 0.136, 0.211), ("phantom-c", 0.029, 0.066)];

/// The experiment's options.
#[derive(Clone, Debug)]
pub struct SettlingExperiment {
    /// Which phantoms.
    pub phantoms: Vec<String>,
    /// How they are filmed.
    pub record: RecordOptions,
    /// Name of the schedule, one of [`trocar_workflow::SOLVERS`].
    pub schedule: String,
    /// Worker threads, 0 for all.
    pub threads: usize,
}

/// One organ after a second.
#[derive(Clone, Debug, Serialize)]
pub struct SettlingOrgan {
    /// Its name.
    pub organ: String,
    /// Share of its nodes that are pinned.
    pub pinned: f64,
    /// Its greatest node speed in any frame [m/s].
    pub peak_speed_m_s: f64,
    /// Its greatest node speed after a second [m/s].
    pub speed_m_s: f64,
}

/// One phantom.
#[derive(Clone, Debug, Serialize)]
pub struct SettlingRow {
    /// Its name.
    pub phantom: String,
    /// Nodes.
    pub nodes: usize,
    /// Elements.
    pub tets: usize,
    /// Share of the nodes that are pinned.
    pub pinned: f64,
    /// The paper's share.
    pub paper_pinned: Option<f64>,
    /// Greatest node speed in any frame [m/s].
    pub peak_speed_m_s: f64,
    /// Greatest node speed after a second [m/s].
    pub speed_m_s: f64,
    /// The paper's [m/s].
    pub paper_speed_m_s: Option<f64>,
    /// Below 0.01 m/s after a second, and from then on.
    pub settled: bool,
    /// When it came below 0.01 m/s for good [s].
    pub settled_after_s: Option<f64>,
    /// What ended it, if anything did.
    pub event: Option<String>,
    /// Its organs.
    pub organs: Vec<SettlingOrgan>,
    /// Time [s] and greatest node speed [m/s], frame by frame.
    pub speeds: Vec<(f64, f64)>,
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct SettlingResult {
    /// Every phantom.
    pub phantoms: Vec<SettlingRow>,
    /// The schedule's name.
    pub schedule: String,
    /// Wall time of everything [s].
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}

impl SettlingExperiment {
    /// Runs everything into the folder `output`: `<phantom>/recording`, `<phantom>/specimen`, and the report.
    ///
    /// # Errors
    /// A phantom or schedule of another name, a folder that cannot be written, an interruption.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<SettlingResult> {
        let clock = Instant::now();
        let schedule = solver_named(&self.schedule)?;
        super::claim(output, MARKER)?;
        let mut rows = Vec::with_capacity(self.phantoms.len());
        for phantom in &self.phantoms {
            let specimen = phantoms::specimen(phantom, &self.record, &output.join(phantom), progress)?;
            rows.push(released(phantom, World::new(&specimen, schedule, self.threads)?, progress)?);
        }
        let result = SettlingResult {
            phantoms: rows,
            schedule: self.schedule.clone(),
            seconds: clock.elapsed().as_secs_f64(),
            report: output.join(REPORT).display().to_string(),
        };
        super::write(&output.join(REPORT), pages::settling(&result)?.as_bytes())?;
        let json = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        super::write(&output.join(MARKER), &json)?;
        Ok(result)
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
        if progress.interrupted() {
            return Err(Error::Interrupted);
        }
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
    let fast = speeds.iter().rposition(|s| s.1 >= SETTLED);
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
