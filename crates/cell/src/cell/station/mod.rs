//! One arm of the cell: its manipulator, its instrument's end among the tissue, and what it holds.

mod among;
mod jaws;
mod moving;
mod observe;

use super::action::{Action, ActionSpace, Checker, NUMBERS, paced};
use super::exchange::Exchange;
use super::guard::Guard;
use super::report::CellEvent;
use crate::blades::{Blades, Tools, opening_force};
use crate::hold::Hold;
use crate::{GraspDesign, Gripper, Jaw, Result, Scissors, World};
use glam::DVec3;
use trocar_core::Pose;
use trocar_robot::instrument::{Coordinates, Instrument, Limits};
use trocar_robot::manipulator::Manipulator;
use trocar_robot::port::{Port, Solution};
use trocar_scene::{InstrumentKind, Side};
use trocar_tissue::{Collider, Event, ToolForce, ToolMotion};

/// Jaws that press with this share of their force have closed on what is between them.
const PRESSING: f64 = 0.95;

/// Height at which tissue feels an instrument no more [m].
const FAR: f64 = 100.0;

/// Jaws are told to close, or to open, when the opening asked for is beyond the one they have by this much.
const MEANT: f64 = 0.02;

/// What never changes of an arm.
#[derive(Clone, Debug)]
pub(super) struct Fixed {
    pub side: Side,
    pub kind: InstrumentKind,
    pub port: Port,
    pub instrument: Instrument,
    pub limits: Limits,
    pub tools: Tools,
    pub blades: Blades,
    /// The convex parts that tissue touches.
    pub parts: Vec<Collider>,
    /// The blades' tips stay above this height in the cell [m].
    pub floor: f64,
    /// Force against which no command pushes the instrument on [N].
    pub force_limit: f64,
    /// RCM deviations that are told [m].
    pub rcm: [f64; 2],
    /// Length of a control period [s].
    pub period: f64,
}

/// What an arm is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Wanted {
    /// Coordinates, and what is left of the orientation that was asked for.
    Coordinates(Coordinates, DVec3),
    /// Joints, which the manipulator knows, and the jaw's opening.
    Joints(f64),
}

impl Wanted {
    fn jaw(&self) -> f64 {
        match self {
            Self::Coordinates(c, _) => c.jaw,
            Self::Joints(jaw) => *jaw,
        }
    }
}

/// Tissue that the jaws hold.
#[derive(Clone, Debug)]
pub(super) struct Held {
    pub organ: usize,
    pub s: f64,
    pub hold: Hold,
    /// The opening at which the jaws closed on it.
    opening: f64,
}

/// What changes of an arm beside its manipulator's state: plain data.
#[derive(Clone, Debug)]
pub(super) struct Moving {
    pub wanted: Wanted,
    /// The coordinates that were commanded last.
    pub commanded: Coordinates,
    pub held_back: bool,
    guard: Guard,
    /// The guard has shortened the last command.
    guarded: bool,
    /// Gripper at the end of the last tissue frame.
    pub gripper: Gripper,
    pub design: GraspDesign,
    pub jaw: Jaw,
    jaw_rate: f64,
    pub exchange: Exchange,
    pub forces: [ToolForce; 3],
    scissors: Scissors,
    /// A cutter's blades are closing, or have closed, through tissue: how wide they were [rad]. They shear it then and press none of it.
    shears: Option<f64>,
    pub held: Option<Held>,
    /// Tissue does not feel the instrument for now.
    pub unhooked: bool,
    /// Tissue does not feel the blades until they let go of what they hold.
    pub bare: bool,
    rcm_peak: f64,
    /// Which of the deviations have been told and are still exceeded.
    rcm_told: [bool; 2],
}

/// One arm.
#[derive(Clone, Debug)]
pub(super) struct Station {
    pub fixed: Fixed,
    pub manipulator: Manipulator,
    pub now: Moving,
}

impl Station {
    /// What an action's five numbers for this arm ask for; `first` is the place of the first of them.
    pub fn target(&self, action: &Action, first: usize) -> Result<Wanted> {
        let (space, limits) = (action.space, &self.fixed.limits);
        let n = &action.numbers[first..first + NUMBERS];
        Checker { space, arm: self.fixed.side.name(), first, limits, period: self.fixed.period }.check(n)?;
        match space {
            ActionSpace::Pivots => {
                let wanted = Coordinates { pivots: [n[0], n[1]], insertion: n[2], roll: n[3], jaw: n[4] };
                Ok(Wanted::Coordinates(limits.clamp(&wanted).0, DVec3::ZERO))
            }
            ActionSpace::Tip => {
                let from = Coordinates { roll: self.now.commanded.roll + n[3], jaw: n[4], ..self.now.commanded };
                let mut tip = self.fixed.port.tip(&from);
                tip.translation += DVec3::new(n[0], n[1], n[2]);
                let solution = self.solve(&tip, &from)?;
                // Pitch and yaw follow the place; the roll is the caller's.
                let wanted = Coordinates { roll: from.roll, ..solution.coordinates };
                Ok(Wanted::Coordinates(limits.clamp(&wanted).0, solution.rejected_rotation))
            }
        }
    }

    /// The nearest coordinates to a pose of the tip, above the floor.
    pub fn solve(&self, tip: &Pose, near: &Coordinates) -> Result<Solution> {
        let Fixed { port, instrument, limits, .. } = &self.fixed;
        let mut solution = port.solve(instrument, limits, tip, near)?;
        let room = self.fixed.deepest(&solution.coordinates);
        if solution.coordinates.insertion > room {
            solution.excess.insertion += solution.coordinates.insertion - room;
            solution.coordinates.insertion = room;
            solution.tip = port.tip(&solution.coordinates);
            solution.flange = instrument.flange(&solution.tip);
            solution.rejected_translation = tip.translation - solution.tip.translation;
        }
        Ok(solution)
    }

    /// A control period begins.
    pub fn command(&mut self) -> Result<()> {
        let Self { fixed, manipulator, now } = self;
        (now.rcm_peak, now.guarded) = (0.0, false);
        let Wanted::Coordinates(wanted, _) = now.wanted else { return Ok(()) };
        let (mut next, far) = paced(&now.commanded, &wanted, fixed.period);
        let room = fixed.deepest(&next);
        let low = next.insertion > room;
        next.insertion = next.insertion.min(room);
        now.guard.look(now.exchange.force(), manipulator.measured_cp().translation);
        let from = fixed.port.tip(&now.commanded).translation;
        let mut tip = fixed.port.tip(&next);
        let way = tip.translation - from;
        let allowed = now.guard.allow(way, fixed.force_limit);
        now.guarded = allowed != way;
        if now.guarded {
            tip.translation = from + allowed;
            let solved = fixed.port.solve(&fixed.instrument, &fixed.limits, &tip, &next)?.coordinates;
            next = Coordinates { insertion: solved.insertion.min(fixed.deepest(&solved)), roll: next.roll, ..solved };
        }
        let commanded = manipulator.servo_cp(&next)?;
        (now.commanded, now.held_back) = (commanded.coordinates, far || low || now.guarded || commanded.reach < 1.0);
        Ok(())
    }

    /// One physics step of the arm.
    pub fn step(&mut self, dt: f64) -> Result<()> {
        let at = self.manipulator.measured_cp().translation;
        let report = self.manipulator.step(self.now.exchange.load(at), dt)?;
        self.now.rcm_peak = self.now.rcm_peak.max(report.rcm_deviation);
        self.now.held_back |= report.pace < 1.0;
        Ok(())
    }

    /// A tissue frame of `dt` [s] begins: the motions of the instrument's three tools over it.
    pub fn motions(&mut self, dt: f64) -> [ToolMotion; 3] {
        let now = &mut self.now;
        let angle = now.gripper.jaw_angle;
        let target = now.wanted.jaw() * self.fixed.blades.max_angle;
        // What is latched locks the jaws; friction must go on pressing.
        let locked = now.held.is_some() && now.design != GraspDesign::Friction;
        let next_angle = if locked {
            angle
        } else if target < angle {
            let force = opening_force(&now.gripper, Tools::of(0), &now.forces);
            now.jaw.squeeze(angle, force).max(target)
        } else {
            now.jaw.turn_to(angle, target)
        };
        let next = Gripper { pose: self.manipulator.measured_cp(), jaw_angle: next_angle };
        let mut motions = now.gripper.motions_to(&next);
        now.jaw_rate = (next_angle - angle) / (self.fixed.blades.max_angle * dt);
        now.gripper = next;
        // At rest, far from everything.
        let away = Pose { translation: FAR * DVec3::Z, ..Pose::IDENTITY };
        let away = ToolMotion { from: away, to: away };
        if now.unhooked {
            return [away; 3];
        }
        if now.shears.is_some() || now.bare {
            motions[1..].fill(away);
        }
        motions
    }

    /// A tissue frame is over: takes its forces, and lets the jaws take hold and let go. What a cutter closed through: the organ, and the cutter as wide as it was open.
    pub fn after_frame(&mut self, world: &mut World, events: &mut Vec<CellEvent>) -> Option<(usize, Gripper)> {
        let Self { fixed, now, .. } = self;
        now.forces = fixed.tools.forces(world.forces());
        now.exchange.after_frame(now.gripper.pose.translation, &now.forces);
        for event in world.events() {
            match *event {
                Event::Slipped { tool, .. } if tool == fixed.tools.gripper => {
                    events.push(CellEvent::Slipped { arm: fixed.side });
                }
                Event::Torn { tool, force, .. } if tool == fixed.tools.gripper => {
                    events.push(CellEvent::Torn { arm: fixed.side, force_n: force });
                    self.let_go(world, events);
                    break;
                }
                _ => {}
            }
        }
        self.tell_rcm(events);
        let Self { fixed, now, .. } = self;
        if let Some(force_n) = now.guard.tell(fixed.force_limit) {
            events.push(CellEvent::ForceLimit { arm: fixed.side, force_n });
        }
        match self.fixed.kind {
            InstrumentKind::Grasper => {
                self.grasp(world, events);
                None
            }
            InstrumentKind::Cutter => self.cut(world),
        }
    }

    fn tell_rcm(&mut self, events: &mut Vec<CellEvent>) {
        let (arm, deviation_mm) = (self.fixed.side, 1e3 * self.now.rcm_peak);
        for k in 0..2 {
            let over = self.now.rcm_peak > self.fixed.rcm[k];
            if over && !self.now.rcm_told[k] {
                events.push(match k {
                    0 => CellEvent::RcmThreshold { arm, deviation_mm },
                    _ => CellEvent::RcmAbort { arm, deviation_mm },
                });
            }
            self.now.rcm_told[k] = over;
        }
    }
}

impl Fixed {
    /// The deepest insertion [m] at these pivots with which the tips of closed blades stay above the floor.
    fn deepest(&self, at: &Coordinates) -> f64 {
        let tip = self.port.tip(at);
        let along = tip.rotation * DVec3::X;
        let height = self.port.centre().z - self.floor;
        let room = if along.z < -0.1 { -height / along.z } else { f64::INFINITY };
        (room - self.blades.length).max(self.limits.insertion[0])
    }
}
