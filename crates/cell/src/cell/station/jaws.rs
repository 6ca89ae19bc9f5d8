//! What an arm's jaws and blades do to the tissue between them: take hold, let go, cut.

use super::{Held, MEANT, Moving, PRESSING, Station};
use crate::blades::{Tools, opening_force};
use crate::cell::report::CellEvent;
use crate::clasp::{Clasp, Snap};
use crate::hold::{Hold, Moved};
use crate::target::reach_into;
use crate::{GraspDesign, Gripper, Mouth, Mouthful, World};
use glam::DVec3;
use trocar_tissue::Piece;

impl Station {
    /// Jaw opening, 0 to 1.
    pub(super) fn opening(&self) -> f64 {
        self.now.gripper.jaw_angle / self.fixed.blades.max_angle
    }

    /// The wedge between the blades.
    pub fn mouth(&self) -> Mouth {
        Mouth::sized(&self.now.gripper, self.fixed.blades.length)
    }

    /// Jaws that press take hold of what is between them; jaws that are told to open let go.
    pub(super) fn grasp(&mut self, world: &mut World, events: &mut Vec<CellEvent>) {
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

    pub(super) fn let_go(&mut self, world: &mut World, events: &mut Vec<CellEvent>) {
        let tool = self.fixed.tools.gripper;
        world.state.grasps.retain(|g| g.tool != tool);
        // Bare blades are in tissue that would be dragged along.
        self.now.unhooked |= std::mem::take(&mut self.now.bare);
        if self.now.held.take().is_some() {
            events.push(CellEvent::Released { arm: self.fixed.side });
        }
    }

    /// Blades that close through tissue cut it, after they were open with tissue between them all
    /// the while (SPEC E1): the organ, and the cutter as wide as it was open.
    ///
    /// What closes past each other with edges shears: it goes through what lies between instead of
    /// pressing it flat. So from the closing on tissue does not feel the blades, until none is left
    /// where the open blades were and they are out of all organs. The shaft is felt all the while.
    pub(super) fn cut(&mut self, world: &World) -> Option<(usize, Gripper)> {
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

    /// The organ that is held has been cut into `pieces`; `was` is the centroid of what is held
    /// before [m].
    pub fn follow_cut(&mut self, world: &World, pieces: &[Piece], was: DVec3) {
        let Moving { held, gripper, .. } = &mut self.now;
        if let Some(held) = held {
            held.hold.follow(world, pieces, &gripper.pose, was);
            held.organ = held.hold.tissue().0;
        }
    }

    /// The tissue between the blades now, and its organ; of blades that shear, between them as wide
    /// as they were.
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
}
