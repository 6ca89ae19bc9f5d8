//! The force of scissors: what the jaws of a cell feel while they close through a slab and a tube,
//! beside the closed form.

mod page;
mod result;
mod specimen;

use crate::study::{Job, Kind, Study};
use crate::{Error, Result};
use clap::Args;
use result::{CutForceResult, CutRow, CutSample, WeakScissors};
use specimen::{Shape, THICKNESS};
use std::collections::BTreeMap;
use trocar_cell::blades::Blades;
use trocar_cell::{Cell, CellEvent, Severance};
use trocar_core::Progress;
use trocar_report::document::Document;
use trocar_scene::{
    Arm, Frame, Instrument, InstrumentKind, MaterialOverride, OrganOverride, Scene, Side, SpecimenSource,
};
use trocar_workflow::check_interrupted;

/// Force of the study's jaws (N): the most that a scene allows, so that tissue decides.
const STRONG_N: f64 = 40.0;

/// Jaws too weak for the toughest slab (N), and its toughness (J/m2).
const WEAK: (f64, f64) = (5.0, 1000.0);

/// The jaws close by this share of their widest opening in a control period.
const STEP: f64 = 0.02;

/// The force is compared from where the cut has come this much farther than the slab's edge is from
/// the pivot, so that its beginning is over ...
const BEGUN: f64 = 1.25;

/// ... to the angle at which blades count as closed (rad).
const CLOSED: f64 = 0.157;

/// Height of the tissue's middle, and of the blades, in the cell (m).
const HEIGHT: f64 = 0.05;

/// The force of scissors on a slab of 3 mm and on a tube, beside the closed form.
#[derive(Clone, Debug, Args)]
pub struct CutForceExperiment {
    /// Toughness of the tissue (J/m2), from 1 to 20,000; several give several rows.
    #[arg(long, value_delimiter = ',', default_values_t = [150.0, 300.0, 1000.0], allow_negative_numbers = true)]
    pub toughness: Vec<f64>,
}

impl Study for CutForceExperiment {
    const NAME: &'static str = "cut-force";
    const KIND: Kind = Kind::Experiment;
    type Figures = CutForceResult;

    fn run(&self, job: &Job<'_>) -> Result<(CutForceResult, Document)> {
        if let Some(wrong) = self.toughness.iter().find(|j| !(1.0..=20_000.0).contains(*j)) {
            return Err(Error::Mismatch(format!("--toughness is {wrong} J/m2; it must be in [1, 20000]")));
        }
        job.claim()?;
        let result = self.measure(job.progress)?;
        let document = page::document(&result)?;
        Ok((result, document))
    }
}

impl CutForceExperiment {
    fn measure(&self, progress: &dyn Progress) -> Result<CutForceResult> {
        let mut rows = Vec::new();
        progress.begin("cuts", 2 * self.toughness.len() as u64 + 1);
        for shape in [Shape::Slab, Shape::Tube] {
            for toughness in &self.toughness {
                check_interrupted(progress)?;
                rows.push(row(shape, *toughness)?);
                progress.advance(1);
            }
        }
        let weak = weak()?;
        progress.advance(1);
        progress.end();
        let worst = |of: &dyn Fn(&CutRow) -> Option<f64>| rows.iter().filter_map(of).fold(0.0, f64::max);
        Ok(CutForceResult {
            cut_force_error: worst(&|r| r.force_error),
            work_error: worst(&|r| Some(r.work_error)),
            thickness_mm: 1e3 * THICKNESS,
            lever_mm: 1e3 * Blades::default().lever(),
            compared_rad: compared(Shape::Slab),
            weak,
            rows,
        })
    }
}

/// The angles between which the force on `shape` is compared with the closed form (rad).
fn compared(shape: Shape) -> [f64; 2] {
    [2.0 * (0.5 * THICKNESS / (BEGUN * shape.edge())).atan(), CLOSED]
}

/// The angle at which the blades meet the near edge of a slab (rad).
fn meets() -> f64 {
    2.0 * (0.5 * THICKNESS / Shape::Slab.edge()).atan()
}

/// Torque on scissors at `angle` (rad) in a sheet of `thickness` (m) and `toughness` (J/m2):
/// Mahvash and Okamura's closed form (N m).
fn closed_form(toughness: f64, thickness: f64, angle: f64) -> f64 {
    let half = 0.5 * angle;
    toughness * thickness * thickness * half.cos() / (4.0 * half.sin().powi(2))
}

/// A free cutter along x, its blades open about the tissue; its jaws close with `force` (N).
fn scene(toughness: f64, force: f64) -> Scene {
    let mut scene = Scene::new("cut-force", SpecimenSource::phantom("phantom-a", 1));
    scene.placement = Frame::default();
    let mut arm = Arm::free(Side::Right, "cutter", [0.0, 0.0, HEIGHT]);
    arm.direction = Some([1.0, 0.0, 0.0]);
    scene.arms = vec![arm];
    scene.instruments = vec![Instrument { jaw_force_n: force, ..Instrument::of(InstrumentKind::Cutter) }];
    scene.task.sever = true;
    let material = MaterialOverride { toughness_j_m2: Some(toughness), ..MaterialOverride::default() };
    scene.organs = BTreeMap::from([("tissue".to_owned(), OrganOverride { material, ..OrganOverride::default() })]);
    scene
}

/// A run: the samples of all frames in which the blades moved, the last cut, and the angle at which
/// the blades stand at the end (rad).
fn run(shape: Shape, toughness: f64, force: f64) -> Result<(Vec<CutSample>, Option<Severance>, f64)> {
    let mut cell = Cell::new(&scene(toughness, force), &shape.specimen(HEIGHT)?, 1)?;
    let blades = Blades::default();
    let angle = |cell: &Cell| cell.observe().first().map_or(0.0, |arm| arm.measured.jaw() * blades.max_angle);
    let mut was = angle(&cell);
    let (mut samples, mut last) = (Vec::new(), None);
    let steps = (1.0 / STEP).round() as usize;
    for k in 1..=steps {
        cell.servo_jaw("right", 1.0 - STEP * k as f64 + f64::EPSILON)?;
        let report = cell.step_watched(None, &mut |cell| {
            let now = angle(cell);
            let force_n = cell.observe().first().map_or(0.0, |arm| arm.jaw_force);
            if now < was {
                let torque_nm = force_n * blades.lever();
                let middle = 0.5 * (was + now);
                let thickness = shape.thickness().filter(|_| middle <= meets());
                let closed_form_nm = thickness.map(|t| closed_form(toughness, t, middle));
                samples.push(CutSample {
                    angle_rad: middle,
                    turned_rad: was - now,
                    force_n,
                    torque_nm,
                    closed_form_nm,
                });
            }
            was = now;
        })?;
        last = report.events.into_iter().rev().find_map(parted).or(last);
    }
    Ok((samples, last, was))
}

fn parted(event: CellEvent) -> Option<Severance> {
    match event {
        CellEvent::Cut { parted, .. } => parted.map(|cut| *cut),
        _ => None,
    }
}

fn row(shape: Shape, toughness: f64) -> Result<CutRow> {
    let (samples, cut, _) = run(shape, toughness, STRONG_N)?;
    let cut = cut.unwrap_or_default();
    // From the force that the jaws felt, and the faces that opened.
    let work_mj = 1e3 * samples.iter().map(|s| s.torque_nm * s.turned_rad).sum::<f64>();
    let [from, to] = compared(shape);
    let compared = samples.iter().filter(|s| (to..=from).contains(&s.angle_rad));
    let errors = compared.filter_map(|s| s.closed_form_nm.map(|form| (s.torque_nm / form - 1.0).abs()));
    Ok(CutRow {
        shape: shape.name(),
        toughness_j_m2: toughness,
        force_peak_n: samples.iter().map(|s| s.force_n).fold(0.0, f64::max),
        force_error: errors.reduce(f64::max),
        work_mj,
        section_mm2: cut.section_mm2,
        area_mm2: cut.area_mm2,
        work_error: (1e-3 * toughness * cut.section_mm2 / work_mj - 1.0).abs(),
        pieces: cut.pieces.len(),
        inverted: cut.inverted_after,
        samples,
    })
}

/// Jaws too weak for a slab: where they stand, and where the closed form says that they do.
fn weak() -> Result<WeakScissors> {
    let (force_n, toughness) = WEAK;
    let (_, cut, stands_rad) = run(Shape::Slab, toughness, force_n)?;
    let most = force_n * Blades::default().lever();
    let (mut low, mut high) = (0.01, Blades::default().max_angle);
    for _ in 0..60 {
        let middle: f64 = 0.5 * (low + high);
        if closed_form(toughness, THICKNESS, middle) > most { low = middle } else { high = middle }
    }
    // The slab begins some way from the pivot.
    let closed_form_rad = high.min(meets());
    Ok(WeakScissors { force_n, toughness_j_m2: toughness, stands_rad, closed_form_rad, cut: cut.is_some() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_core::Silent;

    #[test]
    fn the_force_is_the_closed_form_and_the_work_is_that_of_the_area() {
        // 1.8 N where the edges meet the slab, 6 mm from the pivot.
        assert!((closed_form(300.0, 3e-3, 0.5) * 2.0 * 0.25_f64.sin() / 3e-3 - 1.76).abs() < 0.01);
        let result = CutForceExperiment { toughness: vec![300.0] }.measure(&Silent).unwrap();
        let shown = || serde_json::to_string(&result).unwrap();
        assert!(result.cut_force_error < 0.15 && result.work_error < 0.10, "{}", shown());
        assert!(result.rows.iter().all(|r| r.pieces >= 1 && r.inverted == 0 && r.samples.len() > 30), "{}", shown());
        assert!((result.weak.stands_rad / result.weak.closed_form_rad - 1.0).abs() < 0.15, "{}", shown());
        let html = page::document(&result).unwrap().page();
        assert!(html.contains("<svg") && !html.contains("NaN"));
    }
}
