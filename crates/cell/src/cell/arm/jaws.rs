//! Jaws of an arm: they grasp and release the tissue between them.

use super::{ArmState, ArmUnit, Held};
use crate::blades::{Tools, blade_forces, opening_force};
use crate::cell::report::CellEvent;
use crate::grasp_candidate::{GraspCandidate, Snap};
use crate::hold::{Hold, Moved};
use crate::target::reach_into;
use crate::{GraspDesign, Gripper, JawForces, JawRegion, TissueInJaws, World};
use glam::DVec3;
use trocar_tissue::Piece;

/// Jaws that press with this share of their force have closed on tissue.
const PRESSING: f64 = 0.95;

/// Jaws that a command stops short of closed hold with the force of the tissue on them (N), at
/// least this ...
const MIN_GRIP: f64 = 0.02;

/// ... after they have stood there for this many tissue frames (0.1 s); jaws that move close on.
const STANDING_FRAMES: u32 = 6;

/// Each blade presses with at least this share of the jaws' force where they hold something. A
/// blade that alone meets something stops the jaws, too; what lies between them is then loose.
const BOTH_PRESS: f64 = 0.1;

/// Openings that differ by less are the same.
const SAME_OPENING: f64 = 1e-9;

/// Minimum difference between commanded and present opening that closes or opens the jaws.
const LEAST_COMMANDED_MOTION: f64 = 0.02;

impl ArmUnit {
    /// The region between the blades.
    pub fn jaw_region(&self) -> JawRegion {
        JawRegion::sized(&self.state.gripper, self.model.blades.length)
    }

    /// Jaws that press grasp the tissue between them, with their whole force or with the force they
    /// have where their command stops them; jaws that are commanded to open release it.
    pub fn grasp(&mut self, world: &mut World, events: &mut Vec<CellEvent>) {
        let (wanted, opening) = (self.state.wanted.jaw(), self.opening());
        let force = opening_force(&self.state.gripper, Tools::of(0), &self.state.forces);
        self.count_standing(wanted, opening, force);
        if let Some(held) = &self.state.held {
            let opens = wanted > held.opening + LEAST_COMMANDED_MOTION;
            let lost =
                self.state.design == GraspDesign::Friction && self.jaw_region().tissue_of(world, held.organ).is_none();
            if opens || lost {
                self.let_go(world, events);
            }
            return;
        }
        let budget = self.state.jaw.budget;
        if wanted < opening - LEAST_COMMANDED_MOTION && force >= PRESSING * budget {
            self.take_hold(budget, world, events);
        } else if self.state.standing >= STANDING_FRAMES {
            self.take_hold(force.min(budget), world, events);
        }
    }

    /// Counts the frames for which jaws that closed on tissue have stood at their commanded
    /// opening, or just short of it because they press with their whole force.
    fn count_standing(&mut self, wanted: f64, opening: f64, force: f64) {
        let state = &mut self.state;
        let at_it = (wanted - opening).abs() < SAME_OPENING;
        let short_of_it = wanted < opening && force >= PRESSING * state.jaw.budget;
        // Shut blades hold nothing.
        let stopped = wanted > 0.0 && (at_it || short_of_it);
        let there = state.held.is_none() && stopped && force >= MIN_GRIP;
        state.standing = match state.standing {
            0 => u32::from(there && state.jaw_rate < 0.0),
            frames if there => frames + 1,
            _ => 0,
        };
    }

    /// Grasps the tissue between the blades, which press on it with `closing` (N).
    fn take_hold(&mut self, closing: f64, world: &mut World, events: &mut Vec<CellEvent>) {
        let (region, opening) = (self.jaw_region(), self.opening());
        let Self { model, state, .. } = self;
        let on_blades = blade_forces(&state.gripper, Tools::of(0), &state.forces);
        let closing_force_n = 0.5 * on_blades.iter().sum::<f64>();
        if on_blades.into_iter().any(|force| force < BOTH_PRESS * closing_force_n) {
            return;
        }
        let Some((organ, tissue)) = region.fullest(world) else { return };
        let reach = reach_into(world, organ);
        let Some(candidate) = GraspCandidate::on(world, organ, &region, tissue, reach, state.design) else { return };
        let pose = state.gripper.pose;
        let displaced_mm = 1e3 * candidate.displaced(world, organ);
        let forces = JawForces { closing, tearing: model.tear_force };
        let grasp = state.design.grasp(world, organ, &candidate.nodes, model.tools, &pose, forces);
        let snap = grasp.as_ref().map(|g| Snap::of(world, g, &pose)).unwrap_or_default();
        let hold = Hold::new(world, organ, candidate.nodes, &pose);
        state.held = Some(Held { organ, s: candidate.s, hold, opening });
        world.state.grasps.extend(grasp);
        events.push(CellEvent::Attached {
            arm: model.side,
            organ: world.model.bodies()[organ].name().to_owned(),
            s: candidate.s,
            nodes: snap.nodes,
            snap_mm: 1e3 * snap.most,
            snap_mean_mm: 1e3 * snap.mean,
            displaced_mm,
            gap_mm: 1e3 * tissue.gap,
            closing_force_n,
        });
    }

    pub fn let_go(&mut self, world: &mut World, events: &mut Vec<CellEvent>) {
        let tool = self.model.tools.gripper;
        world.state.grasps.retain(|g| g.tool != tool);
        if self.state.held.take().is_some() {
            self.state.design = self.model.design;
            events.push(CellEvent::Released { arm: self.model.side });
        }
    }

    /// Follows a cut of the held organ into `pieces`; `was` is the centroid of the held nodes
    /// before (m).
    pub fn follow_cut(&mut self, world: &World, pieces: &[Piece], was: DVec3) {
        let ArmState { held, gripper, .. } = &mut self.state;
        if let Some(held) = held {
            held.hold.follow(world, pieces, &gripper.pose, was);
            held.organ = held.hold.tissue().0;
        }
    }

    /// The tissue between the blades now, and its organ; for shearing blades, between them as wide
    /// as they were.
    pub fn tissue(&self, world: &World) -> Option<(usize, TissueInJaws)> {
        let jaw_angle = self.state.shears.unwrap_or(self.state.gripper.jaw_angle);
        JawRegion::sized(&Gripper { jaw_angle, ..self.state.gripper }, self.model.blades.length).fullest(world)
    }

    /// Centroid of the held tissue (m); zero if nothing is held.
    pub fn held_now(&self, world: &World) -> DVec3 {
        self.state.held.as_ref().map_or(DVec3::ZERO, |h| h.hold.now(world))
    }

    /// Whether the next frame is the first of the grasp.
    pub fn is_newly_attached(&self, world: &World) -> bool {
        self.state.held.as_ref().is_some_and(|h| h.hold.is_new(world))
    }

    /// Body and number of the nodes that are held.
    pub fn held_nodes(&self) -> Option<(usize, usize)> {
        self.state.held.as_ref().map(|h| (h.organ, h.hold.tissue().1.len()))
    }

    /// The motion of jaws and held tissue since they closed.
    pub fn moved(&self, world: &World) -> Option<Moved> {
        self.state.held.as_ref().map(|h| h.hold.moved(world, &self.state.gripper.pose))
    }
}
