//! The part of a simulation that changes: plain data.

mod body_state;
mod capture;
mod friction;
mod motion;
#[cfg(test)]
mod tests;

pub(crate) use body_state::{BodyState, WarmStart};
pub(crate) use friction::{Anchor, FeatureAnchor, FeatureKey, Source, Stretch};
pub use motion::BodyMotion;

use crate::{Body, Grasp, Hole, Model};
use glam::{DVec3, Vec3A};
use xxhash_rust::xxh3::Xxh3;

/// Positions, velocities, grasps and holes at one instant. Cloning a state saves it; assigning the
/// clone restores it exactly.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Simulated time (s).
    pub time: f64,
    /// The grasps in force. Adding one closes it. Removing it opens it, and its nodes are free. A
    /// node in several grasps follows the last, but a rigid one before a compliant one.
    pub grasps: Vec<Grasp>,
    /// Holes through which tools pass. Adding one lets the tools through; removing it closes it.
    pub holes: Vec<Hole>,
    /// One for each body.
    pub(crate) bodies: Vec<BodyState>,
}

impl State {
    /// The model at rest in its rest shape.
    pub fn new(model: &Model) -> Self {
        let bodies = model.bodies.iter().map(BodyState::at_rest).collect();
        Self { time: 0.0, grasps: Vec::new(), holes: Vec::new(), bodies }
    }

    /// Whether the nodes of every grasp and hole are nodes that the model has.
    pub(crate) fn names_nodes_of(&self, model: &Model) -> bool {
        let holds = |grasp: &Grasp| {
            let nodes = model.bodies.get(grasp.body).map_or(0, |body| body.len());
            grasp.nodes.len() == grasp.captured.len() && grasp.nodes.iter().all(|i| (*i as usize) < nodes)
        };
        self.grasps.iter().all(holds) && self.holes.iter().all(|hole| hole.fits(model))
    }

    /// The motion of a body, in double precision and node order.
    pub fn motion(&self, model: &Model, body: usize) -> BodyMotion {
        let mut motion = BodyMotion::default();
        motion.load(&model.bodies[body], &self.bodies[body]);
        motion
    }

    /// Sets the motion of a body, rounded to single precision. Friction with tools and other bodies
    /// does not change.
    pub fn set_motion(&mut self, model: &Model, body: usize, motion: &BodyMotion) {
        motion.store(&model.bodies[body], &mut self.bodies[body]);
    }

    /// Sets the acceleration of each node of a body in the last substep (m/s2), which the adaptive
    /// start of the sweeps uses.
    pub fn set_accelerations(&mut self, model: &Model, body: usize, accelerations: &[DVec3]) {
        let strength = model.gravity.length_squared();
        if strength > 0.0 {
            for (i, acceleration) in model.bodies[body].internal.iter().zip(accelerations) {
                let share = acceleration.dot(model.gravity) / strength;
                self.bodies[body].warm.falling[*i as usize] = share.clamp(0.0, 1.0) as f32;
            }
        }
    }

    /// World position of a node (m).
    pub fn position(&self, model: &Model, body: usize, node: usize) -> DVec3 {
        let b = &model.bodies[body];
        b.origin + self.bodies[body].x[b.internal[node] as usize].as_dvec3()
    }

    /// World positions of the vertices of a body's collision surface (m); none if that is the
    /// boundary of its elements.
    pub fn collision_positions(&self, model: &Model, body: usize) -> Vec<DVec3> {
        let vertices = model.bodies[body].collision_surface().map_or(0, |surface| surface.mesh.vertices.len());
        (0..vertices).map(|vertex| self.collision_position(model, body, vertex)).collect()
    }

    /// World position of a vertex of a body's collision surface (m); zero if it has none.
    pub fn collision_position(&self, model: &Model, body: usize, vertex: usize) -> DVec3 {
        let (b, state) = (&model.bodies[body], &self.bodies[body]);
        let Some(surface) = b.collision_surface() else { return DVec3::ZERO };
        let point = b.lattice.as_ref().and_then(|lattice| lattice.points[b.len() + vertex]);
        match (point, &state.lattice) {
            (Some(point), Some(lattice)) => b.origin + point.interpolate(&lattice.positions),
            _ => surface.place(vertex, |node| self.position(model, body, node)),
        }
    }

    /// World positions of a body's nodes (m).
    pub fn positions(&self, model: &Model, body: usize) -> Vec<DVec3> {
        (0..model.bodies[body].len()).map(|node| self.position(model, body, node)).collect()
    }

    /// Copies positions, velocities and the anchors of friction on supports from another state.
    /// Other friction, the grasps and the holes stay. Returns false, and changes nothing, if the
    /// other state has other bodies.
    pub fn copy_motion(&mut self, other: &Self) -> bool {
        let sizes = |state: &Self| state.bodies.iter().map(|body| body.x.len()).collect::<Vec<_>>();
        if sizes(self) != sizes(other) {
            return false;
        }
        for (to, from) in self.bodies.iter_mut().zip(&other.bodies) {
            to.x.copy_from_slice(&from.x);
            to.v.copy_from_slice(&from.v);
            to.lattice.clone_from(&from.lattice);
            to.follows = from.follows;
            to.anchors.clear();
            to.feature_anchors.clear();
            to.anchors.extend(from.anchors.iter().filter(|anchor| matches!(anchor.source, Source::Support(_))));
        }
        true
    }

    /// Velocity of a node (m/s).
    pub fn velocity(&self, model: &Model, body: usize, node: usize) -> DVec3 {
        self.bodies[body].v[model.bodies[body].internal[node] as usize].as_dvec3()
    }

    /// Sets the world position of a node (m), pinned or not; its velocity stays. Elements that are
    /// inverted by it are repaired at the beginning of the next step, without regard to time and
    /// forces.
    pub fn set_position(&mut self, model: &Model, body: usize, node: usize, position: DVec3) {
        let b = &model.bodies[body];
        self.bodies[body].x[b.internal[node] as usize] = (position - b.origin).as_vec3a();
        self.bodies[body].disturbed = true;
        self.bodies[body].follows = false;
    }

    /// Sets the velocity of a node (m/s); a pinned or held node keeps none.
    pub fn set_velocity(&mut self, model: &Model, body: usize, node: usize, velocity: DVec3) {
        self.bodies[body].v[model.bodies[body].internal[node] as usize] = velocity.as_vec3a();
        self.bodies[body].follows = false;
    }

    /// Kinetic energy of all bodies (J).
    pub fn kinetic_energy(&self, model: &Model) -> f64 {
        let of = |(body, state): (&Body, &BodyState)| -> f64 {
            let vertices = body.vertices.iter().zip(&state.v);
            vertices.map(|(vertex, v)| 0.5 * f64::from(vertex.mass) * f64::from(v.length_squared())).sum()
        };
        model.bodies.iter().zip(&self.bodies).map(of).sum()
    }

    /// Stops every node where it is.
    pub fn stop(&mut self) {
        for body in &mut self.bodies {
            body.v.fill(Vec3A::ZERO);
            if let Some(lattice) = &mut body.lattice {
                lattice.velocities.fill(DVec3::ZERO);
            }
        }
    }

    /// Mean position of some nodes of a body (m); zero for none.
    pub fn centroid(&self, model: &Model, body: usize, nodes: &[u32]) -> DVec3 {
        let sum: DVec3 = nodes.iter().map(|i| self.position(model, body, *i as usize)).sum();
        if nodes.is_empty() { DVec3::ZERO } else { sum / nodes.len() as f64 }
    }

    /// Hash over every bit of the state. Destructuring names every field: a new one that is not
    /// hashed does not compile.
    pub fn hash(&self) -> u64 {
        let Self { time, grasps, holes, bodies } = self;
        let mut hash = Xxh3::new();
        hash.update(&time.to_bits().to_le_bytes());
        bodies.iter().for_each(|body| body.hash(&mut hash));
        grasps.iter().for_each(|grasp| grasp.hash(&mut hash));
        holes.iter().for_each(|hole| hole.hash(&mut hash));
        hash.digest()
    }
}
