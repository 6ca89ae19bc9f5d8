//! What changes while stepping: plain data.

use crate::contact::{Anchor, Source, Stretch};
use crate::external::BodyMotion;
use crate::{Body, Grasp, Model};
use glam::{DVec3, Vec3A};
use xxhash_rust::xxh3::Xxh3;

/// Positions, velocities and grasp at one instant. Cloning it saves it; putting the clone back restores it exactly.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Simulated time [s].
    pub time: f64,
    /// The grasps in force. Adding one closes it; taking it away opens it, and its nodes are free. A node in several grasps follows the last, but a rigid one before a compliant one.
    pub grasps: Vec<Grasp>,
    /// One for each body.
    pub(crate) bodies: Vec<BodyState>,
}

/// A body's part of the state, vertices in the model's internal order, positions relative to the body's origin.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BodyState {
    /// Position [m].
    pub x: Vec<Vec3A>,
    /// Velocity [m/s].
    pub v: Vec<Vec3A>,
    /// Acceleration along gravity that the last substep showed, as a share of gravity, 0..=1: for the adaptive start.
    pub falling: Vec<f32>,
    /// Vertices whose supports the quasi-Newton solver has in its matrix.
    pub supported: Vec<bool>,
    /// Where friction holds what touches something, by vertex.
    pub anchors: Vec<Anchor>,
    /// How far friction against other bodies is stretched, by vertex and body.
    pub stretches: Vec<Stretch>,
    /// Whether nodes were put somewhere from outside, and elements may be inverted by it.
    pub disturbed: bool,
    /// Whether the body is to be put right whether elements are inverted or not.
    pub relaxes: bool,
}

impl BodyState {
    /// Takes over another state of the same body without allocating.
    pub fn copy_from(&mut self, other: &Self) {
        self.x.copy_from_slice(&other.x);
        self.v.copy_from_slice(&other.v);
        self.falling.copy_from_slice(&other.falling);
        self.supported.copy_from_slice(&other.supported);
        self.anchors.clone_from(&other.anchors);
        self.stretches.clone_from(&other.stretches);
        self.disturbed = other.disturbed;
        self.relaxes = other.relaxes;
    }
}

impl State {
    /// The model at rest in its rest shape.
    pub fn new(model: &Model) -> Self {
        let at_rest = |body: &Body| {
            let mut x = vec![Vec3A::ZERO; body.len()];
            for (node, p) in body.rest_positions().iter().enumerate() {
                x[body.internal[node] as usize] = (p - body.origin).as_vec3a();
            }
            BodyState {
                x,
                v: vec![Vec3A::ZERO; body.len()],
                falling: vec![0.0; body.len()],
                supported: vec![false; body.len()],
                anchors: Vec::with_capacity(2 * body.surface_vertices().len()),
                stretches: Vec::new(),
                disturbed: false,
                relaxes: false,
            }
        };
        Self { time: 0.0, grasps: Vec::new(), bodies: model.bodies.iter().map(at_rest).collect() }
    }

    /// Whether every grasp holds nodes that the model has.
    pub(crate) fn grasps_fit(&self, model: &Model) -> bool {
        self.grasps.iter().all(|grasp| {
            let nodes = model.bodies.get(grasp.body).map_or(0, |body| body.len());
            grasp.nodes.len() == grasp.captured.len() && grasp.nodes.iter().all(|i| (*i as usize) < nodes)
        })
    }

    /// The motion of a body, in double precision and node order.
    pub fn motion(&self, model: &Model, body: usize) -> BodyMotion {
        let mut motion = BodyMotion::default();
        motion.load(&model.bodies[body], &self.bodies[body]);
        motion
    }

    /// Sets the motion of a body, rounded to single precision; what contact with tools and other
    /// bodies remembers stays.
    pub fn set_motion(&mut self, model: &Model, body: usize, motion: &BodyMotion) {
        motion.store(&model.bodies[body], &mut self.bodies[body]);
    }

    /// Tells the adaptive start of the sweeps which acceleration each node of a body had in the
    /// last substep (m/s2).
    pub fn set_accelerations(&mut self, model: &Model, body: usize, accelerations: &[DVec3]) {
        let strength = model.gravity.length_squared();
        if strength > 0.0 {
            for (i, acceleration) in model.bodies[body].internal.iter().zip(accelerations) {
                let share = acceleration.dot(model.gravity) / strength;
                self.bodies[body].falling[*i as usize] = share.clamp(0.0, 1.0) as f32;
            }
        }
    }

    /// World position of a node [m].
    pub fn position(&self, model: &Model, body: usize, node: usize) -> DVec3 {
        let b = &model.bodies[body];
        b.origin + self.bodies[body].x[b.internal[node] as usize].as_dvec3()
    }

    /// World positions of a body's nodes [m].
    pub fn positions(&self, model: &Model, body: usize) -> Vec<DVec3> {
        (0..model.bodies[body].len()).map(|node| self.position(model, body, node)).collect()
    }

    /// Takes over where all nodes are and how fast from another state, and where friction holds them on supports; nothing else of what contact remembers, nor grasps. False, and nothing is changed, if that has other bodies.
    pub fn copy_motion(&mut self, other: &Self) -> bool {
        let sizes = |state: &Self| state.bodies.iter().map(|body| body.x.len()).collect::<Vec<_>>();
        if sizes(self) != sizes(other) {
            return false;
        }
        for (to, from) in self.bodies.iter_mut().zip(&other.bodies) {
            to.x.copy_from_slice(&from.x);
            to.v.copy_from_slice(&from.v);
            to.anchors.clear();
            to.anchors.extend(from.anchors.iter().filter(|anchor| matches!(anchor.source, Source::Support(_))));
        }
        true
    }

    /// Velocity of a node [m/s].
    pub fn velocity(&self, model: &Model, body: usize, node: usize) -> DVec3 {
        self.bodies[body].v[model.bodies[body].internal[node] as usize].as_dvec3()
    }

    /// Sets the world position of a node [m], whether it is pinned or not; its velocity stays. Elements that are inverted by it are put right, without regard to time and
    /// forces, at the beginning of the next step.
    pub fn set_position(&mut self, model: &Model, body: usize, node: usize, position: DVec3) {
        let b = &model.bodies[body];
        self.bodies[body].x[b.internal[node] as usize] = (position - b.origin).as_vec3a();
        self.bodies[body].disturbed = true;
    }

    /// Puts a body right at the beginning of the next step, without regard to time and forces: towards the rest shape, turned, until no element is squeezed and no edge is stretched much. For
    /// tissue so folded that its elements lock each other. Pinned and held nodes stay.
    pub fn relax(&mut self, body: usize) {
        self.bodies[body].disturbed = true;
        self.bodies[body].relaxes = true;
    }

    /// Sets the velocity of a node [m/s]; a pinned or held node keeps none.
    pub fn set_velocity(&mut self, model: &Model, body: usize, node: usize, velocity: DVec3) {
        self.bodies[body].v[model.bodies[body].internal[node] as usize] = velocity.as_vec3a();
    }

    /// Kinetic energy of all bodies [J].
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
        }
    }

    /// Mean position of some nodes of a body [m]; zero for none.
    pub fn centroid(&self, model: &Model, body: usize, nodes: &[u32]) -> DVec3 {
        let sum: DVec3 = nodes.iter().map(|i| self.position(model, body, *i as usize)).sum();
        if nodes.is_empty() { DVec3::ZERO } else { sum / nodes.len() as f64 }
    }

    /// Hash over every bit of the state.
    pub fn hash(&self) -> u64 {
        let mut hash = Xxh3::new();
        hash.update(&self.time.to_bits().to_le_bytes());
        for body in &self.bodies {
            for vector in body.x.iter().chain(&body.v) {
                for c in vector.to_array() {
                    hash.update(&c.to_bits().to_le_bytes());
                }
            }
            for f in &body.falling {
                hash.update(&f.to_bits().to_le_bytes());
            }
            for anchor in &body.anchors {
                let (kind, number) = match anchor.source {
                    Source::Support(s) => (0u32, s),
                    Source::Collider(c) => (1, c),
                    // No friction that is anchored.
                    Source::Grasp(g, _) => (2, g),
                    Source::Body(b) => (3, b),
                };
                [anchor.vertex, kind, number].iter().for_each(|k| hash.update(&k.to_le_bytes()));
                anchor.place.to_array().iter().for_each(|c| hash.update(&c.to_bits().to_le_bytes()));
            }
            for stretch in &body.stretches {
                [stretch.vertex, stretch.other].iter().for_each(|k| hash.update(&k.to_le_bytes()));
                stretch.by.to_array().iter().for_each(|c| hash.update(&c.to_bits().to_le_bytes()));
            }
            for flag in body.supported.iter().chain([&body.disturbed, &body.relaxes]) {
                hash.update(&[u8::from(*flag)]);
            }
        }
        for grasp in &self.grasps {
            hash.update(&(grasp.body as u64).to_le_bytes());
            hash.update(&(grasp.tool as u64).to_le_bytes());
            for (node, x) in grasp.prescribed(&grasp.captured_at) {
                hash.update(&node.to_le_bytes());
                for c in x.to_array() {
                    hash.update(&c.to_bits().to_le_bytes());
                }
            }
            let compliance = grasp.compliance.iter();
            for number in compliance.flat_map(|c| {
                [c.stiffness, c.jaw_force, c.friction, c.tear_force, c.closing.x, c.closing.y, c.closing.z]
            }) {
                hash.update(&number.to_bits().to_le_bytes());
            }
            for c in grasp.slid.iter().flat_map(|slid| slid.to_array()) {
                hash.update(&c.to_bits().to_le_bytes());
            }
            hash.update(&[u8::from(grasp.slips), u8::from(grasp.torn)]);
            let pose = &grasp.captured_at;
            for c in pose.translation.to_array().into_iter().chain(pose.rotation.to_array()) {
                hash.update(&c.to_bits().to_le_bytes());
            }
        }
        hash.digest()
    }
}
