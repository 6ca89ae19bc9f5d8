//! Fig. 6(b): which integrators stay bounded when organs are released under gravity, and how far
//! each is from the equilibrium.

mod forms;
mod row;

use crate::names::Recorded;
use crate::scenes::{BenchScene, FRAME, Organs, material, mean_error, reference, rest_positions};
use crate::study::{Job, Kind, Study};
use crate::{Error, Result};
use clap::Args;
use forms::{Form, findings, forms};
use glam::DVec3;
use row::IntegratorRow;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;
use trocar_cell::{Surroundings, World};
use trocar_core::Progress;
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{count, fixed, percent};
use trocar_specimen::Specimen;
use trocar_tissue::{BodyContact, Model, SolverSettings, State};
use trocar_tissue_reference::{Oracle, OracleState, stable_explicit_step};
use trocar_workflow::{check_interrupted, phantoms};

/// Node speed that counts as divergence (m/s): the limit of the paper.
const SPEED_LIMIT: f64 = 20.0;

/// Share of the run, at its end, over which positions are averaged before the comparison with the
/// equilibrium. Undamped tissue oscillates around it.
const AVERAGED_SHARE: f64 = 1.0 / 3.0;

/// Viscosity over Young's modulus (s). It is lower than in the cell, where the explicit integrators
/// would need shorter steps than for the elasticity.
const LIGHT_DAMPING: f64 = 0.02 / 15.0;

/// Young's modulus (Pa) and Poisson's ratio of organs from a file.
const TISSUE: (f64, f64) = (12e3, 0.45);

/// Fig. 6(b): which integrators stay bounded when organs are released, and the sag error of each.
#[derive(Clone, Debug, Args)]
pub struct IntegratorsExperiment {
    /// Gmsh file (.msh, in metres, z up) with the organs, the lowest 42% of each pinned; by default
    /// phantom A, reconstructed, without friction.
    #[arg(long, value_name = "FILE")]
    pub mesh: Option<PathBuf>,
    /// Simulated time (s).
    #[arg(long, default_value_t = 1.0)]
    pub seconds: f64,
    /// Remove the damping of the tissue (with --mesh).
    #[arg(long, requires = "mesh")]
    pub undamped: bool,
    /// Worker threads; all by default.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
    /// How phantom A is recorded.
    #[command(flatten)]
    pub recorded: Recorded,
}

/// Figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct IntegratorsResult {
    /// All integrators.
    pub integrators: Vec<IntegratorRow>,
    /// Findings, one sentence each.
    pub findings: Vec<String>,
    /// Largest stable step of explicit integration (us).
    pub stable_step_us: f64,
    /// Source of the organs.
    pub specimen: String,
    /// Number of nodes.
    pub nodes: usize,
    /// Number of elements.
    pub tets: usize,
    /// Mean displacement of the nodes in the static equilibrium (mm).
    pub sag_mm: f64,
    /// Whether the damping was removed.
    pub undamped: bool,
    /// Worker threads.
    pub threads: usize,
}

impl Study for IntegratorsExperiment {
    const NAME: &'static str = "integrators";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> =
        Some("Output folder of recording, specimen and report. A finished recording in it is used again.");
    type Figures = IntegratorsResult;

    fn run(&self, job: &Job<'_>) -> Result<(IntegratorsResult, Document)> {
        if !(self.seconds >= 3.0 * FRAME && self.seconds <= 60.0) {
            return Err(Error::Mismatch(format!("--seconds {}: must be in [0.05, 60]", self.seconds)));
        }
        let organs = self.mesh.as_deref().map(Organs::read).transpose()?;
        job.claim()?;
        let (specimen, model) = match &organs {
            Some(organs) => (organs.source.clone(), self.pinned(organs)?),
            None => ("Phantom A, reconstructed, without friction".to_owned(), self.phantom(job)?),
        };
        let truth = Equilibrium::of(&model)?;
        let stable = stable_explicit_step(&model);
        let forms = forms(&model, FRAME);
        let frames = (self.seconds / FRAME).round() as usize;
        job.progress.begin("frames", (forms.len() * frames) as u64);
        let mut integrators = Vec::with_capacity(forms.len());
        for form in forms {
            integrators.push(measured(form, &model, &truth, frames, self.threads, job.progress)?);
        }
        job.progress.end();
        let result = IntegratorsResult {
            findings: findings(&integrators),
            integrators,
            stable_step_us: 1e6 * stable,
            specimen,
            nodes: model.bodies().iter().map(trocar_tissue::Body::len).sum(),
            tets: model.bodies().iter().map(|b| b.tets().len()).sum(),
            sag_mm: 1e3 * truth.sag,
            undamped: self.undamped,
            threads: if self.threads == 0 { rayon::current_num_threads() } else { self.threads },
        };
        let damping = match (&organs, self.undamped) {
            (None, _) => "damped as in the cell",
            (Some(_), false) => "lightly damped",
            (Some(_), true) => "undamped",
        };
        let document = document(&result, damping)?;
        Ok((result, document))
    }
}

impl IntegratorsExperiment {
    /// Organs from a file, the lowest 42% of the nodes of each pinned.
    fn pinned(&self, organs: &Organs) -> Result<Model> {
        let tissue = material(TISSUE.0, TISSUE.1);
        let viscosity = if self.undamped { 0.0 } else { LIGHT_DAMPING * TISSUE.0 };
        Ok(BenchScene::sag(organs, trocar_tissue::Material { viscosity, ..tissue })?.model)
    }

    /// Phantom A with the materials and supports of the cell.
    fn phantom(&self, job: &Job<'_>) -> Result<Model> {
        if self.undamped {
            return Err(Error::Mismatch("--undamped needs --mesh: the organs of the cell are damped".to_owned()));
        }
        let specimen = phantoms::specimen(
            "phantom-a",
            &self.recorded.options(),
            None,
            &job.output().join("phantom-a"),
            phantoms::AfterUse::Keep,
            job.progress,
        )?;
        frictionless(&specimen)
    }
}

/// The organs of a specimen on their bed, without friction: where tissue that rubs comes to rest
/// depends on the way there, and there is more than one equilibrium.
fn frictionless(specimen: &Specimen) -> Result<Model> {
    let surroundings = Surroundings {
        body_contact: Some(BodyContact { friction: 0.0, ..BodyContact::default() }),
        bed_friction: Some(0.0),
        ..Surroundings::default()
    };
    Ok(World::surrounded(specimen, &surroundings, Vec::new(), SolverSettings::default(), 1)?.model)
}

/// The static equilibrium of the organs.
struct Equilibrium {
    rest: Vec<DVec3>,
    positions: Vec<DVec3>,
    /// Mean displacement (m).
    sag: f64,
}

impl Equilibrium {
    fn of(model: &Model) -> Result<Self> {
        let mut state = OracleState::new(model);
        Oracle::new(model).settle(model, &mut state, &[]).map_err(reference)?;
        let rest = rest_positions(model);
        let positions: Vec<DVec3> =
            (0..model.bodies().len()).flat_map(|b| state.positions(b).iter().copied()).collect();
        let sag = rest.iter().zip(&positions).map(|(a, b)| (*a - *b).length()).sum::<f64>() / rest.len() as f64;
        Ok(Self { rest, positions, sag })
    }
}

fn measured(
    form: Form,
    model: &Model,
    truth: &Equilibrium,
    frames: usize,
    threads: usize,
    progress: &dyn Progress,
) -> Result<IntegratorRow> {
    let mut stepper = form.scheme.stepper(model, FRAME, threads).map_err(reference)?;
    let mut state = State::new(model);
    let mut mean = vec![DVec3::ZERO; truth.rest.len()];
    let first_measured = frames - ((AVERAGED_SHARE * frames as f64) as usize).max(1);
    let (mut speeds, mut times, mut ended) = (Vec::with_capacity(frames), Vec::with_capacity(frames), None);
    for frame in 0..frames {
        check_interrupted(progress)?;
        let clock = Instant::now();
        let report = stepper.step(model, &mut state, &[]);
        times.push(1e3 * clock.elapsed().as_secs_f64());
        progress.advance(1);
        let end = (frame + 1) as f64 * FRAME;
        // A state with NaN has no speed; it counts as over the limit.
        let lost = matches!(report.divergence, Some(trocar_tissue::Divergence::NonFinite { .. }));
        speeds.push((end, if lost { SPEED_LIMIT } else { report.max_speed.min(SPEED_LIMIT) }));
        if let Some(event) = report.divergence {
            ended = Some((end, event.to_string()));
            progress.advance((frames - frame - 1) as u64);
            break;
        }
        if frame >= first_measured {
            let all = (0..model.bodies().len()).flat_map(|b| state.positions(model, b));
            mean.iter_mut().zip(all).for_each(|(sum, x)| *sum += x / (frames - first_measured) as f64);
        }
    }
    times.sort_by(f64::total_cmp);
    let moved = || mean.iter().zip(&truth.rest).map(|(a, b)| (*a - *b).length()).sum::<f64>() / mean.len() as f64;
    Ok(IntegratorRow {
        name: form.name,
        settings: form.settings,
        paper: form.paper,
        bounded: ended.is_none(),
        peak_speed_m_s: speeds.iter().map(|s| s.1).fold(0.0, f64::max),
        last_speed_m_s: speeds.last().map_or(0.0, |s| s.1),
        sag_error: ended.is_none().then(|| mean_error(&mean, &truth.positions, &truth.rest)),
        sag_ratio: ended.is_none().then(|| moved() / truth.sag),
        ended_at_s: ended.as_ref().map(|e| e.0),
        event: ended.map(|e| e.1),
        frame_ms: times[times.len() / 2],
        speeds,
    })
}

fn document(result: &IntegratorsResult, damping: &str) -> Result<Document> {
    let lead = format!(
        "{} ({} elements, {} nodes), released at rest in its rest shape under gravity, {damping}. The plot shows the \
         largest node speed at the end of each frame of 1/60 s. The \
         dashed line is the paper's limit of {SPEED_LIMIT} m/s, at which a run ends. Speeds are not clamped.",
        page::escape(&result.specimen),
        count(result.tets),
        count(result.nodes),
    );
    let line = |(k, row): (usize, &IntegratorRow)| {
        // A run that ends in its first frame is drawn as a short line.
        let mut points = row.speeds.clone();
        if let [(t, v)] = points[..] {
            points = vec![(0.0, v), (t, v)];
        }
        Line::new(points, color(k))
    };
    let plot = Plot {
        title: "Largest node speed",
        x: "time since release (s)",
        y: "speed (m/s)",
        lines: result.integrators.iter().enumerate().map(line).collect(),
        limits: vec![SPEED_LIMIT],
        log_y: true,
        ..Plot::default()
    };
    let legend = page::legend(result.integrators.iter().enumerate().map(|(k, r)| (r.name, color(k))));
    let bounded =
        Section::new("Boundedness", lead).cards(cards(result)).plot(&plot, &format!("<b>Fig. 6(b).</b>{legend}"))?;
    let findings = Section::new("Findings", "").lines(result.findings.iter().cloned());
    let document = Document::new("Integrators", "Which stay bounded, and how exact they are");
    Ok(document.with(bounded).with(findings).with(rows(result)))
}

/// There are more integrators than organ colours.
fn color(k: usize) -> [u8; 3] {
    match k {
        0..8 => colors::organ(k),
        8 => [150, 90, 60],
        _ => [190, 30, 60],
    }
}

fn cards(result: &IntegratorsResult) -> [Card; 4] {
    let bounded = result.integrators.iter().filter(|r| r.bounded).count();
    let best = |start: &str| {
        let rows = result.integrators.iter().filter(|r| r.name.starts_with(start));
        rows.filter_map(|r| r.sag_error).min_by(f64::total_cmp).map_or("none".to_owned(), |e| percent(e, 2))
    };
    [
        Card::new("Bounded", format!("{bounded} of {}", result.integrators.len()), "below 20 m/s to the end"),
        Card::new(
            "Stable explicit step",
            format!("{} \u{b5}s", fixed(result.stable_step_us, 1)),
            "2/\u{3c9} of the stiffest mode at rest",
        ),
        Card::new("Smallest sag error of XPBD", best("XPBD"), "of its bounded settings"),
        Card::new("Sag", format!("{} mm", fixed(result.sag_mm, 4)), "mean displacement in the static equilibrium"),
    ]
}

fn rows(result: &IntegratorsResult) -> Section {
    let outcome = |r: &IntegratorRow| match (&r.event, r.ended_at_s) {
        (Some(event), Some(at)) => format!("{event}, after {} s", fixed(at, 3)),
        _ => "bounded".to_owned(),
    };
    let or_dash = |v: Option<String>| v.unwrap_or_else(|| "\u{2013}".to_owned());
    let table = Table::of(
        &result.integrators,
        &[
            ("Integrator", &|r| r.name.to_owned()),
            ("Settings", &|r| r.settings.clone()),
            ("Paper", &|r| r.paper.to_owned()),
            ("Outcome", &|r| outcome(r)),
            ("Peak (m/s)", &|r| format!("{:.1e}", r.peak_speed_m_s)),
            ("Last (m/s)", &|r| format!("{:.1e}", r.last_speed_m_s)),
            ("Sag over equilibrium", &|r| or_dash(r.sag_ratio.map(|s| fixed(s, 2)))),
            ("Sag error", &|r| or_dash(r.sag_error.map(|e| percent(e, 2)))),
            ("Frame (ms)", &|r| fixed(r.frame_ms, 1)),
        ],
    );
    let lead = format!(
        "<i>Sag error</i>: mean distance of the nodes from the static equilibrium (Newton\u{2019}s method in double \
         precision) over their mean displacement in it, positions averaged over the last third of the run. Frames on \
         {} threads.",
        result.threads
    );
    Section::new("All integrators", lead).table(table)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;
    use trocar_core::Silent;
    use trocar_testing::tube::{ONE_END, two_tubes};

    /// What comes to rest without friction is where the oracle says; with it, it is elsewhere.
    #[test]
    fn organs_without_friction_have_one_equilibrium() {
        let specimen = two_tubes(ONE_END, 4e-3);
        let error = |model: &Model| {
            let truth = Equilibrium::of(model).unwrap();
            let forms = forms(model, FRAME);
            let fast = forms.into_iter().find(|form| form.name == "Quasi-Newton").unwrap();
            measured(fast, model, &truth, 60, 1, &Silent).unwrap().sag_error.unwrap()
        };
        let rubs = World::new(&specimen, SolverSettings::default(), 1).unwrap().model;
        let (without, with) = (error(&frictionless(&specimen).unwrap()), error(&rubs));
        assert!(without < 0.02 && with > 5.0 * without, "without friction {without}, with friction {with}");
    }
}
