//! The region between the blades, and the tissue in it (paper section IV-C).
//!
//! The region is a wedge from 2 to 21 mm beyond the pivot, 5 mm wide, whose half-gap at distance r
//! from the pivot is r sin(theta / 2). Tissue is grasped only if it lies in the wedge on both sides
//! of the closing plane and the blades are farther apart than their contact skin.
//!
//! Tissue is the elements of an organ. Where an organ has a collision surface of its own, a layer
//! under this surface is tissue too, because jaws take hold of what they touch.

use crate::clusters::MIN_HELD_NODES;
use crate::gripper::{BLADE_TIP, BLADE_WIDTH, JAW_REGION_BEGIN};
use crate::{Cluster, Gripper, World, clusters};
use glam::DVec3;
use trocar_core::Pose;

/// Blades whose inner faces are no farther apart than this (m) at the tissue touch only each other
/// (the contact offset).
pub const CONTACT_SKIN: f64 = 0.0015;

/// A cluster farther than this (m) from the middle of the tissue between the blades is not grasped.
const ATTACH_WITHIN: f64 = 0.012;

/// An element is sampled at its centroid, and at this share of the way from there to each corner.
const TOWARDS_CORNER: f64 = 0.5;

/// Room for rounding around the box in which samples are looked for (m).
const BOX_MARGIN: f64 = 1e-6;

/// The wedge between the blades at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JawRegion {
    gripper: Gripper,
    to_gripper: Pose,
    /// Length of the blades (m).
    length: f64,
}

/// Tissue between the blades.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TissueInJaws {
    /// Its centroid in the world (m).
    pub centroid: DVec3,
    /// Its volume (m3).
    pub volume: f64,
    /// Gap between the blades' inner faces there (m).
    pub gap: f64,
}

/// Tissue in the wedge so far: volume on either side of the closing plane (m3), sum of places by
/// volume (m4), volume (m3).
#[derive(Default)]
struct Samples {
    sides: [f64; 2],
    sum: DVec3,
    volume: f64,
}

impl JawRegion {
    /// The region of a gripper with the paper's blades.
    pub fn of(gripper: &Gripper) -> Self {
        Self::sized(gripper, BLADE_TIP)
    }

    /// The region of a gripper whose blades are `length` (m) long.
    pub fn sized(gripper: &Gripper, length: f64) -> Self {
        Self { gripper: *gripper, to_gripper: gripper.pose.inverse(), length }
    }

    /// Whether a point (m, world) is in the wedge or on its faces.
    pub fn contains(&self, p: DVec3) -> bool {
        self.holds(self.to_gripper.transform(p), 0.0)
    }

    /// The same in the gripper's frame, with the blades farther apart by `beyond` (m) on each side.
    fn holds(&self, q: DVec3, beyond: f64) -> bool {
        let r = libm::hypot(q.x, q.y);
        let along = q.x > 0.0 && (JAW_REGION_BEGIN..=self.length).contains(&r);
        along && q.z.abs() <= 0.5 * BLADE_WIDTH && q.y.abs() <= self.gripper.half_gap(r) + beyond
    }

    /// The part of a body, with elements `tets` and nodes at `positions` (m, world), that the jaws
    /// grasp when they close now; `None` without such a part.
    ///
    /// Elements are sampled at five points, the centroid and half way from there to each corner,
    /// each with a fifth of the volume: nodes alone are too far apart, and nodes that touch a blade
    /// may lie on either side of its face.
    pub fn tissue(&self, tets: &[[u32; 4]], positions: &[DVec3]) -> Option<TissueInJaws> {
        let mut found = Samples::default();
        self.add_elements(tets, positions, &mut found);
        self.grasped(found)
    }

    fn add_elements(&self, tets: &[[u32; 4]], positions: &[DVec3], found: &mut Samples) {
        let sides = self.sides(positions);
        for tet in tets {
            if is_beside(&sides, tet) {
                continue;
            }
            let corners = tet.map(|i| positions[i as usize]);
            let [a, b, c, d] = corners;
            let share = (b - a).cross(c - a).dot(d - a).abs() / 30.0;
            let middle = 0.25 * (a + b + c + d);
            for p in corners.map(|c| middle.lerp(c, TOWARDS_CORNER)).into_iter().chain([middle]) {
                self.add_sample(p, share, found);
            }
        }
    }

    /// Adds a layer of `depth` (m) under triangles with vertices at `positions` (m, world), sampled
    /// at four points each.
    fn add_layer(&self, triangles: &[[u32; 3]], positions: &[DVec3], depth: f64, found: &mut Samples) {
        let sides = self.sides(positions);
        for triangle in triangles {
            if is_beside(&sides, triangle) {
                continue;
            }
            let corners = triangle.map(|i| positions[i as usize]);
            let [a, b, c] = corners;
            let share = depth * (b - a).cross(c - a).length() / 8.0;
            let middle = (a + b + c) / 3.0;
            for p in corners.map(|c| middle.lerp(c, TOWARDS_CORNER)).into_iter().chain([middle]) {
                self.add_sample(p, share, found);
            }
        }
    }

    /// The faces of a box around the wedge that each point is beyond: a bit a face.
    fn sides(&self, positions: &[DVec3]) -> Vec<u8> {
        let low = DVec3::new(0.0, -self.gripper.half_gap(self.length), -0.5 * BLADE_WIDTH) - BOX_MARGIN;
        let high = DVec3::new(self.length, -low.y, -low.z) + BOX_MARGIN;
        let of = |p: &DVec3| {
            let q = self.to_gripper.transform(*p);
            (q.cmplt(low).bitmask() | q.cmpgt(high).bitmask() << 3) as u8
        };
        positions.iter().map(of).collect()
    }

    #[inline(always)]
    fn add_sample(&self, p: DVec3, share: f64, found: &mut Samples) {
        let q = self.to_gripper.transform(p);
        if self.holds(q, 0.0) {
            found.sides[usize::from(q.y > 0.0)] += share;
            found.sum += share * p;
            found.volume += share;
        }
    }

    /// What is grasped of the samples in the wedge.
    fn grasped(&self, Samples { sides, sum, volume }: Samples) -> Option<TissueInJaws> {
        if sides.contains(&0.0) {
            return None;
        }
        let centroid = sum / volume;
        let q = self.to_gripper.transform(centroid);
        let gap = 2.0 * self.gripper.half_gap(libm::hypot(q.x, q.y));
        (gap > CONTACT_SKIN).then_some(TissueInJaws { centroid, volume, gap })
    }

    /// Tissue of organ `organ` between the blades, as [`tissue`](Self::tissue).
    pub fn tissue_of(&self, world: &World, organ: usize) -> Option<TissueInJaws> {
        let body = &world.model.bodies()[organ];
        let mut found = Samples::default();
        self.add_elements(body.tets(), &world.state.positions(&world.model, organ), &mut found);
        if let Some(surface) = body.collision_surface() {
            let positions = world.state.collision_positions(&world.model, organ);
            self.add_layer(&surface.mesh().triangles, &positions, 0.5 * body.median_edge(), &mut found);
        }
        self.grasped(found)
    }

    /// The organ with the most tissue between the blades, and that tissue.
    pub fn fullest(&self, world: &World) -> Option<(usize, TissueInJaws)> {
        let near = |k: &usize| self.is_near(world, *k);
        let all = (0..world.model.bodies().len()).filter(near).filter_map(|k| Some((k, self.tissue_of(world, k)?)));
        all.reduce(|best, next| if next.1.volume > best.1.volume { next } else { best })
    }

    /// Whether any node of organ `organ` is near enough for a part of the organ to be between the
    /// blades.
    fn is_near(&self, world: &World, organ: usize) -> bool {
        let body = &world.model.bodies()[organ];
        // Coarse inner elements are a few times as large as the median.
        let reach = self.length + BLADE_WIDTH + 8.0 * body.median_edge();
        let place = |i: usize| world.state.position(&world.model, organ, i);
        (0..body.len()).any(|i| place(i).distance_squared(self.gripper.pose.translation) < reach * reach)
    }

    /// Nodes of organ `organ` between the blades, or within half of a median edge of them; and
    /// those that move a vertex of its collision surface there.
    pub fn nodes_of(&self, world: &World, organ: usize) -> Vec<u32> {
        let body = &world.model.bodies()[organ];
        let beyond = 0.5 * body.median_edge();
        let inside = |i: &u32| {
            let p = world.state.position(&world.model, organ, *i as usize);
            self.holds(self.to_gripper.transform(p), beyond)
        };
        let mut nodes: Vec<u32> = (0..body.len() as u32).filter(inside).collect();
        if let Some(surface) = body.collision_surface() {
            let vertices = world.state.collision_positions(&world.model, organ).into_iter().enumerate();
            for (vertex, _) in vertices.filter(|(_, p)| self.holds(self.to_gripper.transform(*p), beyond)) {
                let (of, weights) = surface.nodes_of(vertex);
                nodes.extend(of.iter().zip(weights).filter(|(_, weight)| *weight > 0.0).map(|(node, _)| *node));
            }
            nodes.sort_unstable();
            nodes.dedup();
        }
        nodes
    }
}

/// Whether all corners are beyond one face of the box, and so is all that is between them.
fn is_beside<const N: usize>(sides: &[u8], corners: &[u32; N]) -> bool {
    corners.iter().fold(u8::MAX, |all, i| all & sides[*i as usize]) != 0
}

/// The cluster of organ `organ` that is attached when jaws close on tissue around `centroid` (m):
/// the nearest, within 12 mm. Clusters of thick organs are limited to the jaws' reach (`reach` (m),
/// see
/// [`Cluster::within_reach`]).
pub fn attached(world: &World, organ: usize, centroid: DVec3, reach: f64) -> Option<Cluster> {
    let mut all: Vec<Cluster> = clusters(world, organ).iter().map(|c| c.within_reach(world, organ, reach)).collect();
    if all.iter().any(|c| c.nodes.len() >= MIN_HELD_NODES) {
        all.retain(|c| c.nodes.len() >= MIN_HELD_NODES);
    }
    let distance = |c: &Cluster| c.centroid(world, organ).distance(centroid);
    let nearest = all.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    (distance(&nearest) <= ATTACH_WITHIN).then_some(nearest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MAX_ANGLE;

    /// A cube of edge 2 mm about `at` (m), in five elements.
    fn cube(at: DVec3) -> (Vec<[u32; 4]>, Vec<DVec3>) {
        let corner = |k: u32| DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2 & 1)) * 2.0 - 1.0;
        let tets = vec![[0, 1, 2, 4], [3, 2, 1, 7], [5, 4, 7, 1], [6, 7, 4, 2], [1, 2, 4, 7]];
        (tets, (0..8).map(|k| at + 0.001 * corner(k)).collect())
    }

    fn grasped(gripper: &Gripper, at: DVec3) -> bool {
        let (tets, mut nodes) = cube(at);
        nodes.iter_mut().for_each(|p| *p = gripper.pose.transform(*p));
        JawRegion::of(gripper).tissue(&tets, &nodes).is_some()
    }

    fn gripper(jaw_angle: f64) -> Gripper {
        Gripper::over(DVec3::new(0.3, -0.1, 0.05), DVec3::new(0.6, 0.0, 0.8), DVec3::Y, jaw_angle)
    }

    #[test]
    fn just_inside_and_just_outside_every_face_of_the_wedge() {
        let open = gripper(MAX_ANGLE);
        let mm = |x: f64, y: f64, z: f64| DVec3::new(x, y, z) * 1e-3;
        assert!(grasped(&open, mm(11.5, 0.0, 0.0)));
        // Before its beginning and beyond its end. The cube is 1 mm large to each side and is
        // looked at to half way.
        assert!(grasped(&open, mm(21.0, 0.0, 0.0)) && !grasped(&open, mm(22.05, 0.0, 0.0)));
        assert!(grasped(&open, mm(2.5, 0.0, 0.0)) && !grasped(&open, mm(0.9, 0.0, 0.0)));
        assert!(!grasped(&open, mm(-11.5, 0.0, 0.0)), "behind the pivot");
        // To both sides of its width.
        for side in [-1.0, 1.0] {
            assert!(grasped(&open, mm(11.5, 0.0, side * 2.4)) && !grasped(&open, mm(11.5, 0.0, side * 3.55)));
        }
        // On one side of the closing plane only, and behind a blade.
        for side in [-1.0, 1.0] {
            assert!(grasped(&open, mm(11.5, side * 0.4, 0.0)));
            assert!(!grasped(&open, mm(11.5, side * 1.05, 0.0)));
            assert!(!grasped(&open, mm(11.5, side * 8.0, 0.0)));
        }
    }

    #[test]
    fn the_half_gap_is_the_papers() {
        let open = gripper(0.5);
        let region = JawRegion::of(&open);
        for r in [0.003, 0.010, 0.020] {
            let y = r * (0.25_f64).sin();
            let at = |y: f64| open.pose.transform(DVec3::new((r * r - y * y).sqrt(), y, 0.0));
            assert!(region.contains(at(0.999 * y)) && region.contains(at(-0.999 * y)));
            assert!(!region.contains(at(1.001 * y)) && !region.contains(at(-1.001 * y)));
        }
    }

    #[test]
    fn blades_that_touch_hold_nothing() {
        let at = 0.0115;
        let angle = |gap: f64| 2.0 * (0.5 * gap / at).asin();
        let middle = DVec3::new(at, 0.0, 0.0);
        assert!(grasped(&gripper(angle(1.1 * CONTACT_SKIN)), middle));
        assert!(!grasped(&gripper(angle(0.9 * CONTACT_SKIN)), middle));
        assert!(!grasped(&gripper(0.0), middle));
    }
}
