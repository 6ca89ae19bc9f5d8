//! Queries about an arm's instrument and the tissue near it.

use super::ArmUnit;
use crate::cell::inside::{Crossing, crossings};
use crate::cell::solid::Rod;
use crate::{Gripper, World};
use glam::DVec3;
use trocar_core::Pose;
use trocar_tissue::Shape;

impl ArmUnit {
    /// Whether the instrument may be the cause of the tissue's strain.
    pub fn meets_tissue(&self) -> bool {
        self.state.held.is_some() || self.state.forces.iter().any(|f| f.touching > 0)
    }

    /// Distance of a point from the instrument's axis, from the blades' tips up its shaft (m).
    pub fn distance(&self, p: DVec3) -> f64 {
        let q = self.state.gripper.pose.inverse().transform(p);
        let along = q.x.clamp(-self.model.blades.shaft_length, self.model.blades.length);
        q.distance(along * DVec3::X)
    }

    /// Whether the jaws hold tissue of that organ.
    pub fn holds(&self, organ: usize) -> bool {
        self.state.held.as_ref().is_some_and(|held| held.organ == organ)
    }

    /// Its capsules where they are after the last frame of tissue. The radius includes the rest
    /// offset, which is the blades' thickness.
    pub fn rods(&self) -> Vec<Rod> {
        self.rods_at(self.state.gripper.pose)
    }

    /// The same with the tip frame at `pose`.
    pub fn rods_at(&self, pose: Pose) -> Vec<Rod> {
        self.rods_of(&Gripper { pose, ..self.state.gripper })
    }

    /// The same for any place and angle of the jaws.
    pub fn rods_of(&self, gripper: &Gripper) -> Vec<Rod> {
        let rods = self.frames_of(gripper).into_iter().enumerate().flat_map(|(number, (tool, frame))| {
            let parts = self.model.parts.iter().filter(move |part| part.tool == tool);
            parts.filter_map(move |part| match part.shape {
                Shape::Capsule { ends, radius } => {
                    let ends = ends.map(|p| frame.transform(p));
                    Some(Rod { ends, radius: radius + part.rest_offset, part: number })
                }
                _ => None,
            })
        });
        rods.collect()
    }

    /// The instrument's tools and their poses, the shaft first.
    fn frames_of(&self, gripper: &Gripper) -> [(usize, Pose); 3] {
        let [one, two] = self.model.tools.sides().map(|(tool, side)| (tool, gripper.blade(side)));
        [(self.model.tools.gripper, gripper.pose), one, two]
    }

    /// The organs that contain a part of the instrument, each with a place inside (m). Tissue that
    /// the jaws hold or the blades shear does not count, and neither do organs that the instrument
    /// has punctured.
    pub fn pierces(&self, world: &World) -> Vec<(usize, DVec3)> {
        let felt = if self.state.shears.is_some() { 1 } else { 3 };
        let mut organs = self.inside_organs(world, felt);
        organs.retain(|(organ, _)| !world.is_punctured(*organ, self.model.tools.gripper));
        organs
    }

    /// The organs that one of the first `count` tools is inside of: the shaft, then the blades;
    /// each with a place there (m).
    pub fn inside_organs(&self, world: &World, count: usize) -> Vec<(usize, DVec3)> {
        let Self { model, state, .. } = self;
        let mut found: Vec<(usize, DVec3)> = Vec::new();
        for (tool, frame) in self.frames_of(&state.gripper).into_iter().take(count) {
            let axes = model.parts.iter().filter(|part| part.tool == tool).filter_map(|part| match part.shape {
                Shape::Capsule { ends, .. } => Some(ends.map(|p| frame.transform(p))),
                _ => None,
            });
            let axes: Vec<[DVec3; 2]> = axes.collect();
            for organ in (0..world.model.bodies().len()).filter(|organ| !self.holds(*organ)) {
                if let Some(Crossing { segment, part: [begin, end], .. }) = crossings(world, organ, &axes).first()
                    && !found.iter().any(|(known, _)| *known == organ)
                {
                    let [from, to] = axes[*segment];
                    found.push((organ, from.lerp(to, 0.5 * (begin + end))));
                }
            }
        }
        found
    }
}
