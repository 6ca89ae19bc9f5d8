//! Force and Hessian block of one vertex in one element: the innermost work of a sweep.

use crate::body::{Body, Corner};
use crate::material::VolumeEnergy;
use crate::{ConstitutiveModel, Corotated, StableNeoHookean};
use glam::{Mat3A, Vec3A};

/// Negative gradient and Hessian block of an energy at one vertex.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Local {
    /// Force (N).
    pub force: Vec3A,
    /// Hessian block (N/m), symmetric.
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

/// Gradient of the element's volume ratio J with respect to the vertex (1/m): a third of the area
/// vector of the opposite face over the rest volume. J is affine in any single vertex: J =
/// gradient.(x - a), a being any corner of that face.
#[inline(always)]
pub(crate) fn volume_gradient(corner: &Corner, [a, b, c]: [Vec3A; 3]) -> Vec3A {
    (b - a).cross(c - a) * corner.inverse_6v
}

/// One element as a vertex sees it now.
#[derive(Clone, Copy)]
pub(crate) struct Seen {
    /// The vertex (m).
    pub x: Vec3A,
    /// The other three corners (m).
    pub others: [Vec3A; 3],
    /// [`volume_gradient`] (1/m).
    pub gradient: Vec3A,
    /// Volume over rest volume.
    pub ratio: f32,
}

/// A material's part of the sweep.
pub(crate) trait VertexElasticity: Sync {
    /// Adds force and block of the vertex in one element; `k` is the corner's number in the body.
    fn add(&self, body: &Body, k: usize, seen: &Seen, local: &mut Local);
}

/// The energy of the volume ratio of a material: its block V0 psi''(J) g g' is positive
/// semidefinite. It is all that remains of [`StableNeoHookean`], whose other part, mu/2 tr(F'F), is
/// quadratic in the positions: a constant Laplacian along the edges, added by the sweep.
pub(crate) struct VolumeTerm {
    energy: VolumeEnergy,
    /// Volume modulus (Pa).
    pub lambda: f32,
    /// Volume ratio at which the quadratic is least.
    pub alpha: f32,
}

impl VolumeTerm {
    /// Above this volume ratio the volume term is its plain quadratic.
    pub const MIN_PLAIN_RATIO: f32 = 0.25;

    /// Its first and second derivatives (Pa).
    #[inline(always)]
    pub fn at(&self, ratio: f32) -> (f32, f32) {
        if ratio > Self::MIN_PLAIN_RATIO {
            return (self.lambda * (ratio - self.alpha), self.lambda);
        }
        // The guard keeps J positive; this keeps the logarithm finite if it does not.
        let (_, slope, curvature) = self.energy.at(f64::from(ratio).max(1e-4));
        (slope as f32, curvature as f32)
    }
}

impl From<VolumeEnergy> for VolumeTerm {
    fn from(energy: VolumeEnergy) -> Self {
        Self { energy, lambda: energy.modulus as f32, alpha: energy.alpha as f32 }
    }
}

impl VertexElasticity for VolumeTerm {
    #[inline(always)]
    fn add(&self, body: &Body, k: usize, &Seen { gradient, ratio, .. }: &Seen, local: &mut Local) {
        let volume = body.corners[k].volume;
        let (slope, curvature) = self.at(ratio);
        local.force -= volume * slope * gradient;
        local.add_outer(volume * curvature, gradient);
    }
}

/// [`crate::StVenantKirchhoff`] with its block made positive semidefinite: the geometric stiffness
/// m'Sm is dropped where it is negative.
pub(crate) struct GreenStrain {
    pub mu: f32,
    pub lambda: f32,
}

impl VertexElasticity for GreenStrain {
    #[inline(always)]
    fn add(&self, body: &Body, k: usize, &Seen { x, others, .. }: &Seen, local: &mut Local) {
        let (f, m) = deformation(&body.gradients[k], x, others);
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

/// F and the vertex's own rest gradient, from the other three corners' rest gradients and
/// positions.
#[inline(always)]
fn deformation(gradients: &[Vec3A; 3], x: Vec3A, others: [Vec3A; 3]) -> (Mat3A, Vec3A) {
    // F = sum over corners of x_c m_c', and the four rest gradients m sum to zero.
    let mut f = Mat3A::ZERO;
    for (other, m) in others.iter().zip(gradients) {
        let edge = *other - x;
        f.x_axis += edge * m.x;
        f.y_axis += edge * m.y;
        f.z_axis += edge * m.z;
    }
    (f, -(gradients[0] + gradients[1] + gradients[2]))
}

/// [`crate::Corotated`]. Its block has 2 mu (|m|^2 I - K) with the rotation's part K = R skew(m)'
/// (tr(S) I - S)^-1 skew(m) R'. K is at most |m|^2/2 in stretched tissue. In squeezed tissue it
/// would make the block indefinite, and is limited to that.
pub(crate) struct RotatedStrain {
    pub mu: f32,
    pub volume: VolumeTerm,
}

/// Share of |m|^2 that K may take: its share at rest.
const ROTATION_SHARE: f32 = 0.5;

impl VertexElasticity for RotatedStrain {
    #[inline(always)]
    fn add(&self, body: &Body, k: usize, seen: &Seen, local: &mut Local) {
        self.volume.add(body, k, seen, local);
        let (f, m) = deformation(&body.gradients[k], seen.x, seen.others);
        let r = rotation(f);
        let stiffness = 2.0 * self.mu * body.corners[k].volume;
        local.force -= stiffness * ((f - r) * m);
        let rt = r.transpose();
        let s = rt * f;
        let spread = Mat3A::from_diagonal(glam::Vec3::splat(s.x_axis.x + s.y_axis.y + s.z_axis.z)) - s;
        let q = Mat3A::from_cols(m.cross(rt.x_axis), m.cross(rt.y_axis), m.cross(rt.z_axis));
        let mut turning = q.transpose() * (inverse(&spread) * q);
        let [a, b, c] = [turning.x_axis, turning.y_axis, turning.z_axis];
        // One of its eigenvalues is 0, so trace and second invariant give the largest.
        let half = 0.5 * (a.x + b.y + c.z);
        let minors = a.x * b.y - a.y * b.x + b.y * c.z - b.z * c.y + a.x * c.z - a.z * c.x;
        let largest = half + (half * half - minors).max(0.0).sqrt();
        let most = ROTATION_SHARE * m.length_squared();
        if !largest.is_finite() {
            turning = Mat3A::ZERO;
        } else if largest > most {
            turning *= most / largest;
        }
        local.add_isotropic(stiffness * m.length_squared());
        local.block -= turning * stiffness;
    }
}

/// Inverse of a symmetric matrix.
#[inline(always)]
fn inverse(m: &Mat3A) -> Mat3A {
    let [a, b, c] = [m.x_axis, m.y_axis, m.z_axis];
    let (bc, ca, ab) = (b.cross(c), c.cross(a), a.cross(b));
    Mat3A::from_cols(bc, ca, ab) * (1.0 / a.dot(bc))
}

/// The rotation in F = R S by Newton's iteration, as [`crate::Corotated`] computes it in double
/// precision. The guard keeps det F above 0; the floor keeps this finite if it does not.
#[inline(always)]
fn rotation(f: Mat3A) -> Mat3A {
    let norm = |m: &Mat3A| m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared();
    let (mut x, mut change) = (f, f32::INFINITY);
    for _ in 0..12 {
        let [a, b, c] = [x.x_axis, x.y_axis, x.z_axis];
        let (bc, ca, ab) = (b.cross(c), c.cross(a), a.cross(b));
        let inverse = Mat3A::from_cols(bc, ca, ab) * (1.0 / a.dot(bc).max(1e-12));
        // Scaling is faster only far from a rotation.
        let size = norm(&x);
        let near = change < 0.01 || (size - 3.0).abs() < 0.3;
        let scale = if near { 1.0 } else { (norm(&inverse) / size).sqrt().sqrt() };
        let next = x * (0.5 * scale) + inverse * (0.5 / scale);
        change = norm(&(next - x));
        x = next;
        if change < 1e-8 {
            break;
        }
    }
    x
}

/// The kernel of a body's material.
pub(crate) enum Kernel {
    StableNeoHookean(VolumeTerm),
    StVenantKirchhoff(GreenStrain),
    Corotated(RotatedStrain),
}

impl Kernel {
    pub fn of(body: &Body) -> Self {
        let (mu, lambda) = body.material.lame();
        match body.material.model {
            ConstitutiveModel::StableNeoHookean => {
                Self::StableNeoHookean(StableNeoHookean::new(mu, lambda).volume().into())
            }
            ConstitutiveModel::StVenantKirchhoff => {
                Self::StVenantKirchhoff(GreenStrain { mu: mu as f32, lambda: lambda as f32 })
            }
            ConstitutiveModel::Corotated => {
                let volume = Corotated { mu, lambda }.volume().into();
                Self::Corotated(RotatedStrain { mu: mu as f32, volume })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{EulerRot, Mat3, Quat, Vec3};

    #[test]
    fn rotations_of_squeezed_elements_are_found() {
        let turn = Mat3A::from_quat(Quat::from_euler(EulerRot::XYZ, 2.9, -1.1, 0.4));
        let basis = Mat3A::from_quat(Quat::from_euler(EulerRot::XYZ, 0.3, 0.9, -2.0));
        for stretch in [[1.0, 1.0, 1.0], [1.1, 0.9, 1.0], [3.0, 0.2, 1.0], [1e-3, 1.2, 1.25], [0.01, 0.1, 7.0]] {
            let s = basis * Mat3A::from(Mat3::from_diagonal(Vec3::from_array(stretch))) * basis.transpose();
            let error = rotation(turn * s) - turn;
            let norm = error.to_cols_array().iter().map(|e| e * e).sum::<f32>().sqrt();
            // Rounding of F turns it by about epsilon over the two smallest stretches.
            assert!(norm < 2e-6 * stretch[2] / (stretch[0] + stretch[1]), "{stretch:?}: {norm}");
        }
    }
}
