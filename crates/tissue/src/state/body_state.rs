//! The part of a state that belongs to one body: its physics, and the solvers' warm start.

use super::friction::{Anchor, FeatureAnchor, Source, Stretch};
use crate::Body;
use glam::Vec3A;
use trocar_lattice::BodyState as LatticeState;
use xxhash_rust::xxh3::Xxh3;

/// The state of one body, vertices in the body's internal order, positions relative to its origin.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BodyState {
    /// Positions (m); those of the vertices of a collision surface come after the nodes'. They
    /// follow the nodes at the beginning of a frame and after each substep.
    pub x: Vec<Vec3A>,
    /// Velocities (m/s).
    pub v: Vec<Vec3A>,
    /// Anchors of friction on supports and tools, by vertex.
    pub anchors: Vec<Anchor>,
    /// Those of edges and triangles on tools, by collider and vertices.
    pub feature_anchors: Vec<FeatureAnchor>,
    /// Stretch of friction's springs to other bodies, by vertex and body.
    pub stretches: Vec<Stretch>,
    /// Nodes were moved from outside: elements may be inverted by it, and are repaired before the
    /// next frame.
    pub disturbed: bool,
    /// The solvers' warm start.
    pub warm: WarmStart,
    /// Nodes of the body's lattice, relative to the body's origin, which vertices follow; None
    /// without a lattice.
    pub lattice: Option<LatticeState>,
    /// Whether the vertices are where the lattice has them, bit by bit: nothing moved them from
    /// outside since it wrote them. Where it is not known to be so, the next frame finds out, with
    /// the same bits if it was.
    pub follows: bool,
}

/// The solvers' warm start: data that they keep from frame to frame.
///
/// It is not physics: with another warm start the same minimum is found, to the solver's tolerance.
/// It is part of the state because the bits of the next frame depend on it, and a restored state
/// must continue with the same bits.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WarmStart {
    /// Acceleration along gravity that the last substep showed, as a share of gravity in 0..=1: the
    /// adaptive start of the sweeps predicts with it.
    pub falling: Vec<f32>,
    /// Vertices whose contact stiffness is in the quasi-Newton solver's matrix: the matrix is
    /// factorised again only when many others touch.
    pub supported: Vec<bool>,
}

impl BodyState {
    /// At rest in the rest shape.
    pub fn at_rest(body: &Body) -> Self {
        let mut x = vec![Vec3A::ZERO; body.vertex_count()];
        for (node, p) in body.rest_positions().iter().enumerate() {
            x[body.internal[node] as usize] = (p - body.origin).as_vec3a();
        }
        if let Some(surface) = body.collision_surface() {
            for (x, p) in x[body.len()..].iter_mut().zip(&surface.mesh.vertices) {
                *x = (*p - body.origin).as_vec3a();
            }
        }
        Self {
            x,
            v: vec![Vec3A::ZERO; body.vertex_count()],
            anchors: Vec::with_capacity(2 * body.surface_vertices().len()),
            feature_anchors: Vec::new(),
            stretches: Vec::new(),
            disturbed: false,
            warm: WarmStart { falling: vec![0.0; body.len()], supported: vec![false; body.len()] },
            lattice: body.lattice.as_ref().map(|lattice| lattice.at_rest()),
            follows: false,
        }
    }

    /// Makes the lattice follow vertices that were moved from outside, and the others follow it.
    pub fn join_lattice(&mut self, body: &Body) {
        if self.follows {
            return;
        }
        if let (Some(embedding), Some(lattice)) = (&body.lattice, &mut self.lattice) {
            embedding.follow(lattice, &mut self.x, &mut self.v);
            self.follows = true;
        }
    }

    /// Moves the vertices of a collision surface to where the nodes have it. On a lattice they are
    /// written with the nodes.
    pub fn follow_nodes(&mut self, body: &Body) {
        if body.lattice.is_some() {
            return;
        }
        for (k, bound) in body.bound.iter().enumerate() {
            for field in [&mut self.x, &mut self.v] {
                let place = bound.sum(|node| field[node as usize]);
                field[body.len() + k] = place;
            }
        }
    }

    /// Copies another state of the same body without allocating. Destructuring names every field:
    /// a new one that is not copied does not compile.
    pub fn copy_from(&mut self, other: &Self) {
        let Self { x, v, anchors, feature_anchors, stretches, disturbed, warm, lattice, follows } = other;
        let WarmStart { falling, supported } = warm;
        self.x.copy_from_slice(x);
        self.v.copy_from_slice(v);
        self.anchors.clone_from(anchors);
        self.feature_anchors.clone_from(feature_anchors);
        self.stretches.clone_from(stretches);
        self.disturbed = *disturbed;
        self.warm.falling.copy_from_slice(falling);
        self.warm.supported.copy_from_slice(supported);
        self.lattice.clone_from(lattice);
        self.follows = *follows;
    }

    /// Hashes every bit. Destructuring names every field: a new one that is not hashed does not
    /// compile.
    pub fn hash(&self, hash: &mut Xxh3) {
        // `follows` saves work and changes no result.
        let Self { x, v, anchors, feature_anchors, stretches, disturbed, warm, lattice, follows: _ } = self;
        let WarmStart { falling, supported } = warm;
        // The vertices of a collision surface follow from the nodes.
        let nodes = falling.len();
        for vector in x[..nodes].iter().chain(&v[..nodes]) {
            hash_vector(hash, *vector);
        }
        for share in falling {
            hash.update(&share.to_bits().to_le_bytes());
        }
        for Anchor { vertex, source, place } in anchors {
            let (kind, number) = match source {
                Source::Support(s) => (0u32, s),
                Source::Collider(c) => (1, c),
                // Grasps and threads have no anchors.
                Source::Grasp(g, _) => (2, g),
                Source::Tether(t) => (4, t),
                Source::Body(b) => (3, b),
            };
            [*vertex, kind, *number].iter().for_each(|k| hash.update(&k.to_le_bytes()));
            hash_vector(hash, *place);
        }
        for FeatureAnchor { collider, feature: (vertices, end), stretch, weights } in feature_anchors {
            [collider].into_iter().chain(vertices).for_each(|k| hash.update(&k.to_le_bytes()));
            hash.update(&[*end]);
            hash_vector(hash, *stretch);
            weights.iter().for_each(|weight| hash.update(&weight.to_bits().to_le_bytes()));
        }
        for Stretch { vertex, other, by } in stretches {
            [vertex, other].iter().for_each(|k| hash.update(&k.to_le_bytes()));
            hash_vector(hash, *by);
        }
        // The last flag is that of a request that no longer exists: hashes stay those of before.
        for flag in supported.iter().chain([disturbed, &false]) {
            hash.update(&[u8::from(*flag)]);
        }
        if let Some(LatticeState { positions, velocities }) = lattice {
            for number in positions.iter().chain(velocities).flat_map(|p| p.to_array()) {
                hash.update(&number.to_bits().to_le_bytes());
            }
        }
    }
}

/// Hashes the coordinates of a vector.
pub(super) fn hash_vector(hash: &mut Xxh3, vector: Vec3A) {
    for c in vector.to_array() {
        hash.update(&c.to_bits().to_le_bytes());
    }
}
