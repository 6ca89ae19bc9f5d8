//! Where an arm's instrument is among the tissue: what it is near, what it has gone into, and that it lets go.

use super::Station;
use crate::World;
use crate::cell::clearance::Rod;
use crate::cell::pierce::pierced;
use crate::cell::report::CellEvent;
use glam::DVec3;
use trocar_core::Pose;
use trocar_robot::wrench::ForceKind;
use trocar_tissue::Shape;

impl Station {
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
    pub(super) fn pierced_by(&self, world: &World, count: usize) -> Option<usize> {
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
}
