//! XPBD's constraints: elements and support planes.
//!
//! A constraint C of compliance a (its energy is C^2/(2a)) has a multiplier l, 0 at a substep's
//! beginning. A correction changes it by (-C - a l/h^2) / (grad C M^-1 grad C + a/h^2), and moves
//! the vertices by M^-1 grad C times that (XPBD, equations 17 and 18).

use crate::mechanics::Mechanics;
use crate::xpbd_settings::XpbdConstraints;
use glam::{DMat3, DVec3};
use trocar_tissue::{ConstitutiveModel, Hyperelastic, Material, StableNeoHookean};

/// Gradients of a constraint with respect to an element's corners.
type Gradients = [DVec3; 4];

/// Multipliers of an element, one a constraint.
pub(crate) type Multipliers = [f64; 6];

/// Volume ratio below which Hooke's law replaces the material's: in a flat element a stress has no
/// strain to act on.
const MIN_VOLUME_RATIO: f64 = 0.05;

/// The constraints of an element.
enum Law {
    /// Six Green strains with the elastic compliance, their stress the material's.
    Strains { law: Box<dyn Hyperelastic>, hooke: Hooke },
    /// |F| and J - alpha, solved together.
    NeoHookean { mu: f64, lambda: f64, alpha: f64 },
    /// tr(F'F) - 3 and J - 1, each separately.
    StrainTrace { mu: f64, lambda: f64 },
}

/// The elements' constraints.
pub(crate) struct Elements<'a> {
    mechanics: &'a Mechanics,
    law: Law,
    /// 1/h^2 (1/s2).
    rate: f64,
}

impl<'a> Elements<'a> {
    pub fn new(mechanics: &'a Mechanics, material: &Material, constraints: XpbdConstraints, h: f64) -> Self {
        let (mu, lambda) = material.lame();
        let law = match (constraints, material.model) {
            (XpbdConstraints::StrainTrace, _) => Law::StrainTrace { mu, lambda },
            (XpbdConstraints::NeoHookean, ConstitutiveModel::StableNeoHookean) => {
                let law = StableNeoHookean::new(mu, lambda);
                Law::NeoHookean { mu: law.mu, lambda: law.lambda, alpha: law.alpha }
            }
            (XpbdConstraints::NeoHookean | XpbdConstraints::Strains, _) => {
                Law::Strains { law: material.hyperelastic(), hooke: Hooke { mu, lambda } }
            }
        };
        Self { mechanics, law, rate: 1.0 / (h * h) }
    }

    /// Corrects one element after another.
    pub fn sweep(&self, x: &mut [DVec3], w: &[f64], multipliers: &mut [Multipliers]) {
        for (t, tet) in self.mechanics.tets.iter().enumerate() {
            let moves = self.correct(t, x, w, 1.0, &mut multipliers[t]);
            for (i, d) in tet.iter().zip(moves) {
                x[*i as usize] += d;
            }
        }
    }

    /// Adds up all elements' corrections.
    pub fn gather(&self, relaxation: f64, x: &[DVec3], w: &[f64], multipliers: &mut [Multipliers], sum: &mut [DVec3]) {
        for (t, tet) in self.mechanics.tets.iter().enumerate() {
            let moves = self.correct(t, x, w, relaxation, &mut multipliers[t]);
            for (i, d) in tet.iter().zip(moves) {
                sum[*i as usize] += d;
            }
        }
    }

    /// Changes an element's multipliers. Returns how its corners move.
    fn correct(&self, t: usize, x: &[DVec3], w: &[f64], relaxation: f64, multipliers: &mut Multipliers) -> Gradients {
        let m = self.mechanics;
        let f = m.deformation(t, x);
        let w = m.tets[t].map(|i| w[i as usize]);
        let volume = m.volumes[t];
        let mut moves = [DVec3::ZERO; 4];
        let mut push = |change: f64, gradients: &Gradients| {
            for ((d, g), w) in moves.iter_mut().zip(gradients).zip(&w) {
                *d += *w * change * *g;
            }
        };
        match &self.law {
            Law::NeoHookean { mu, lambda, alpha } => {
                let size = norm_squared(f).sqrt();
                let (j, cofactor) = volume_ratio(f);
                if size == 0.0 {
                    return moves;
                }
                let (shape, bulk) = (spread(f * (1.0 / size), &m.gradients[t]), spread(cofactor, &m.gradients[t]));
                let compliance = [self.rate / (mu * volume), self.rate / (lambda * volume)];
                let a = product(&shape, &shape, &w) + compliance[0];
                let b = product(&shape, &bulk, &w);
                let c = product(&bulk, &bulk, &w) + compliance[1];
                let left = [-size - compliance[0] * multipliers[0], alpha - j - compliance[1] * multipliers[1]];
                let determinant = a * c - b * b;
                let changes = [(c * left[0] - b * left[1]) / determinant, (a * left[1] - b * left[0]) / determinant];
                for (k, gradients) in [shape, bulk].iter().enumerate() {
                    multipliers[k] += relaxation * changes[k];
                    push(relaxation * changes[k], gradients);
                }
            }
            Law::StrainTrace { mu, lambda } => {
                let (j, cofactor) = volume_ratio(f);
                let terms = [(norm_squared(f) - 3.0, f * 2.0, *mu), (j - 1.0, cofactor, *lambda)];
                for (k, (value, slope, stiffness)) in terms.into_iter().enumerate() {
                    let gradients = spread(slope, &m.gradients[t]);
                    let change = one(value, self.rate / (stiffness * volume), &gradients, &w, multipliers[k]);
                    multipliers[k] += relaxation * change;
                    push(relaxation * change, &gradients);
                }
            }
            Law::Strains { law, hooke } => {
                let gradients = strain_gradients(f, &m.gradients[t]);
                let stress = second_stress(f, law.as_ref(), hooke);
                let compliance = hooke.compliance(self.rate / volume);
                let mut matrix = compliance;
                let mut left = [0.0; 6];
                for r in 0..6 {
                    // C + a l/h^2, C being the strain that Hooke's law has for the stress.
                    left[r] = -(0..6)
                        .map(|c| compliance[r][c] * (stress[c] * volume / self.rate + multipliers[c]))
                        .sum::<f64>();
                    for c in 0..=r {
                        matrix[r][c] += product(&gradients[r], &gradients[c], &w);
                    }
                }
                let changes = solve(matrix, left);
                for k in 0..6 {
                    multipliers[k] += relaxation * changes[k];
                    push(relaxation * changes[k], &gradients[k]);
                }
            }
        }
        moves
    }
}

/// Linear elasticity over strains in Voigt's order (11, 22, 33, 23, 13, 12; shear doubled).
struct Hooke {
    mu: f64,
    lambda: f64,
}

impl Hooke {
    /// Strain for a stress, times `factor`.
    fn compliance(&self, factor: f64) -> [[f64; 6]; 6] {
        let (mu, lambda) = (self.mu, self.lambda);
        let young = mu * (3.0 * lambda + 2.0 * mu) / (lambda + mu);
        let poisson = 0.5 * lambda / (lambda + mu);
        let mut out = [[0.0; 6]; 6];
        for r in 0..3 {
            for c in 0..3 {
                out[r][c] = factor * if r == c { 1.0 } else { -poisson } / young;
            }
            out[r + 3][r + 3] = factor / mu;
        }
        out
    }

    /// Stress for a strain.
    fn stress(&self, strain: [f64; 6]) -> [f64; 6] {
        let [a, b, c, d, e, f] = strain;
        let pressure = self.lambda * (a + b + c);
        let (mu, twice) = (self.mu, 2.0 * self.mu);
        [twice * a + pressure, twice * b + pressure, twice * c + pressure, mu * d, mu * e, mu * f]
    }
}

/// A symmetric matrix in Voigt's order, shear as it is.
fn voigt(m: DMat3) -> [f64; 6] {
    let [a, b, c] = [m.x_axis, m.y_axis, m.z_axis];
    [a.x, b.y, c.z, b.z, a.z, a.y]
}

/// Second Piola-Kirchhoff stress F^-1 P.
fn second_stress(f: DMat3, law: &dyn Hyperelastic, hooke: &Hooke) -> [f64; 6] {
    let (j, cofactor) = volume_ratio(f);
    if j > MIN_VOLUME_RATIO {
        return voigt(cofactor.transpose() * law.stress(f) * (1.0 / j));
    }
    let mut strain = voigt((f.transpose() * f - DMat3::IDENTITY) * 0.5);
    strain[3..].iter_mut().for_each(|e| *e *= 2.0);
    hooke.stress(strain)
}

/// Gradients of the six Green strains, shear doubled.
fn strain_gradients(f: DMat3, m: &Gradients) -> [Gradients; 6] {
    let mut out = [[DVec3::ZERO; 4]; 6];
    let (a, b, c) = (f.x_axis, f.y_axis, f.z_axis);
    for (k, m) in m.iter().enumerate() {
        let rows = [a * m.x, b * m.y, c * m.z, b * m.z + c * m.y, a * m.z + c * m.x, a * m.y + b * m.x];
        for (gradients, row) in out.iter_mut().zip(rows) {
            gradients[k] = row;
        }
    }
    out
}

/// Solves a positive definite system of which the lower half is given, by Cholesky's factorisation.
fn solve(mut a: [[f64; 6]; 6], mut b: [f64; 6]) -> [f64; 6] {
    for r in 0..6 {
        for c in 0..=r {
            let sum = a[r][c] - (0..c).map(|k| a[r][k] * a[c][k]).sum::<f64>();
            a[r][c] = if r == c { sum.sqrt() } else { sum / a[c][c] };
        }
        b[r] = (b[r] - (0..r).map(|k| a[r][k] * b[k]).sum::<f64>()) / a[r][r];
    }
    for r in (0..6).rev() {
        b[r] = (b[r] - (r + 1..6).map(|k| a[k][r] * b[k]).sum::<f64>()) / a[r][r];
    }
    b
}

/// The correction of one constraint alone; `compliance` is over h^2.
fn one(value: f64, compliance: f64, gradients: &Gradients, w: &[f64; 4], multiplier: f64) -> f64 {
    let weight = product(gradients, gradients, w);
    if weight > 0.0 { -(value + compliance * multiplier) / (weight + compliance) } else { 0.0 }
}

/// A derivative with respect to F as gradients of the corners.
fn spread(slope: DMat3, m: &Gradients) -> Gradients {
    let [b, c, d] = [slope * m[1], slope * m[2], slope * m[3]];
    [-(b + c + d), b, c, d]
}

/// Sum over the corners of w a.b.
fn product(a: &Gradients, b: &Gradients, w: &[f64; 4]) -> f64 {
    (0..4).map(|k| w[k] * a[k].dot(b[k])).sum()
}

fn norm_squared(f: DMat3) -> f64 {
    f.x_axis.length_squared() + f.y_axis.length_squared() + f.z_axis.length_squared()
}

/// J and its derivative.
fn volume_ratio(f: DMat3) -> (f64, DMat3) {
    let [a, b, c] = [f.x_axis, f.y_axis, f.z_axis];
    let cofactor = DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b));
    (a.dot(cofactor.x_axis), cofactor)
}

/// The support planes: depth with compliance 1/k, and friction that takes back at most its share of
/// the sliding.
pub(crate) struct Planes<'a> {
    pub mechanics: &'a Mechanics,
    /// Substep (s).
    pub h: f64,
}

impl Planes<'_> {
    pub fn sweep(&self, x: &mut [DVec3], start: &[DVec3], w: &[f64], multipliers: &mut [f64]) {
        let m = self.mechanics;
        for (p, support) in m.supports.iter().enumerate() {
            for i in (0..x.len()).filter(|i| w[*i] > 0.0) {
                let multiplier = &mut multipliers[p * w.len() + i];
                let touch = support.contact(x[i] + m.origin);
                let (height, normal, steep) =
                    (touch.height, touch.gradient.normalize(), touch.gradient.length_squared());
                let compliance = 1.0 / (self.h * self.h * m.contact_stiffness[i]);
                let before = *multiplier;
                // A plane only pushes.
                *multiplier = (before - (height + compliance * before) / (w[i] * steep + compliance)).max(0.0);
                x[i] += w[i] * (*multiplier - before) * touch.gradient;
                if *multiplier > before {
                    let slide = x[i] - start[i];
                    let slide = slide - slide.dot(normal) * normal;
                    let most = support.friction() * steep.sqrt() * w[i] * (*multiplier - before);
                    x[i] -= slide * (most / slide.length().max(f64::MIN_POSITIVE)).min(1.0);
                }
            }
        }
    }
}
