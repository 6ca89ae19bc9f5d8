//! Force and Hessian block of one vertex in one element: the innermost work of a sweep.

use crate::body::{Body, Corner};
use crate::{ConstitutiveModel, StableNeoHookean};
use glam::{Mat3A, Vec3A};

/// Negative gradient and Hessian block of an energy at one vertex.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Local {
    /// Force [N].
    pub force: Vec3A,
    /// Hessian block [N/m], symmetric.
    pub block: Mat3A,
}

impl Local {
    /// Adds stiffness `k` along direction `g`: block += k g g'.
    #[inline(always)]
    pub fn add_outer(&mut self, k: f32, g: Vec3A) {
        let kg = k * g;
        self.block.x_axis += kg * g.x;
        self.block.y_axis += kg * g.y;
        self.block.z_axis += kg * g.z;
    }

    /// Adds the same stiffness in all directions.
    #[inline(always)]
    pub fn add_isotropic(&mut self, k: f32) {
        self.block.x_axis.x += k;
        self.block.y_axis.y += k;
        self.block.z_axis.z += k;
    }
}

/// Gradient of the element's volume ratio J with respect to the vertex [1/m]: a third of the area vector of the face opposite over the rest volume.
/// J is affine in any single vertex: J = gradient.(x - a), a being any corner of that face.
#[inline(always)]
pub(crate) fn volume_gradient(corner: &Corner, [a, b, c]: [Vec3A; 3]) -> Vec3A {
    (b - a).cross(c - a) * corner.inverse_6v
}

/// One element as a vertex sees it now.
#[derive(Clone, Copy)]
pub(crate) struct Seen {
    /// The vertex [m].
    pub x: Vec3A,
    /// The other three corners [m].
    pub others: [Vec3A; 3],
    /// [`volume_gradient`] [1/m].
    pub gradient: Vec3A,
    /// Volume over rest volume.
    pub ratio: f32,
}

/// A material's part of the sweep.
pub(crate) trait VertexElasticity: Sync {
    /// Adds force and block of the vertex in one element; `k` is the corner's number in the body.
    fn add(&self, body: &Body, k: usize, seen: &Seen, local: &mut Local);
}

/// Volume part of [`StableNeoHookean`]: its block V0 psi''(J) g g' is positive semidefinite as it is. The other part, mu/2 tr(F'F), is quadratic in
/// the positions: a constant Laplacian along the edges, added by the sweep.
pub(crate) struct VolumeTerm {
    material: StableNeoHookean,
    lambda: f32,
    alpha: f32,
}

/// Above this volume ratio the volume term is its plain quadratic.
const PLAIN: f32 = 0.25;

impl VertexElasticity for VolumeTerm {
    #[inline(always)]
    fn add(&self, body: &Body, k: usize, &Seen { gradient, ratio, .. }: &Seen, local: &mut Local) {
        let volume = body.corners[k].volume;
        let (slope, curvature) = if ratio > PLAIN {
            (self.lambda * (ratio - self.alpha), self.lambda)
        } else {
            // The guard keeps J positive; this keeps the logarithm finite if it ever were not.
            let (_, slope, curvature) = self.material.volume_term(f64::from(ratio).max(1e-4));
            (slope as f32, curvature as f32)
        };
        local.force -= volume * slope * gradient;
        local.add_outer(volume * curvature, gradient);
    }
}

/// [`crate::StVenantKirchhoff`] with its block made positive semidefinite: the geometric stiffness m'Sm is dropped where it is negative.
pub(crate) struct GreenStrain {
    pub mu: f32,
    pub lambda: f32,
}

impl VertexElasticity for GreenStrain {
    #[inline(always)]
    fn add(&self, body: &Body, k: usize, &Seen { x, others, .. }: &Seen, local: &mut Local) {
        // F = sum over corners of x_c m_c', and the four rest gradients m sum to zero.
        let gradients = &body.gradients[k];
        let mut f = Mat3A::ZERO;
        for (other, m) in others.iter().zip(gradients) {
            let edge = *other - x;
            f.x_axis += edge * m.x;
            f.y_axis += edge * m.y;
            f.z_axis += edge * m.z;
        }
        let m = -(gradients[0] + gradients[1] + gradients[2]);
        let volume = body.corners[k].volume;
        let strain = (f.transpose() * f - Mat3A::IDENTITY) * 0.5;
        let trace = strain.x_axis.x + strain.y_axis.y + strain.z_axis.z;
        let sm = strain * m * (2.0 * self.mu) + m * (self.lambda * trace);
        local.force -= volume * (f * sm);
        let fm = f * m;
        local.add_isotropic(volume * m.dot(sm).max(0.0));
        local.add_outer(volume * (self.mu + self.lambda), fm);
        let along = volume * self.mu * m.length_squared();
        for column in [f.x_axis, f.y_axis, f.z_axis] {
            local.add_outer(along, column);
        }
    }
}

/// The kernel of a body's material.
pub(crate) enum Kernel {
    StableNeoHookean(VolumeTerm),
    StVenantKirchhoff(GreenStrain),
}

impl Kernel {
    pub fn of(body: &Body) -> Self {
        let (mu, lambda) = body.material.lame();
        match body.material.model {
            ConstitutiveModel::StableNeoHookean => {
                let material = StableNeoHookean::new(mu, lambda);
                let (lambda, alpha) = (material.lambda as f32, material.alpha as f32);
                Self::StableNeoHookean(VolumeTerm { material, lambda, alpha })
            }
            ConstitutiveModel::StVenantKirchhoff => {
                Self::StVenantKirchhoff(GreenStrain { mu: mu as f32, lambda: lambda as f32 })
            }
        }
    }
}
