//! Which phase of the script follows, and when a phase is over before its time.

use super::super::grip::{LEAST_OPENING, TOUCH};
use super::super::phase::Phase;
use super::super::script::AfterHold;
use super::{Scripted, Style, seen};
use crate::Episode;
use crate::judge::{Context, Memory};
use trocar_scene::{Condition, TaskName};

/// Open blades go no deeper where tissue presses them apart with this share of the jaws' force:
/// they could not close. From the smaller share on the force is watched every period.
const MAX_SPREAD: f64 = 0.8;
pub(super) const WATCHED_SPREAD: f64 = 0.2;

/// Every further try allows this much more. Stiff tissue presses hard on open blades before enough
/// of it lies between them, and blades that stop there close on nothing.
const MORE_SPREAD: f64 = 0.6;

/// Jaws that stop above this share of their opening have not closed. They back off at most this
/// often, whatever keeps them open.
const KEPT_OPEN: f64 = 0.85;
const MAX_BACKS: usize = 4;

/// A blade presses alone if it has this share of both blades' force.
const ALONE: f64 = 0.9;

/// The jaws lift until the tissue has risen by the gate's lift and this (m).
const ENOUGH_ABOVE: f64 = 0.0005;

/// They continue in steps of this height (m), up to this lift above the gate (m), while tissue
/// follows this share of a step.
pub(super) const RISE: f64 = 0.001;
const MAX_ABOVE: f64 = 0.008;
const RISES: f64 = 0.25;

/// Every further grasp is this much farther from where the organ is held, in organ coordinates.
const OUTWARD: f64 = 0.12;

/// Times that it tries again to grasp, and to cut.
const TRIES: usize = 3;

/// The stages that say when held tissue is up: until all of their conditions hold, it grasps again.
const LIFTED: [&str; 2] = ["lift", "held"];

impl Scripted {
    /// Chooses the next phase by the present state of the episode.
    pub(super) fn next(&mut self, episode: &Episode) {
        let (t, careful) = (seen(episode).task, self.style == Style::Careful);
        let tries = self.script.map_or(TRIES, |script| script.retries);
        let again = careful && self.tries < tries;
        let task = episode.scene().task.name;
        let drags = self.script.is_some_and(|script| script.regrasp.is_some()) && !self.dragged;
        let after = self.script.map(|script| script.after);
        if matches!(self.phase, Phase::BackOut | Phase::BackOff) {
            self.stay(episode);
        }
        let next = match self.phase {
            Phase::Approach => Phase::Enter,
            Phase::Enter if self.spread(episode) >= self.max_spread() => Phase::BackOut,
            Phase::Enter | Phase::BackOut | Phase::BackOff => Phase::Close,
            Phase::Close if self.backs < MAX_BACKS && self.does_not_close(episode) => {
                self.backs += 1;
                Phase::BackOff
            }
            Phase::Close if t.grasped == 0.0 && again => {
                self.tries += 1;
                self.grip.missed(self.has_pierced(episode));
                Phase::Approach
            }
            Phase::Close if drags => Phase::Drag,
            Phase::Close => Phase::Lift,
            Phase::Drag => Phase::Release,
            Phase::Release => Phase::Close,
            Phase::Lift if !careful && task != TaskName::GraspLift => Phase::Reach,
            Phase::Lift if careful && after.is_none() && self.goes_on(episode, 0.0) => Phase::Rise,
            Phase::Rise if self.goes_on(episode, self.risen_mm + 1e3 * RISES * RISE) => Phase::Rise,
            Phase::Lift | Phase::Rise => Phase::Hold,
            Phase::Hold if t.grasped == 0.0 && again => {
                self.tries += 1;
                Phase::Approach
            }
            Phase::Hold if after.is_none() && again && !is_lifted(episode) => {
                self.tries += 1;
                self.outward += OUTWARD;
                self.grip.slipped();
                Phase::Lower
            }
            Phase::Hold if after == Some(AfterHold::Finish) => Phase::Finished,
            Phase::Hold if after == Some(AfterHold::Lower) => Phase::Lower,
            Phase::Hold if after.is_none() && task == TaskName::GraspLift => Phase::Rest,
            Phase::Hold => {
                self.tries = 0;
                Phase::Reach
            }
            Phase::Lower => Phase::Open,
            Phase::Reach => Phase::Engage,
            Phase::Engage if t.cut_mouth == 0.0 && again => {
                self.tries += 1;
                Phase::Engage
            }
            Phase::Engage => Phase::Cut,
            Phase::Cut if after.is_some() => Phase::Carry,
            Phase::Cut if again => {
                self.tries += 1;
                Phase::Reach
            }
            Phase::Carry => Phase::Keep,
            Phase::Open if after.is_none() => Phase::Approach,
            Phase::Open | Phase::Keep | Phase::Finished => Phase::Finished,
            Phase::Cut => Phase::Rest,
            Phase::Target(n) if n < 2 => Phase::Target(n + 1),
            Phase::Target(_) | Phase::Rest => Phase::Rest,
        };
        self.start_phase(next);
    }

    /// Whether the phase is over before its time: the jaws hold tissue, open blades are as deep in
    /// it as the jaws can close on, or have backed out so far.
    pub(super) fn early(&self, episode: &Episode) -> bool {
        let over = match self.phase {
            Phase::Approach | Phase::Enter => self.spread(episode) >= self.max_spread(),
            Phase::BackOut => self.spread(episode) < self.max_spread(),
            _ => self.feels() && seen(episode).task.grasped > 0.0,
        };
        self.done > 0 && over
    }

    /// While open blades go into tissue or back out: the force with which it presses them apart,
    /// over that of the jaws; else 0.
    pub(super) fn spread(&self, episode: &Episode) -> f64 {
        if self.style != Style::Careful || !(self.goes_in() || self.phase == Phase::BackOut) {
            return 0.0;
        }
        let Some(k) = episode.roles().0 else { return 0.0 };
        let jaws = episode.scene().tools().get(k).map_or(f64::INFINITY, |tool| tool.instrument.jaw_force_n);
        episode.cell().observe()[k].jaw_force / jaws
    }

    /// The share of the jaws' force at which open blades stop in this try.
    fn max_spread(&self) -> f64 {
        MAX_SPREAD + MORE_SPREAD * self.tries as f64
    }

    /// Whether open blades are on their way to the grasp.
    pub(super) fn goes_in(&self) -> bool {
        matches!(self.phase, Phase::Approach | Phase::Enter)
    }

    /// Makes the place where the grasper is that of the grasp.
    pub(super) fn stay(&mut self, episode: &Episode) {
        let Some(k) = episode.roles().0 else { return };
        let tip = episode.cell().observe()[k].tip;
        if let (Some(aim), Some(last)) = (&mut self.grasp, self.last.get(k)) {
            (aim.pose.translation, aim.setpoint) = (tip.translation, *last);
        }
    }

    /// Whether the jaws have stopped as good as open, because their ends press on what lies below
    /// the tissue, or one blade alone presses on what lies beside it.
    fn does_not_close(&self, episode: &Episode) -> bool {
        let (Some(k), Some(aim)) = (episode.roles().0, &self.grasp) else { return false };
        let open = episode.cell().observe()[k].measured.jaw() > KEPT_OPEN * aim.setpoint.jaw();
        self.style == Style::Careful && (open || self.lone_blade(episode).is_some())
    }

    /// The side of the blade that alone keeps the jaws from closing, because it presses on
    /// something beside the tissue: 1 for the one that opens towards +y of the tip, -1 for the
    /// other.
    pub(super) fn lone_blade(&self, episode: &Episode) -> Option<f64> {
        let arm = &episode.cell().observe()[episode.roles().0?];
        let looks = self.style == Style::Careful && !arm.attached;
        let both = arm.blade_forces[0] + arm.blade_forces[1];
        let [plus, minus] = arm.blade_forces.map(|force| force > ALONE * both);
        let open = arm.measured.jaw() > LEAST_OPENING && 0.5 * both > TOUCH;
        (looks && open && (plus || minus)).then_some(if plus { 1.0 } else { -1.0 })
    }

    /// Whether the lift continues: the tissue has risen by `least` (mm), and not yet enough.
    fn goes_on(&self, episode: &Episode, least: f64) -> bool {
        let (t, gate) = (seen(episode).task, episode.scene().task.gates.lift_mm);
        let wanted = t.lift_mm < gate + 1e3 * ENOUGH_ABOVE;
        t.grasped > 0.0 && wanted && t.lift_mm >= least && self.lift < 1e-3 * gate + MAX_ABOVE
    }

    /// Whether the grasper has pierced an organ.
    fn has_pierced(&self, episode: &Episode) -> bool {
        let arms = episode.cell().arms();
        let grasper = episode.roles().0.and_then(|k| arms.get(k));
        grasper.is_some_and(|(side, _)| episode.cell().pierces(side.name()).unwrap_or(false))
    }
}

/// Whether held tissue is up as the task's stages of a lift want it, for however long.
fn is_lifted(episode: &Episode) -> bool {
    let (program, row) = (episode.program(), seen(episode));
    let context = Context { row: &row, rows: &[], constants: &program.constants };
    let mut stages = program.stages.iter().filter(|stage| LIFTED.contains(&stage.name.as_str()));
    stages.all(|stage| {
        let now: &Condition = if let Condition::Lasts { what, .. } = &stage.when { what } else { &stage.when };
        context.holds(now, &mut Memory::new(stage.timers, stage.marks))
    })
}
