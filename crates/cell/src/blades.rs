//! The colliders of a gripper's blades and shaft, which touch tissue.
//!
//! A gripper is three tools of the tissue's step: its own frame, which carries the shaft and the
//! held tissue, and a frame for each blade ([`Gripper::blade`]). A blade is three thin capsules
//! along it. With their rest offset of 1.5 mm (paper section IV-C) they fill the visible blade: 5
//! mm wide, 3.2 mm thick, and an inner face that is flat to 0.07 mm. A cutter's blade is a single
//! capsule.

use crate::Gripper;
use crate::gripper::{BLADE_TIP, BLADE_WIDTH, JAW_REGION_BEGIN, MAX_ANGLE, SHAFT_LENGTH, SHAFT_RADIUS};
use glam::DVec3;
use trocar_tissue::{Collider, Shape, ToolForce};

/// The indices of a gripper's three tools among the tools of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tools {
    /// The gripper's own frame.
    pub gripper: usize,
    /// The blade that opens towards +y, and the one towards -y.
    pub blades: [usize; 2],
}

impl Tools {
    /// The tools of gripper `k`: three for each gripper, in the order of [`Gripper::motions_to`].
    pub const fn of(k: usize) -> Self {
        Self { gripper: 3 * k, blades: [3 * k + 1, 3 * k + 2] }
    }

    /// The blades, each with the side of the closing plane to which it opens.
    pub fn sides(self) -> [(usize, f64); 2] {
        [(self.blades[0], 1.0), (self.blades[1], -1.0)]
    }

    /// The forces on the three tools; zero where `forces` has none.
    pub fn forces(self, forces: &[ToolForce]) -> [ToolForce; 3] {
        self.all().map(|t| forces.get(t).copied().unwrap_or_default())
    }

    /// The three tools.
    pub(crate) fn all(self) -> [usize; 3] {
        [self.gripper, self.blades[0], self.blades[1]]
    }
}

/// Size and surface of an instrument's blades.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blades {
    /// Length beyond the pivot (m).
    pub length: f64,
    /// Ridges across a blade: three make it 5 mm wide, one is a cutter's.
    pub ridges: usize,
    /// Widest angle between the blades (rad).
    pub max_angle: f64,
    /// Radius of the shaft (m).
    pub shaft_radius: f64,
    /// Length of the shaft behind the pivot that tissue may touch (m).
    pub shaft_length: f64,
    /// Distance at which tissue rests on the blades (m).
    pub rest_offset: f64,
    /// Coulomb friction on tissue.
    pub friction: f64,
}

impl Default for Blades {
    /// The paper's grasper.
    fn default() -> Self {
        Self {
            length: BLADE_TIP,
            ridges: 3,
            max_angle: MAX_ANGLE,
            shaft_radius: SHAFT_RADIUS,
            shaft_length: SHAFT_LENGTH,
            rest_offset: REST_OFFSET,
            friction: FRICTION,
        }
    }
}

impl Blades {
    /// Distance from the pivot to the middle of the blades (m): where forces of the jaws act.
    pub fn lever(&self) -> f64 {
        0.5 * (JAW_REGION_BEGIN + self.length)
    }
}

/// Distance at which tissue rests on an instrument's tip (m).
pub const REST_OFFSET: f64 = 0.0015;

/// Coulomb friction of the instrument on tissue (paper section IV-C).
pub const FRICTION: f64 = 0.6;

/// Radius of a blade's ridges (m): nearly zero, because the rest offset makes the blade's
/// thickness.
const RIDGE: f64 = 0.0001;

/// The colliders of one gripper of the paper's size whose frames are tools 0 to 2.
pub fn colliders() -> Vec<Collider> {
    Blades::default().colliders(Tools::of(0))
}

impl Blades {
    /// The colliders of an instrument whose frames are `tools`.
    pub fn colliders(&self, tools: Tools) -> Vec<Collider> {
        let inset = RIDGE + self.rest_offset;
        let mut all = Vec::with_capacity(7);
        for (tool, side) in tools.sides() {
            for ridge in 0..self.ridges {
                // -1, 0 and 1 for three ridges; 0 for one.
                let share = ridge as f64 - 0.5 * (self.ridges as f64 - 1.0);
                let aside = share * (0.5 * BLADE_WIDTH - inset).max(0.0);
                let (begin, end) = (JAW_REGION_BEGIN + inset, self.length - inset);
                let middle = 0.5 * (begin + end);
                let at = |x: f64| DVec3::new(x, side * inset, aside);
                all.push(Collider {
                    name: format!("blade {tool}"),
                    tool,
                    shape: Shape::Capsule { ends: [at(begin.min(middle)), at(end.max(middle))], radius: RIDGE },
                    rest_offset: self.rest_offset,
                    friction: self.friction,
                });
            }
        }
        // The shaft ends before the region between the jaws.
        let ends =
            [DVec3::new(-self.shaft_length, 0.0, 0.0), DVec3::new(JAW_REGION_BEGIN - self.shaft_radius, 0.0, 0.0)];
        let shape = Shape::Capsule { ends, radius: self.shaft_radius };
        let (tool, friction) = (tools.gripper, self.friction);
        all.push(Collider { name: "shaft".into(), tool, shape, rest_offset: 0.0, friction });
        all
    }
}

/// Force with which tissue pushes the blades of `gripper` apart (N): the mean over both blades of
/// the outward force, as one rod that drives both would measure it. `forces` are those of all tools
/// of the step, `tools` the indices of the gripper's; 0 without forces.
pub fn opening_force(gripper: &Gripper, tools: Tools, forces: &[ToolForce]) -> f64 {
    0.5 * blade_forces(gripper, tools, forces).iter().sum::<f64>()
}

/// Force with which tissue pushes each blade of `gripper` outwards (N), in the order of
/// [`Tools::blades`]. Arguments are those of [`opening_force`].
pub fn blade_forces(gripper: &Gripper, tools: Tools, forces: &[ToolForce]) -> [f64; 2] {
    tools.sides().map(|(tool, side)| {
        let outwards = gripper.blade(side).rotation * (side * DVec3::Y);
        forces.get(tool).map_or(0.0, |f| f.contact.force.dot(outwards))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_core::{Pose, Wrench};

    /// Distance of `p` (m, gripper frame) from the nearest surface at which tissue rests.
    fn rest_distance(gripper: &Gripper, p: DVec3) -> f64 {
        let frames = [gripper.pose, gripper.blade(1.0), gripper.blade(-1.0)];
        let to = |c: &Collider| c.shape.nearest(frames[c.tool].inverse().transform(p)).distance - c.rest_offset;
        colliders().iter().map(to).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn inner_faces_meet_on_the_closing_plane_and_bound_the_wedge() {
        let closed = Gripper { pose: Pose::IDENTITY, jaw_angle: 0.0 };
        for x in [0.004, 0.010, 0.019] {
            for z in [-0.0009, 0.0, 0.0005] {
                let d = rest_distance(&closed, DVec3::new(x, 0.0, z));
                assert!((0.0..0.0001).contains(&(d + 1e-9)), "{d} at {x}, {z}");
            }
        }
        let open = Gripper { pose: Pose::IDENTITY, jaw_angle: 0.6 };
        let r = 0.012;
        let gap = open.half_gap(r);
        let on_face = DVec3::new((r * r - gap * gap).sqrt(), gap, 0.0);
        assert!(rest_distance(&open, on_face).abs() < 1e-9);
        assert!(rest_distance(&open, on_face - 0.001 * DVec3::Y) > 0.0009);
        assert!(rest_distance(&open, on_face + 0.001 * DVec3::Y) < -0.0009);
    }

    #[test]
    fn blades_end_where_the_mouth_does() {
        let closed = Gripper { pose: Pose::IDENTITY, jaw_angle: 0.0 };
        let blade = |p: DVec3| {
            let to = |c: &Collider| c.shape.nearest(p).distance - c.rest_offset;
            colliders().iter().filter(|c| c.tool == 1).map(to).fold(f64::INFINITY, f64::min)
        };
        assert!(blade(DVec3::new(0.0211, 0.0016, 0.0)) > 0.0 && blade(DVec3::new(0.0209, 0.0016, 0.0)) < 0.0);
        assert!(blade(DVec3::new(0.0019, 0.0016, 0.0)) > 0.0);
        assert!(blade(DVec3::new(0.010, 0.0016, 0.00255)) > 0.0 && blade(DVec3::new(0.010, 0.0016, 0.00245)) < 0.0);
        assert!(rest_distance(&closed, DVec3::new(-0.02, 0.0024, 0.0)) < 0.0, "the shaft is there");
    }

    #[test]
    fn a_cutters_blades_meet_on_the_closing_plane_too() {
        let all = Blades { ridges: 1, ..Blades::default() }.colliders(Tools::of(1));
        assert_eq!(all.iter().map(|c| c.tool).collect::<Vec<_>>(), [4, 5, 3]);
        let d = all[0].shape.nearest(DVec3::new(0.01, 0.0, 0.0)).distance - all[0].rest_offset;
        assert!(d.abs() < 1e-12, "{d}");
    }

    #[test]
    fn the_opening_force_is_what_pushes_outwards() {
        let gripper = Gripper::over(DVec3::new(0.1, 0.0, 0.2), DVec3::Z, DVec3::X, 0.5);
        let push = |side: f64, newtons: f64| {
            let force = gripper.blade(side).rotation * (side * newtons * DVec3::Y);
            ToolForce { contact: Wrench { force, torque: DVec3::ZERO }, ..ToolForce::default() }
        };
        let forces = [ToolForce::default(), push(1.0, 2.0), push(-1.0, 1.0)];
        assert!((opening_force(&gripper, Tools::of(0), &forces) - 1.5).abs() < 1e-12);
        let [plus, minus] = blade_forces(&gripper, Tools::of(0), &forces);
        assert!((plus - 2.0).abs() < 1e-12 && (minus - 1.0).abs() < 1e-12);
        assert_eq!(opening_force(&gripper, Tools::of(0), &[]), 0.0);
    }
}
