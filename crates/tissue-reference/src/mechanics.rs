//! A body as the comparators see it, in double precision.
//!
//! Vertices have the solvers' numbers ([`Body::solver_numbers`]).

use glam::{DMat3, DVec3};
use trocar_tissue::assembly::shape_gradients;
use trocar_tissue::{Body, SPEED_LIMIT, Support};

/// A body's constants, vertices by the solvers' numbers, positions relative to the body's origin.
pub(crate) struct Mechanics {
    pub tets: Vec<[u32; 4]>,
    /// Rest gradients of the shape functions (1/m).
    pub gradients: Vec<[DVec3; 4]>,
    /// Rest volumes (m3).
    pub volumes: Vec<f64>,
    /// (kg)
    pub masses: Vec<f64>,
    /// Edges with a dashpot: vertices and coefficient (N s/m).
    pub dashpots: Vec<([u32; 2], f64)>,
    pub supports: Vec<Support>,
    /// World position of the body's origin (m); supports are in world coordinates.
    pub origin: DVec3,
    /// (N/m)
    pub contact_stiffness: Vec<f64>,
}

/// Positions (m) and velocities (m/s).
pub(crate) struct Particles {
    pub x: Vec<DVec3>,
    pub v: Vec<DVec3>,
}

/// A time span, and where fixed vertices are at its end.
#[derive(Clone, Copy)]
pub(crate) struct Span<'a> {
    /// (s)
    pub dt: f64,
    /// Of gravity and loads, by vertex (m/s2).
    pub accelerations: &'a [DVec3],
    /// Pinned or held vertices.
    pub fixed: &'a [bool],
    /// Targets; read for fixed vertices only (m).
    pub targets: &'a [DVec3],
}

impl Mechanics {
    pub fn new(body: &Body) -> Self {
        let (mesh, numbers) = (body.rest(), body.solver_numbers());
        let number = |node: u32| numbers[node as usize];
        let mut masses = vec![0.0; body.len()];
        let mut contact_stiffness = vec![0.0; body.len()];
        for (node, number) in numbers.iter().enumerate() {
            masses[*number as usize] = body.mass(node);
            contact_stiffness[*number as usize] = body.contact_stiffness(node);
        }
        // Each pair at its vertex with the smaller number, in the order of the other node.
        let mut pairs = body.dashpots();
        pairs.iter_mut().filter(|([a, b], _)| number(*a) > number(*b)).for_each(|(pair, _)| pair.swap(0, 1));
        pairs.sort_by_key(|([a, b], _)| (number(*a), *b));
        Self {
            tets: mesh.tets.iter().map(|tet| tet.map(number)).collect(),
            gradients: (0..mesh.tets.len()).map(|t| shape_gradients(mesh, t)).collect(),
            volumes: body.volumes().to_vec(),
            masses,
            dashpots: pairs.into_iter().map(|(pair, damping)| (pair.map(number), damping)).collect(),
            supports: body.supports().to_vec(),
            origin: body.origin(),
            contact_stiffness,
        }
    }

    /// Deformation gradient of an element.
    pub fn deformation(&self, t: usize, x: &[DVec3]) -> DMat3 {
        let [a, b, c, d] = self.tets[t].map(|i| x[i as usize]);
        let mut f = DMat3::ZERO;
        // The gradients sum to zero.
        for (edge, m) in [(b - a), (c - a), (d - a)].into_iter().zip(&self.gradients[t][1..]) {
            f.x_axis += edge * m.x;
            f.y_axis += edge * m.y;
            f.z_axis += edge * m.z;
        }
        f
    }

    /// Applies the dashpots to velocities for a time of `h` (s), pair by pair, each as implicit
    /// Euler treats the pair alone: they take energy at any `h` and keep both momenta. Fixed
    /// vertices keep their velocities.
    pub fn damp(&self, h: f64, x: &[DVec3], v: &mut [DVec3], fixed: &[bool]) {
        for ([i, j], coefficient) in &self.dashpots {
            let (i, j) = (*i as usize, *j as usize);
            let inverse = |i: usize| if fixed[i] { 0.0 } else { 1.0 / self.masses[i] };
            let (wi, wj) = (inverse(i), inverse(j));
            let n = (x[j] - x[i]).normalize_or_zero();
            let impulse = h * coefficient * n.dot(v[j] - v[i]) / (1.0 + h * coefficient * (wi + wj));
            v[i] += wi * impulse * n;
            v[j] -= wj * impulse * n;
        }
    }
}

impl Span<'_> {
    /// Where a fixed vertex that begins at `from` is when `share` of the span is over.
    pub fn prescribed(&self, i: usize, from: DVec3, share: f64) -> DVec3 {
        if share >= 1.0 { self.targets[i] } else { from.lerp(self.targets[i], share) }
    }
}

/// Whether a free vertex reaches the speed limit, or its speed is NaN.
pub(crate) fn too_fast(v: &[DVec3], fixed: &[bool]) -> bool {
    v.iter().zip(fixed).any(|(v, fixed)| {
        let squared = v.length_squared();
        !fixed && (squared.is_nan() || squared >= SPEED_LIMIT * SPEED_LIMIT)
    })
}
