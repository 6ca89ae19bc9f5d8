//! From a cell to a row of channels.

use crate::bodies::{MID_JAWS, between_blades, bodies_of, nearest};
use crate::channels::{ArmChannels, TaskChannels, flag};
use crate::measures::Measures;
use crate::{Channels, Result};
use glam::{DQuat, DVec3};
use trocar_cell::{ArmObservation, Cell, CellEvent, CellReport};
use trocar_scene::{Gates, InstrumentKind, Side};

/// Below this jaw lift no follow ratio is given (m).
const MIN_JAW_LIFT: f64 = 1e-4;

/// The parts of a cell that the channels describe.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Subject {
    /// Name of the task's organ; its pieces after a cut are called `name.1` and so on.
    pub organ: String,
    pub gates: Gates,
    /// Places of the first grasper and the first cutter among the arms.
    pub grasper: Option<usize>,
    pub cutter: Option<usize>,
    /// Targets of port-reach: blade tips in the cell (m), three an arm; empty for other tasks.
    pub targets: Vec<[DVec3; 3]>,
    /// The task's own measures.
    pub measures: Measures,
}

impl Subject {
    pub fn new(cell: &Cell, organ: &str, gates: &Gates, targets: Vec<[DVec3; 3]>, measures: Measures) -> Self {
        let arms = cell.arms();
        let first = |kind| arms.iter().position(|(_, k)| *k == kind);
        Self {
            organ: organ.to_owned(),
            gates: *gates,
            grasper: first(InstrumentKind::Grasper),
            cutter: first(InstrumentKind::Cutter),
            targets,
            measures,
        }
    }

    /// The bodies that the organ is in.
    pub fn bodies(&self, cell: &Cell) -> Vec<usize> {
        bodies_of(cell, &self.organ)
    }

    /// The row of the period of `report`.
    pub fn channels(&self, cell: &Cell, report: &CellReport) -> Result<Channels> {
        let bodies = self.bodies(cell);
        let mut row = Channels { time_s: report.time, ..Channels::default() };
        for (k, arm) in report.arms.iter().enumerate() {
            let of = arm_channels(cell, k, arm, &bodies)?;
            match arm.side {
                Side::Left => row.left = of,
                Side::Right => row.right = of,
            }
        }
        row.task = self.task(cell, report, &bodies)?;
        self.measures.measure(cell, &mut row)?;
        Ok(row)
    }

    fn task(&self, cell: &Cell, report: &CellReport, bodies: &[usize]) -> Result<TaskChannels> {
        let mut t = TaskChannels {
            max_speed_m_s: report.tissue.max_speed,
            inverted: report.tissue.inverted as f64,
            min_volume: report.tissue.min_volume_ratio,
            yielded: report.tissue.yielded_substeps as f64,
            fallbacks: report.tissue.fallbacks as f64,
            diverged: flag(report.tissue.divergence.is_some()),
            punctures: report.rules.punctures as f64,
            pierced: report.rules.pierced as f64,
            overstretched: report.rules.overstretched as f64,
            folded: report.rules.folded as f64,
            activation_step_mm: 1e3 * report.activation_step,
            ..TaskChannels::default()
        };
        for event in &report.events {
            match event {
                CellEvent::Cut { .. } => t.cuts += 1.0,
                CellEvent::Torn { .. } => t.torn += 1.0,
                CellEvent::Slipped { .. } => t.slipped += 1.0,
                _ => {}
            }
        }
        let world = cell.world();
        let mut upper = self.gates.grasp_to;
        if let Some(k) = self.grasper {
            let middle = report.arms[k].tip.transform(MID_JAWS * DVec3::X);
            let axis_distance = |body: &usize| {
                let axis = &world.axes[*body];
                let part = (self.gates.grasp_from, self.gates.grasp_to);
                nearest(cell, *body, middle, |i| (part.0..=part.1).contains(&axis.s[i]))
            };
            t.grasp_distance_mm = 1e3 * bodies.iter().map(axis_distance).fold(f64::INFINITY, f64::min);
            if let Some(held) = cell.carried(k).filter(|c| bodies.contains(&c.organ)) {
                t.grasped = 1.0;
                t.grasp_s = held.s;
                t.lift_mm = 1e3 * held.tissue_lift;
                t.jaw_lift_mm = 1e3 * held.jaw_lift;
                t.follow = if held.jaw_lift > MIN_JAW_LIFT { held.tissue_lift / held.jaw_lift } else { 0.0 };
                t.slip_mm = 1e3 * held.slip;
                upper = held.s;
            }
        }
        if let Some(k) = self.cutter {
            let tip = cell.blade_tip(report.arms[k].side.name())?;
            let part = |body: &usize| nearest(cell, *body, tip, |i| world.axes[*body].s[i] <= upper);
            t.position_mm = 1e3 * bodies.iter().map(part).fold(f64::INFINITY, f64::min);
            t.cut_jaw = report.arms[k].measured.jaw();
            let (within, share) = between_blades(cell, k, bodies);
            (t.cut_mouth, t.cut_share) = (flag(within), share);
        }
        for name in [&mut t.grasp_distance_mm, &mut t.position_mm] {
            if !name.is_finite() {
                *name = 1e3;
            }
        }
        if !self.targets.is_empty() {
            let mut most: [f64; 3] = [0.0; 3];
            for (arm, targets) in report.arms.iter().zip(&self.targets) {
                let tip = cell.blade_tip(arm.side.name())?;
                for (m, target) in most.iter_mut().zip(targets) {
                    *m = m.max(1e3 * tip.distance(*target));
                }
            }
            [t.reach_1_mm, t.reach_2_mm, t.reach_3_mm] = most;
        }
        Ok(t)
    }
}

/// Of the two quaternions of a rotation the one whose scalar is not negative.
pub(crate) fn upright(q: DQuat) -> DQuat {
    if q.w < 0.0 { -q } else { q }
}

fn arm_channels(cell: &Cell, k: usize, arm: &ArmObservation, bodies: &[usize]) -> Result<ArmChannels> {
    let name = arm.side.name();
    let space = cell.workspace(name)?;
    let commanded = space.tip(&arm.commanded).translation;
    let (tip, q) = (arm.tip.translation, upright(arm.tip.rotation));
    let (within, share) = between_blades(cell, k, bodies);
    // An arm without a port has no pivots and no insertion: its place is that of the tip.
    let in_port = |numbers: [f64; 3]| if space.as_port().is_some() { numbers } else { [0.0; 3] };
    let [a, b, c, roll, jaw] = arm.measured.0;
    let ([a, b, c], [a_s, b_s, c_s]) = (in_port([a, b, c]), in_port([arm.rates[0], arm.rates[1], arm.rates[2]]));
    Ok(ArmChannels {
        pivot_1_rad: a,
        pivot_2_rad: b,
        insertion_m: c,
        roll_rad: roll,
        jaw,
        pivot_1_rad_s: a_s,
        pivot_2_rad_s: b_s,
        insertion_m_s: c_s,
        roll_rad_s: arm.rates[3],
        jaw_1_s: arm.rates[4],
        tip_x_m: tip.x,
        tip_y_m: tip.y,
        tip_z_m: tip.z,
        tip_qw: q.w,
        tip_qx: q.x,
        tip_qy: q.y,
        tip_qz: q.z,
        commanded_x_m: commanded.x,
        commanded_y_m: commanded.y,
        commanded_z_m: commanded.z,
        tracking_mm: 1e3 * commanded.distance(tip),
        rcm_mm: 1e3 * arm.rcm_deviation,
        rcm_peak_mm: 1e3 * arm.rcm_peak,
        tilt_deg: arm.tilt.to_degrees(),
        contact_x_n: arm.contact.x,
        contact_y_n: arm.contact.y,
        contact_z_n: arm.contact.z,
        constraint_x_n: arm.constraint.x,
        constraint_y_n: arm.constraint.y,
        constraint_z_n: arm.constraint.z,
        jaw_force_n: arm.jaw_force,
        attached: flag(arm.attached),
        in_mouth: flag(within),
        mouth_share: share,
        rejected_deg: arm.rejected_rotation.length().to_degrees(),
        held_back: flag(arm.held_back),
        load_limited: flag(arm.load_limited),
        pierces: flag(cell.pierces(name)?),
        guarded: flag(arm.guarded),
        solid_n: arm.solid_peak,
    })
}
