//! A grasp-lift in the cell taken down: period by period, and in figures.

use super::{CellLift, CellLiftPolicy};
use crate::measure::{HELD_FOLLOW_RATIO, HELD_SLIP_MM};
use crate::{Cell, CellEvent, CellReport, Result};
use serde::Serialize;

/// Load is counted as a jump within this time of the grasp [s].
const JUMP_TIME: f64 = 0.3;

/// What was measured in one control period.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CellLiftSample {
    /// Time at its end [s].
    pub time_s: f64,
    /// Phase: settle, approach, enter, close, drag, release, lift, hold.
    pub phase: &'static str,
    /// RCM deviation of the arm [mm].
    pub rcm_mm: f64,
    /// The largest in the period [mm].
    pub rcm_peak_mm: f64,
    /// Tilt of its shaft [degrees].
    pub tilt_deg: f64,
    /// Distance of the tip from what is commanded [mm]: tracking error and lag together.
    pub behind_mm: f64,
    /// Jaw opening.
    pub jaw: f64,
    /// Force with which tissue pushes the blades apart [N]: contact.
    pub jaw_force_n: f64,
    /// Contact force on the instrument [N].
    pub contact_n: f64,
    /// Pull of held tissue [N]: constraint.
    pub constraint_n: f64,
    /// Rise of the jaws since they closed [mm].
    pub jaw_lift_mm: f64,
    /// Rise of the held tissue's centroid since [mm].
    pub tissue_lift_mm: f64,
    /// Distance of that centroid in the jaws from where it was [mm].
    pub slip_mm: f64,
    /// Largest node speed [m/s].
    pub max_speed_m_s: f64,
    /// Inverted elements.
    pub inverted: usize,
}

/// A run in figures.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CellLiftSummary {
    /// The arm.
    pub arm: String,
    /// Organ grasped.
    pub organ: String,
    /// Organ coordinate of the attached cluster.
    pub at: f64,
    /// Name of the grasp design.
    pub design: &'static str,
    /// The jaws took hold.
    pub attached: bool,
    /// Nodes held.
    pub held_nodes: usize,
    /// Follow ratio at least 0.80 and slip under 3 mm at the end of the hold.
    pub held: bool,
    /// Rise of the tissue [mm].
    pub lift_mm: f64,
    /// Tissue lift over jaw lift.
    pub follow_ratio: f64,
    /// Slip [mm].
    pub slip_mm: f64,
    /// Largest distance between where the grasp first prescribes a node and where it was [mm].
    pub snap_mm: f64,
    /// RCM deviation while tissue is lifted and held, median over periods [mm].
    pub rcm_median_mm: f64,
    /// Largest RCM deviation then [mm].
    pub rcm_max_mm: f64,
    /// The same before, in free motion [mm].
    pub rcm_free_median_mm: f64,
    /// Largest RCM deviation of the whole run [mm].
    pub rcm_run_max_mm: f64,
    /// RCM deviation in the period before the last grasp, and the largest in the 0.3 s after it
    /// [mm].
    pub rcm_before_grasp_mm: f64,
    /// See there [mm].
    pub rcm_after_grasp_mm: f64,
    /// Largest constraint force in those 0.3 s [N].
    pub constraint_after_grasp_n: f64,
    /// Largest contact force on the instrument [N].
    pub peak_contact_n: f64,
    /// Largest constraint force [N].
    pub peak_constraint_n: f64,
    /// Largest rejected rotation [degrees].
    pub rejected_rotation_deg: f64,
    /// Most inverted elements in any frame.
    pub inverted_peak: usize,
    /// Smallest element volume over its rest volume.
    pub min_volume_ratio: f64,
    /// Substeps in which held nodes could not follow the jaws.
    pub yielded_substeps: usize,
    /// Tissue tore out of the jaws, or slid, so many times.
    pub torn: usize,
    /// See there.
    pub slipped: usize,
    /// The run diverged.
    pub diverged: bool,
    /// Why, if it did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub divergence: Option<String>,
    /// Simulated time [s].
    pub simulated_s: f64,
    /// Wall time of the stepping [s].
    pub wall_s: f64,
    /// Simulated over wall time.
    pub real_time_factor: f64,
    /// Hash of the final state, hexadecimal.
    pub state_hash: String,
}

/// A finished run.
#[derive(Clone, Debug)]
pub struct CellLiftRun {
    /// In figures.
    pub summary: CellLiftSummary,
    /// Period by period.
    pub samples: Vec<CellLiftSample>,
    /// What happened, with the time [s].
    pub events: Vec<(f64, CellEvent)>,
}

/// Takes a run down.
pub(super) struct Record {
    arm: usize,
    name: String,
    period: f64,
    pub(super) summary: CellLiftSummary,
    samples: Vec<CellLiftSample>,
    events: Vec<(f64, CellEvent)>,
    /// Time of the last grasp [s].
    grasped: Option<f64>,
}

impl Record {
    pub(super) fn new(task: &CellLift, policy: &CellLiftPolicy) -> Self {
        let summary = CellLiftSummary { arm: task.arm.clone(), min_volume_ratio: 1.0, ..CellLiftSummary::default() };
        let (samples, events) = (Vec::new(), Vec::new());
        Self { arm: policy.arm, name: task.arm.clone(), period: 0.0, summary, samples, events, grasped: None }
    }

    pub(super) fn add(&mut self, phase: &'static str, report: &CellReport, cell: &Cell) -> Result<()> {
        self.period = cell.period();
        let arm = &report.arms[self.arm];
        let moved = cell.moved(self.arm).unwrap_or_default();
        let (contact, constraint) = (arm.contact.length(), arm.constraint.length());
        let commanded = cell.port(&self.name)?.tip(&arm.commanded).translation;
        self.samples.push(CellLiftSample {
            time_s: report.time,
            phase,
            rcm_mm: 1e3 * arm.rcm_deviation,
            rcm_peak_mm: 1e3 * arm.rcm_peak,
            tilt_deg: arm.tilt.to_degrees(),
            behind_mm: 1e3 * commanded.distance(arm.tip.translation),
            jaw: arm.coordinates.jaw,
            jaw_force_n: arm.jaw_force,
            contact_n: contact,
            constraint_n: constraint,
            jaw_lift_mm: 1e3 * moved.jaw_lift,
            tissue_lift_mm: 1e3 * moved.tissue_lift,
            slip_mm: 1e3 * moved.slip,
            max_speed_m_s: report.tissue.max_speed,
            inverted: report.tissue.inverted,
        });
        let s = &mut self.summary;
        s.peak_contact_n = s.peak_contact_n.max(contact);
        s.peak_constraint_n = s.peak_constraint_n.max(constraint);
        s.rejected_rotation_deg = s.rejected_rotation_deg.max(arm.rejected_rotation.length().to_degrees());
        s.inverted_peak = s.inverted_peak.max(report.tissue.inverted);
        s.min_volume_ratio = s.min_volume_ratio.min(report.tissue.min_volume_ratio);
        s.yielded_substeps += report.tissue.yielded_substeps;
        s.simulated_s = report.time;
        s.attached = arm.attached;
        if let Some(why) = report.tissue.divergence {
            (s.diverged, s.divergence) = (true, Some(why.to_string()));
        }
        for event in &report.events {
            match event {
                CellEvent::Attached { arm, organ, s: at, nodes, snap_mm } if arm.name() == self.name => {
                    (s.organ, s.at, s.held_nodes, s.snap_mm) = (organ.clone(), *at, *nodes, *snap_mm);
                    self.grasped = Some(report.time);
                }
                CellEvent::Torn { .. } => s.torn += 1,
                CellEvent::Slipped { .. } => s.slipped += 1,
                _ => {}
            }
            self.events.push((report.time, event.clone()));
        }
        Ok(())
    }

    pub(super) fn finish(mut self, design: &'static str, wall_s: f64, hash: u64) -> CellLiftRun {
        let s = &mut self.summary;
        s.design = design;
        let loaded = |x: &&CellLiftSample| matches!(x.phase, "lift" | "hold");
        let free = |x: &&CellLiftSample| matches!(x.phase, "approach" | "enter");
        s.rcm_median_mm = median(self.samples.iter().filter(loaded).map(|x| x.rcm_mm));
        s.rcm_free_median_mm = median(self.samples.iter().filter(free).map(|x| x.rcm_mm));
        s.rcm_max_mm = self.samples.iter().filter(loaded).map(|x| x.rcm_peak_mm).fold(0.0, f64::max);
        s.rcm_run_max_mm = self.samples.iter().map(|x| x.rcm_peak_mm).fold(0.0, f64::max);
        if let Some(at) = self.grasped {
            let after = |x: &&CellLiftSample| x.time_s > at && x.time_s <= at + JUMP_TIME;
            let most = |f: fn(&CellLiftSample) -> f64| self.samples.iter().filter(after).map(f).fold(0.0, f64::max);
            s.rcm_after_grasp_mm = most(|x| x.rcm_peak_mm);
            s.constraint_after_grasp_n = most(|x| x.constraint_n);
            let before = self.samples.iter().rfind(|x| x.time_s < at - 0.5 * self.period);
            s.rcm_before_grasp_mm = before.map_or(0.0, |x| x.rcm_mm);
        }
        if let Some(last) = self.samples.last().filter(|x| x.phase == "hold") {
            (s.lift_mm, s.slip_mm) = (last.tissue_lift_mm, last.slip_mm);
            s.follow_ratio = if last.jaw_lift_mm > 0.0 { last.tissue_lift_mm / last.jaw_lift_mm } else { 0.0 };
        }
        s.held = s.attached && !s.diverged && s.follow_ratio >= HELD_FOLLOW_RATIO && s.slip_mm < HELD_SLIP_MM;
        (s.wall_s, s.real_time_factor) = (wall_s, s.simulated_s / wall_s);
        s.state_hash = format!("{hash:016x}");
        CellLiftRun { summary: self.summary, samples: self.samples, events: self.events }
    }
}

/// The median; 0 of nothing.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(f64::total_cmp);
    let n = all.len();
    if n == 0 { 0.0 } else { 0.5 * (all[(n - 1) / 2] + all[n / 2]) }
}
