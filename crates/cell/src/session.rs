//! A grasp-lift in progress, frame by frame.

use crate::blades::{Tools, colliders, opening_force};
use crate::calm::Calm;
use crate::clasp::{Clasp, Snap};
use crate::hold::{Hold, Moved};
use crate::jaw::Jaw;
use crate::measure::{HELD_FOLLOW_RATIO, HELD_SLIP_MM, SETTLED_SPEED};
use crate::resection::{CARRY, Resection};
use crate::target::Target;
use crate::world::GRAVITY;
use crate::{
    CutOrgan, FRAME, GraspDesign, GraspLift, GraspLiftRun, Gripper, MAX_ANGLE, Mouth, Phase, Result, Sample, Snapshot,
    Summary, Surroundings, World,
};
use glam::DVec3;
use std::time::{Duration, Instant};
use trocar_specimen::Specimen;
use trocar_tissue::{Event, Load, State, StepReport};

/// The one gripper's.
const TOOLS: Tools = Tools::of(0);

/// Height from which the gripper approaches [m].
const APPROACH_HEIGHT: f64 = 0.03;

/// What the jaws do in a frame.
enum JawCommand {
    /// Turn to an angle [rad].
    To(f64),
    /// Press.
    Squeeze,
    /// Stay.
    Stay,
}

/// Where a [`Session`] is in an instant.
#[derive(Clone, Debug)]
pub struct Moment {
    state: State,
    gripper: Gripper,
}

/// A [`GraspLift`] in progress: [`advance`](Self::advance) until it is over, then
/// [`finish`](Self::finish).
pub struct Session<'a> {
    task: &'a GraspLift,
    organ: usize,
    world: World,
    /// Where every node was at first, organ by organ [m], and whether it is pinned.
    pins: Vec<(Vec<DVec3>, Vec<bool>)>,
    phases: Vec<Phase>,
    /// Place in `phases`, and frames of that phase that are over.
    phase: usize,
    frame_of_phase: usize,
    calm: Option<Calm>,
    target: Option<Target>,
    hold: Option<Hold>,
    gripper: Gripper,
    /// Where the gripper went to the side in the drag that is over.
    dragged: f64,
    jaw: Jaw,
    resection: Option<Resection>,
    frame: usize,
    stepping: Duration,
    /// Loads on nodes and the gripper's place in the next frame, if they are given.
    given: Option<(Vec<Load>, Gripper)>,
    last_step: Duration,
    last_iterations: usize,
    summary: Summary,
    samples: Vec<Sample>,
    snapshots: Vec<Snapshot>,
}

impl<'a> Session<'a> {
    /// Prepares `task` on `specimen`.
    ///
    /// # Errors
    /// Names the organ that is not there or the option out of range.
    pub fn new(task: &'a GraspLift, specimen: &Specimen) -> Result<Self> {
        task.validate()?;
        let organ = task.choose_organ(specimen)?;
        let tools = if task.contact { colliders() } else { Vec::new() };
        let mut surroundings = Surroundings::default();
        surroundings.body_contact = surroundings.body_contact.filter(|_| task.contact);
        let world = World::surrounded(specimen, &surroundings, tools, task.schedule, task.threads)?;
        let summary = Summary {
            organ: specimen.organs[organ].name.clone(),
            at: task.at,
            design: task.design.name(),
            jaw_force_n: task.jaw_force,
            approach_offset_mm: task.approach_offset * 1e3,
            inverted_rest: specimen.organs.iter().map(|o| o.body.inverted()).sum(),
            min_volume_ratio: 1.0,
            ..Summary::default()
        };
        // Out of the way of every organ until there is a target.
        let heights = specimen.organs.iter().flat_map(|o| &o.body.vertices).map(|p| p.dot(world.up));
        let top = heights.fold(f64::NEG_INFINITY, f64::max);
        let middle = world.state.centroid(&world.model, organ, &[0]);
        let above = middle + (top - middle.dot(world.up) + 0.1) * world.up;
        let gripper = Gripper::over(above, world.up, DVec3::X, MAX_ANGLE);
        let of = |k: usize| (world.state.positions(&world.model, k), world.model.bodies()[k].pinned().to_vec());
        let pins = (0..world.model.bodies().len()).map(of).collect();
        let body = &world.model.bodies()[organ];
        let organ_weight_n = GRAVITY * (0..body.len()).map(|i| body.mass(i)).sum::<f64>();
        let summary = Summary { organ_weight_n, ..summary };
        Ok(Self {
            task,
            organ,
            world,
            pins,
            phases: Phase::sequence(task.regrasp.is_some(), task.lower, task.sever.is_some()),
            phase: 0,
            frame_of_phase: 0,
            calm: None,
            target: None,
            hold: None,
            gripper,
            dragged: 0.0,
            jaw: Jaw::new(task.jaw_force),
            resection: None,
            frame: 0,
            stepping: Duration::ZERO,
            given: None,
            last_step: Duration::ZERO,
            last_iterations: 0,
            summary,
            samples: Vec::new(),
            snapshots: Vec::new(),
        })
    }

    /// Frames of all phases; calming comes on top.
    pub fn frames(&self) -> usize {
        self.phases.iter().map(|p| p.frames()).sum()
    }

    /// Whether organs that did not settle are being calmed.
    pub fn calming(&self) -> bool {
        self.calm.is_some()
    }

    /// Wall time of the stepping in the last frame.
    pub fn last_step(&self) -> Duration {
        self.last_step
    }

    /// The solver's iterations in the last frame, of all organs and substeps.
    pub fn last_iterations(&self) -> usize {
        self.last_iterations
    }

    /// What was measured, frame by frame, so far.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// Nodes and elements of all organs.
    pub fn size(&self) -> (usize, usize) {
        let bodies = self.world.model.bodies();
        (bodies.iter().map(|b| b.len()).sum(), bodies.iter().map(|b| b.tets().len()).sum())
    }

    /// Where all nodes are and how fast, and the gripper.
    pub fn moment(&self) -> Moment {
        Moment { state: self.world.state.clone(), gripper: self.gripper }
    }

    /// Does the frame that `other` has done from the moment `before`: from the same places and
    /// velocities, with the same gripper, under what contact did to nodes at its end. So a run
    /// without contact moves, frame by frame, as one that has it. As [`advance`](Self::advance)
    /// else.
    ///
    /// # Errors
    /// As [`advance`](Self::advance).
    pub fn shadow(&mut self, other: &Session<'_>, before: &Moment) -> Result<bool> {
        self.world.state.copy_motion(&before.state);
        self.gripper = before.gripper;
        self.given = Some((other.world.contact_loads(), other.gripper));
        self.advance()
    }

    /// Largest distance between a node of this run and the same one of another [m].
    pub fn off(&self, other: &Session<'_>) -> f64 {
        1e-3 * self.largest_motion_since(&other.world.state)
    }

    /// Does one frame; false when there is none left, or the run has diverged.
    ///
    /// # Errors
    /// When there is nothing to grasp, or no room for a cut.
    pub fn advance(&mut self) -> Result<bool> {
        if self.summary.diverged {
            return Ok(false);
        }
        if let Some(mut calm) = self.calm.take() {
            if !calm.done() {
                self.step(Phase::Settle, 1.0)?;
                self.summary.calmed_s += FRAME;
                let speed = self.samples.last().map_or(0.0, |s| s.max_speed_m_s);
                calm.after_frame(&mut self.world, speed);
                self.calm = Some(calm);
                return Ok(true);
            }
            self.summary.resting_speed_m_s = self.samples.last().map_or(0.0, |s| s.max_speed_m_s);
            self.next_phase();
        }
        let Some(&phase) = self.phases.get(self.phase) else { return Ok(false) };
        if self.frame_of_phase == 0 {
            self.enter(phase)?;
        }
        self.frame_of_phase += 1;
        self.step(phase, self.frame_of_phase as f64 / phase.frames() as f64)?;
        if self.frame_of_phase == phase.frames() {
            self.leave(phase);
        }
        Ok(true)
    }

    fn next_phase(&mut self) {
        self.phase += 1;
        self.frame_of_phase = 0;
    }

    /// What happens at the instant a phase begins.
    fn enter(&mut self, phase: Phase) -> Result<()> {
        match phase {
            Phase::Approach => {
                let (at, offset) = (self.task.at, self.task.approach_offset);
                let target = Target::choose(&self.world, self.organ, at, offset)?;
                self.gripper = target.open;
                self.gripper.pose.translation += APPROACH_HEIGHT * self.world.up;
                self.target = Some(target);
            }
            Phase::Drag => self.activate(GraspDesign::LivePose),
            Phase::Lift => self.activate(self.task.design),
            Phase::Release | Phase::Open => self.world.state.grasps.clear(),
            Phase::Reach => {
                if let (Some(at), Some(target), Some(hold)) = (self.task.sever, &self.target, &self.hold) {
                    self.resection = Some(Resection::plan(&self.world, hold, at, target.reach)?);
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// What is measured at the instant a phase ends.
    fn leave(&mut self, phase: Phase) {
        let Some(sample) = self.samples.last().copied() else { return };
        let summary = &mut self.summary;
        match phase {
            Phase::Settle => {
                summary.settled_speed_m_s = sample.max_speed_m_s;
                summary.settled = summary.settled_speed_m_s < SETTLED_SPEED;
                self.calm = Some(Calm::new(&self.world, summary.settled));
                return;
            }
            Phase::Drag => self.dragged = self.task.regrasp.unwrap_or(0.0),
            Phase::Hold => {
                summary.lift_mm = sample.tissue_lift_mm;
                summary.slip_mm = sample.slip_mm;
                summary.follow_ratio = sample.tissue_lift_mm / sample.jaw_lift_mm;
                summary.held = summary.attached
                    && !summary.diverged
                    && summary.follow_ratio >= HELD_FOLLOW_RATIO
                    && summary.slip_mm < HELD_SLIP_MM;
            }
            _ => {}
        }
        self.next_phase();
    }

    /// One frame: move the gripper, step the world, measure. `share` of the phase is over at the
    /// frame's end.
    fn step(&mut self, phase: Phase, share: f64) -> Result<()> {
        let given = self.given.take();
        let next = given.as_ref().map_or_else(|| self.gripper_at(phase, share), |(_, gripper)| *gripper);
        let loads = given.as_ref().map_or(&[][..], |(loads, _)| loads);
        let activation = phase == Phase::Lift && self.frame_of_phase == 1;
        let before = activation.then(|| self.world.state.clone());
        let clock = Instant::now();
        let report = self.world.step_under(&self.gripper.motions_to(&next), loads);
        self.last_step = clock.elapsed();
        self.last_iterations = report.iterations;
        self.stepping += self.last_step;
        self.gripper = next;
        self.frame += 1;
        if let Some(before) = before {
            self.summary.activation_step_mm = self.largest_motion_since(&before);
        }
        if let (Some(resection), Some(hold)) = (&mut self.resection, &mut self.hold) {
            let time = self.frame as f64 * FRAME;
            resection.advance(&mut self.world, hold, &self.gripper.pose, phase, share, time)?;
        }
        self.record(phase, &report);
        Ok(())
    }

    /// The gripper's course through a phase; `share` runs from 0 to 1.
    fn gripper_at(&mut self, phase: Phase, share: f64) -> Gripper {
        let Some(target) = &self.target else { return self.gripper };
        let eased = smoothstep(share);
        let lift = self.task.lift;
        let (height, command) = match phase {
            Phase::Settle => (APPROACH_HEIGHT, JawCommand::To(MAX_ANGLE)),
            Phase::Approach => (APPROACH_HEIGHT * (1.0 - eased), JawCommand::To(MAX_ANGLE)),
            Phase::Close => (0.0, JawCommand::Squeeze),
            Phase::Drag => (0.0, JawCommand::Stay),
            Phase::Release | Phase::Open => (0.0, JawCommand::To(MAX_ANGLE)),
            Phase::Lift => (lift * eased, self.while_held()),
            Phase::Hold | Phase::Reach | Phase::Snip => (lift, self.while_held()),
            Phase::Carry => (lift + self.carried() * eased, self.while_held()),
            Phase::Keep => (lift + self.carried(), self.while_held()),
            Phase::Lower => (lift * (1.0 - eased), self.while_held()),
        };
        let aside = if phase == Phase::Drag { self.task.regrasp.unwrap_or(0.0) * eased } else { self.dragged };
        let mut pose = target.open.pose;
        pose.translation += height * self.world.up + pose.rotation * (aside * DVec3::Y);
        let angle = self.gripper.jaw_angle;
        let jaw_angle = match command {
            JawCommand::Stay => angle,
            JawCommand::To(to) => self.jaw.turn_to(angle, to),
            JawCommand::Squeeze => {
                let force = opening_force(&self.gripper, TOOLS, self.world.forces());
                let next = self.jaw.squeeze(angle, force);

                if self.task.contact { next } else { next.max(target.touching_angle) }
            }
        };
        Gripper { pose, jaw_angle }
    }

    /// How far the jaws rise after a cut [m]: not where what they hold still hangs on to the rest.
    fn carried(&self) -> f64 {
        if self.resection.as_ref().is_some_and(Resection::freed) { CARRY } else { 0.0 }
    }

    /// Friction needs jaws that keep pressing; those that hold nodes are locked.
    fn while_held(&self) -> JawCommand {
        match self.task.design {
            GraspDesign::Friction if self.summary.attached => JawCommand::Squeeze,
            _ => JawCommand::Stay,
        }
    }

    /// Closes the grasp on what is between the blades.
    fn activate(&mut self, design: GraspDesign) {
        let Some(target) = &self.target else { return };
        let (world, organ, pose) = (&self.world, self.organ, self.gripper.pose);
        let mouth = Mouth::of(&self.gripper);
        let tissue = mouth.tissue_of(world, organ);
        let clasp = tissue.and_then(|tissue| Clasp::on(world, organ, &mouth, tissue, target.reach, design));
        let summary = &mut self.summary;
        summary.attached = clasp.is_some();
        summary.gap_mm = tissue.map_or(0.0, |tissue| tissue.gap * 1e3);
        summary.closing_force_n = opening_force(&self.gripper, TOOLS, world.forces());
        // Where nothing is held, what was meant to be is followed all the same.
        let (s, nodes) = clasp.map_or((target.cluster.s, target.cluster.nodes.clone()), |c| (c.s, c.nodes));
        summary.at = s;
        let rest = world.model.bodies()[organ].rest_positions();
        let place = |i: u32| world.state.position(&world.model, organ, i as usize);
        let displaced = nodes.iter().map(|i| place(*i).distance(rest[*i as usize]));
        summary.displaced_mm = 1e3 * displaced.sum::<f64>() / nodes.len().max(1) as f64;
        let grasp = || design.grasp(world, organ, &nodes, TOOLS, &pose, self.task.jaw_force);
        let held = if summary.attached { grasp() } else { None };
        let snap = held.as_ref().map(|grasp| Snap::of(world, grasp, &pose)).unwrap_or_default();
        (summary.snap_mm, summary.snap_mean_mm, summary.held_nodes) = (snap.most * 1e3, snap.mean * 1e3, snap.nodes);
        self.hold = Some(Hold::new(world, organ, nodes, &pose));
        self.world.state.grasps = held.into_iter().collect();
    }

    fn record(&mut self, phase: Phase, report: &StepReport) {
        let world = &self.world;
        let moved = self.hold.as_ref().map_or(Moved::default(), |h| h.moved(world, &self.gripper.pose));
        let forces = world.forces();
        let contact: DVec3 = forces.iter().map(|f| f.contact.force).sum();
        let constraint = forces.get(TOOLS.gripper).map_or(DVec3::ZERO, |f| f.constraint.force);
        let sample = Sample {
            time_s: self.frame as f64 * FRAME,
            phase: phase.name(),
            jaw_lift_mm: moved.jaw_lift * 1e3,
            tissue_lift_mm: moved.tissue_lift * 1e3,
            slip_mm: moved.slip * 1e3,
            jaw_angle_deg: self.gripper.jaw_angle.to_degrees(),
            jaw_force_n: opening_force(&self.gripper, TOOLS, forces),
            contact_n: contact.length(),
            constraint_n: constraint.length(),
            max_speed_m_s: report.max_speed,
            inverted: report.inverted,
            min_volume_ratio: report.min_volume_ratio,
        };
        let summary = &mut self.summary;
        for event in world.events() {
            match event {
                Event::Slipped { .. } => summary.slipped += 1,
                Event::Torn { .. } => summary.torn = true,
            }
        }
        summary.yielded_substeps += report.grasp_limited;
        summary.inverted_peak = summary.inverted_peak.max(sample.inverted);
        summary.min_volume_ratio = summary.min_volume_ratio.min(sample.min_volume_ratio);
        summary.peak_speed_m_s = summary.peak_speed_m_s.max(sample.max_speed_m_s);
        summary.peak_contact_n = summary.peak_contact_n.max(sample.contact_n);
        summary.peak_constraint_n = summary.peak_constraint_n.max(sample.constraint_n);
        if let Some(why) = report.divergence {
            summary.diverged = true;
            summary.divergence = Some(why.to_string());
        }
        self.samples.push(sample);
        if let (Some(resection), Some(hold)) = (&mut self.resection, &self.hold) {
            resection.measure(world, hold, &self.gripper.pose, report);
        }
        if self.task.snapshot_every > 0 && self.frame.is_multiple_of(self.task.snapshot_every) {
            let cut = self.resection.as_ref().and_then(Resection::cut);
            self.snapshots.push(Snapshot {
                time_s: sample.time_s,
                phase,
                nodes: (0..self.pins.len()).map(|k| positions(world, k, cut)).collect(),
                gripper: self.gripper,
                cutter: self.resection.as_ref().map(Resection::cutter),
                cut: cut.is_some(),
            });
        }
    }

    /// The run so far in figures.
    pub fn finish(mut self) -> GraspLiftRun {
        let pin_drift_mm = self.pin_drift();
        let summary = &mut self.summary;
        summary.pin_drift_mm = pin_drift_mm;
        summary.simulated_s = self.frame as f64 * FRAME;
        summary.wall_s = self.stepping.as_secs_f64();
        summary.real_time_factor = summary.simulated_s / summary.wall_s;
        summary.state_hash = format!("{:016x}", self.world.state.hash());
        let (sever, cut) = self.resection.map(Resection::finish).unzip();
        summary.sever = sever;
        GraspLiftRun { summary: self.summary, samples: self.samples, snapshots: self.snapshots, cut: cut.flatten() }
    }

    /// Largest distance [mm] that any pinned node has moved since the start.
    fn pin_drift(&self) -> f64 {
        let cut = self.resection.as_ref().and_then(Resection::cut);
        let mut largest: f64 = 0.0;
        for (organ, (then, pinned)) in self.pins.iter().enumerate() {
            let now = positions(&self.world, organ, cut);
            let parent = |i: usize| match cut {
                Some(cut) if cut.organ == organ => cut.parents[i] as usize,
                _ => i,
            };
            for (i, x) in now.iter().enumerate().filter(|(i, _)| pinned[parent(*i)]) {
                largest = largest.max(x.distance(then[parent(i)]));
            }
        }
        largest * 1e3
    }

    /// Largest distance [mm] that any node has moved since `then`, a state of the same model.
    fn largest_motion_since(&self, then: &State) -> f64 {
        let model = &self.world.model;
        let mut largest: f64 = 0.0;
        for organ in 0..model.bodies().len() {
            let (now, then) = (self.world.state.positions(model, organ), then.positions(model, organ));
            for i in 0..now.len() {
                largest = largest.max((now[i] - then[i]).length());
            }
        }
        largest * 1e3
    }
}

/// Where the nodes of organ `organ` of the specimen are now [m], those of a cut organ numbered
/// through its pieces.
fn positions(world: &World, organ: usize, cut: Option<&CutOrgan>) -> Vec<DVec3> {
    match cut {
        Some(cut) if cut.organ == organ => cut.positions(world),
        _ => world.state.positions(&world.model, organ),
    }
}

/// 0 to 1 with zero slope at both ends, so that the tool starts and stops without a jerk.
pub(crate) fn smoothstep(t: f64) -> f64 {
    t * t * (3.0 - 2.0 * t)
}
