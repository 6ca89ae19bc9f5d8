//! One arm of the cell: its manipulator, its instrument's end among the tissue, and what it holds.

use super::action::{Action, ActionSpace, Checker, NUMBERS, paced};
use super::clearance::Rod;
use super::exchange::Exchange;
use super::guard::Guard;
use super::pierce::pierced;
use super::report::{ArmObservation, CellEvent, TaggedForce};
use crate::blades::{Blades, Tools, opening_force};
use crate::clasp::{Clasp, Snap};
use crate::hold::{Hold, Moved};
use crate::target::reach_into;
use crate::{GraspDesign, Gripper, Jaw, Mouth, Mouthful, Result, Scissors, World};
use glam::DVec3;
use trocar_geometry::Pose;
use trocar_robot::instrument::{Coordinates, Instrument, Limits};
use trocar_robot::manipulator::Manipulator;
use trocar_robot::port::{Port, Solution};
use trocar_robot::wrench::{ForceKind, Wrench};
use trocar_scene::{InstrumentKind, Side};
use trocar_tissue::{Collider, Event, Piece, Shape, ToolForce, ToolMotion};

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

impl Moving {
    pub fn new(
        pose: Pose,
        fixed: &Fixed,
        start: Coordinates,
        design: GraspDesign,
        jaw: Jaw,
        scissors: Scissors,
    ) -> Self {
        Self {
            wanted: Wanted::Coordinates(start, DVec3::ZERO),
            commanded: start,
            held_back: false,
            guard: Guard::default(),
            guarded: false,
            gripper: Gripper { pose, jaw_angle: start.jaw * fixed.blades.max_angle },
            design,
            jaw,
            jaw_rate: 0.0,
            exchange: Exchange::new(pose.translation),
            forces: [ToolForce::default(); 3],
            scissors,
            shears: None,
            held: None,
            unhooked: false,
            bare: false,
            rcm_peak: 0.0,
            rcm_told: [false; 2],
        }
    }
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

    /// Whether it may have to do with the tissue's stretch.
    pub fn meets_tissue(&self) -> bool {
        self.now.unhooked || self.now.held.is_some() || self.now.forces.iter().any(|f| f.touching > 0)
    }

    /// Distance of a point from the instrument's axis, from the blades' tips up its shaft [m].
    pub fn distance(&self, p: DVec3) -> f64 {
        let q = self.now.gripper.pose.inverse().transform(p);
        let along = q.x.clamp(-self.fixed.blades.shaft_length, self.fixed.blades.length);
        q.distance(along * DVec3::X)
    }

    /// Whether the jaws hold tissue of that organ.
    pub fn holds(&self, organ: usize) -> bool {
        self.now.held.as_ref().is_some_and(|held| held.organ == organ)
    }

    /// Its convex parts where they are now, as far as they are round. The rest offset is the blades' thickness.
    pub fn rods(&self) -> Vec<Rod> {
        let rods = self.frames().into_iter().flat_map(|(tool, frame)| {
            let parts = self.fixed.parts.iter().filter(move |part| part.tool == tool);
            parts.filter_map(move |part| match part.shape {
                Shape::Capsule { ends, radius } => {
                    let ends = ends.map(|p| frame.transform(p));
                    Some(Rod { ends, radius: radius + part.rest_offset })
                }
                _ => None,
            })
        });
        rods.collect()
    }

    /// The instrument's tools and where they are.
    fn frames(&self) -> [(usize, Pose); 3] {
        let [one, two] = self.fixed.tools.sides().map(|(tool, side)| (tool, self.now.gripper.blade(side)));
        [(self.fixed.tools.gripper, self.now.gripper.pose), one, two]
    }

    /// The organ that a part of the instrument has gone into, but for what the jaws hold and what blades shear.
    pub fn pierces(&self, world: &World) -> Option<usize> {
        let felt = if self.now.shears.is_some() || self.now.bare { 1 } else { 3 };
        self.pierced_by(world, felt)
    }

    /// The organ that one of the first `count` tools has gone into: the shaft, then the blades.
    fn pierced_by(&self, world: &World, count: usize) -> Option<usize> {
        let Self { fixed, now, .. } = self;
        let spared = now.held.as_ref().map(|held| held.organ);
        for (tool, frame) in self.frames().into_iter().take(count) {
            let axes = fixed.parts.iter().filter(|part| part.tool == tool).filter_map(|part| match part.shape {
                Shape::Capsule { ends, .. } => Some(ends.map(|p| frame.transform(p))),
                _ => None,
            });
            let axes: Vec<[DVec3; 2]> = axes.collect();
            if let Some((organ, _)) = pierced(world, &axes, spared) {
                return Some(organ);
            }
        }
        None
    }

    /// Holds on by its latch alone: the blades are felt no more. False where they are so already, or where nothing but the blades holds.
    pub fn bare(&mut self) -> bool {
        let can = !self.now.bare && self.force_kind() == ForceKind::Constraint;
        self.now.bare |= can;
        can
    }

    /// Lets go, and is not felt for now.
    pub fn unhook(&mut self, world: &mut World, events: &mut Vec<CellEvent>) {
        self.let_go(world, events);
        self.now.unhooked = true;
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

    /// Jaw opening, 0 to 1.
    fn opening(&self) -> f64 {
        self.now.gripper.jaw_angle / self.fixed.blades.max_angle
    }

    /// The wedge between the blades.
    pub fn mouth(&self) -> Mouth {
        Mouth::sized(&self.now.gripper, self.fixed.blades.length)
    }

    /// Jaws that press take hold of what is between them; jaws that are told to open let go.
    fn grasp(&mut self, world: &mut World, events: &mut Vec<CellEvent>) {
        let (wanted, opening) = (self.now.wanted.jaw(), self.opening());
        if let Some(held) = &self.now.held {
            let opens = wanted > held.opening + MEANT;
            let lost = self.now.design == GraspDesign::Friction && self.mouth().tissue_of(world, held.organ).is_none();
            if opens || lost {
                self.let_go(world, events);
            }
            return;
        }
        let presses =
            opening_force(&self.now.gripper, Tools::of(0), &self.now.forces) >= PRESSING * self.now.jaw.budget;
        if wanted < opening - MEANT && presses {
            self.take_hold(world, events);
        }
    }

    fn take_hold(&mut self, world: &mut World, events: &mut Vec<CellEvent>) {
        let (mouth, opening) = (self.mouth(), self.opening());
        let Self { fixed, now, .. } = self;
        let Some((organ, tissue)) = mouth.fullest(world) else { return };
        let Some(clasp) = Clasp::on(world, organ, &mouth, tissue, reach_into(world, organ), now.design) else { return };
        let pose = now.gripper.pose;
        let grasp = now.design.grasp(world, organ, &clasp.nodes, fixed.tools, &pose, now.jaw.budget);
        let snap = grasp.as_ref().map(|g| Snap::of(world, g, &pose)).unwrap_or_default();
        now.held = Some(Held { organ, s: clasp.s, hold: Hold::new(world, organ, clasp.nodes, &pose), opening });
        world.state.grasps.extend(grasp);
        events.push(CellEvent::Attached {
            arm: fixed.side,
            organ: world.model.bodies()[organ].name().to_owned(),
            s: clasp.s,
            nodes: snap.nodes,
            snap_mm: 1e3 * snap.most,
        });
    }

    fn let_go(&mut self, world: &mut World, events: &mut Vec<CellEvent>) {
        let tool = self.fixed.tools.gripper;
        world.state.grasps.retain(|g| g.tool != tool);
        // Bare blades are in tissue that would be dragged along.
        self.now.unhooked |= std::mem::take(&mut self.now.bare);
        if self.now.held.take().is_some() {
            events.push(CellEvent::Released { arm: self.fixed.side });
        }
    }

    /// Blades that close through tissue cut it, after they were open with tissue between them all the while (SPEC E1): the organ, and the cutter as wide as it was open.
    ///
    /// What closes past each other with edges shears: it goes through what lies between instead of pressing it flat. So from the closing on tissue does not feel the blades, until none is left where the
    /// open blades were and they are out of all organs. The shaft is felt all the while.
    fn cut(&mut self, world: &World) -> Option<(usize, Gripper)> {
        let length = self.fixed.blades.length;
        let between = |open: &Gripper| Mouth::sized(open, length).fullest(world).map(|(organ, _)| organ);
        if let Some(jaw_angle) = self.now.shears
            && between(&Gripper { jaw_angle, ..self.now.gripper }).is_none()
            && self.pierced_by(world, 3).is_none()
        {
            self.now.shears = None;
        }
        let now = &mut self.now;
        if let Some(open) = now.scissors.follow(&now.gripper) {
            return between(&open).map(|organ| (organ, open));
        }
        if let Some(jaw_angle) = now.scissors.opened().filter(|_| now.jaw_rate < 0.0) {
            if between(&Gripper { jaw_angle, ..now.gripper }).is_some() {
                now.shears = Some(jaw_angle);
            } else {
                now.scissors.rest();
            }
        }
        None
    }

    /// The organ that is held has been cut into `pieces`; `was` is the centroid of what is held before [m].
    pub fn follow_cut(&mut self, world: &World, pieces: &[Piece], was: DVec3) {
        let Moving { held, gripper, .. } = &mut self.now;
        if let Some(held) = held {
            held.hold.follow(world, pieces, &gripper.pose, was);
            held.organ = held.hold.tissue().0;
        }
    }

    /// The tissue between the blades now, and its organ; of blades that shear, between them as wide as they were.
    pub fn tissue(&self, world: &World) -> Option<(usize, Mouthful)> {
        let jaw_angle = self.now.shears.unwrap_or(self.now.gripper.jaw_angle);
        Mouth::sized(&Gripper { jaw_angle, ..self.now.gripper }, self.fixed.blades.length).fullest(world)
    }

    /// Centroid of what is held [m]; zero of nothing.
    pub fn held_now(&self, world: &World) -> DVec3 {
        self.now.held.as_ref().map_or(DVec3::ZERO, |h| h.hold.now(world))
    }

    /// How far jaws and what they hold have gone since they closed.
    pub fn moved(&self, world: &World) -> Option<Moved> {
        self.now.held.as_ref().map(|h| h.hold.moved(world, &self.now.gripper.pose))
    }

    /// What is measured at the end of a control period.
    pub fn observe(&self) -> ArmObservation {
        let Self { fixed, now, .. } = self;
        let contact: DVec3 = now.forces.iter().map(|f| f.contact.force).sum();
        let constraint: DVec3 = now.forces.iter().map(|f| f.constraint.force).sum();
        let sum = |part: fn(&ToolForce) -> trocar_tissue::Wrench| {
            now.forces
                .iter()
                .map(part)
                .fold(Wrench::default(), |sum, w| sum + Wrench { force: w.force, torque: w.torque })
        };
        let kind = self.force_kind();
        let wrench = match kind {
            ForceKind::Constraint => sum(|f| f.constraint),
            ForceKind::Contact => sum(|f| f.contact),
        };
        let (measured, rates) = self.manipulator.coordinates();
        let rejected_rotation = match now.wanted {
            Wanted::Coordinates(_, rejected) => rejected,
            Wanted::Joints(_) => DVec3::ZERO,
        };
        ArmObservation {
            side: fixed.side,
            coordinates: Coordinates { jaw: self.opening(), ..measured },
            rates: [rates[0], rates[1], rates[2], rates[3], now.jaw_rate],
            tip: self.manipulator.measured_cp(),
            rcm_deviation: self.manipulator.rcm_deviation(),
            rcm_peak: now.rcm_peak,
            rcm_over_threshold: now.rcm_peak > fixed.rcm[0],
            rcm_over_abort: now.rcm_peak > fixed.rcm[1],
            tilt: self.manipulator.tilt(),
            commanded: now.commanded,
            rejected_rotation,
            held_back: now.held_back,
            guarded: now.guarded,
            force: TaggedForce { kind, wrench },
            contact,
            constraint,
            jaw_force: opening_force(&now.gripper, Tools::of(0), &now.forces),
            load_limited: now.exchange.limited,
            attached: now.held.is_some(),
        }
    }

    /// Contact, or the constraint of a latched grasp.
    pub fn force_kind(&self) -> ForceKind {
        match &self.now.held {
            Some(_) if self.now.design != GraspDesign::Friction => ForceKind::Constraint,
            _ => ForceKind::Contact,
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

impl Moving {
    /// What watches its blades.
    pub fn scissors(&self) -> Scissors {
        self.scissors
    }

    /// The opening that is asked for.
    pub fn wanted_jaw(&self) -> f64 {
        self.wanted.jaw()
    }

    /// Asks for an opening.
    pub fn set_wanted_jaw(&mut self, opening: f64) {
        match &mut self.wanted {
            Wanted::Coordinates(c, _) => c.jaw = opening,
            Wanted::Joints(jaw) => *jaw = opening,
        }
    }

    /// Every number of the state, for its hash; the manipulator's and the tissue's are not among them.
    pub fn numbers(&self) -> Vec<f64> {
        let (wanted, rejected) = match self.wanted {
            Wanted::Coordinates(c, rejected) => (c.to_action().to_vec(), rejected),
            Wanted::Joints(jaw) => (vec![jaw], DVec3::ZERO),
        };
        let pose = &self.gripper.pose;
        let mut all = wanted;
        all.extend(rejected.to_array());
        all.extend(self.commanded.to_action());
        all.extend(pose.translation.to_array());
        all.extend(pose.rotation.to_array());
        all.extend([self.gripper.jaw_angle, self.jaw_rate, self.rcm_peak, self.shears.unwrap_or(-1.0)]);
        all.extend(self.exchange.numbers());
        all.extend(self.guard.numbers());
        all.extend(self.jaw.numbers());
        all.extend(self.scissors.numbers());
        for f in &self.forces {
            for w in [f.contact, f.constraint] {
                all.extend(w.force.to_array());
                all.extend(w.torque.to_array());
            }
            all.extend([f.pressing, f.touching as f64]);
        }
        all.extend(
            [
                self.unhooked,
                self.bare,
                self.held_back,
                self.guarded,
                self.rcm_told[0],
                self.rcm_told[1],
                self.held.is_some(),
            ]
            .map(|b| f64::from(u8::from(b))),
        );
        all.push(GraspDesign::ALL.iter().position(|d| *d == self.design).unwrap_or(0) as f64);
        if let Some(held) = &self.held {
            all.extend([held.organ as f64, held.s, held.opening]);
            all.extend(held.hold.numbers());
        }
        all
    }
}
