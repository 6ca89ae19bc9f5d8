//! XPBD's constraints: elements, dashpots, support planes.
//!
//! A constraint C of compliance a (its energy is C^2/(2a)) has a multiplier l, 0 at a substep's beginning, which a correction changes by
//! (-C - a l/h^2) / (grad C M^-1 grad C + a/h^2); the vertices move by M^-1 grad C times that (XPBD, equations 17 and 18).

use super::mechanics::Mechanics;
use super::xpbd::XpbdConstraints;
use crate::{ConstitutiveModel, Hyperelastic, Material, StableNeoHookean};
use glam::{DMat3, DVec3};

/// Gradients of a constraint with respect to an element's corners.
type Gradients = [DVec3; 4];

/// What the elements are held by.
enum Law {
    /// |F| and J - alpha, solved together.
    NeoHookean { mu: f64, lambda: f64, alpha: f64 },
    /// tr(F'F) - 3 and J - 1, each by itself.
    StrainTrace { mu: f64, lambda: f64 },
    /// The root of twice the energy.
    Energy(Box<dyn Hyperelastic>),
}

/// The elements' constraints.
pub(super) struct Elements<'a> {
    mechanics: &'a Mechanics,
    law: Law,
    /// 1/h^2 [1/s2].
    rate: f64,
}

impl<'a> Elements<'a> {
    pub fn new(mechanics: &'a Mechanics, material: &Material, constraints: XpbdConstraints, h: f64) -> Self {
        let (mu, lambda) = material.lame();
        let law = match (constraints, material.model) {
            (XpbdConstraints::StrainTrace, _) => Law::StrainTrace { mu, lambda },
            (XpbdConstraints::Material, ConstitutiveModel::StableNeoHookean) => {
                let law = StableNeoHookean::new(mu, lambda);
                Law::NeoHookean { mu: law.mu, lambda: law.lambda, alpha: law.alpha }
            }
            (XpbdConstraints::Material, _) => Law::Energy(material.hyperelastic()),
        };
        Self { mechanics, law, rate: 1.0 / (h * h) }
    }

    /// Corrects one element after another.
    pub fn sweep(&self, x: &mut [DVec3], w: &[f64], multipliers: &mut [[f64; 2]]) {
        for (t, tet) in self.mechanics.tets.iter().enumerate() {
            let moves = self.correct(t, x, w, 1.0, &mut multipliers[t]);
            for (i, d) in tet.iter().zip(moves) {
                x[*i as usize] += d;
            }
        }
    }

    /// Adds up all elements' corrections.
    pub fn gather(&self, relaxation: f64, x: &[DVec3], w: &[f64], multipliers: &mut [[f64; 2]], sum: &mut [DVec3]) {
        for (t, tet) in self.mechanics.tets.iter().enumerate() {
            let moves = self.correct(t, x, w, relaxation, &mut multipliers[t]);
            for (i, d) in tet.iter().zip(moves) {
                sum[*i as usize] += d;
            }
        }
    }

    /// Changes an element's multipliers and says how its corners move.
    fn correct(&self, t: usize, x: &[DVec3], w: &[f64], relaxation: f64, multipliers: &mut [f64; 2]) -> Gradients {
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
            Law::Energy(law) => {
                let value = (2.0 * volume * law.energy(f).max(0.0)).sqrt();
                if value > 0.0 {
                    let gradients = spread(law.stress(f) * (volume / value), &m.gradients[t]);
                    let change = one(value, self.rate, &gradients, &w, multipliers[0]);
                    multipliers[0] += relaxation * change;
                    push(relaxation * change, &gradients);
                }
            }
        }
        moves
    }
}

/// The correction of one constraint by itself; `compliance` is over h^2.
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

/// The dashpots: the stretching of an edge during the substep, along its direction at the beginning, with compliance h/c.
pub(super) struct Dashpots<'a> {
    pub mechanics: &'a Mechanics,
    /// Substep [s].
    pub h: f64,
}

impl Dashpots<'_> {
    pub fn sweep(&self, x: &mut [DVec3], start: &[DVec3], w: &[f64], multipliers: &mut [f64]) {
        for (([i, j], coefficient), multiplier) in self.mechanics.dashpots.iter().zip(multipliers) {
            let (i, j) = (*i as usize, *j as usize);
            if w[i] + w[j] == 0.0 {
                continue;
            }
            let n = (start[j] - start[i]).normalize_or_zero();
            let stretching = n.dot((x[j] - start[j]) - (x[i] - start[i]));
            let compliance = 1.0 / (self.h * coefficient);
            let change = -(stretching + compliance * *multiplier) / (w[i] + w[j] + compliance);
            *multiplier += change;
            x[i] -= w[i] * change * n;
            x[j] += w[j] * change * n;
        }
    }
}

/// The support planes: depth with compliance 1/k, and friction that takes back at most its share of the sliding.
pub(super) struct Planes<'a> {
    pub mechanics: &'a Mechanics,
    /// Substep [s].
    pub h: f64,
}

impl Planes<'_> {
    pub fn sweep(&self, x: &mut [DVec3], start: &[DVec3], w: &[f64], multipliers: &mut [f64]) {
        let m = self.mechanics;
        for (p, plane) in m.planes.iter().enumerate() {
            for i in (0..x.len()).filter(|i| w[*i] > 0.0) {
                let multiplier = &mut multipliers[p * w.len() + i];
                let height = (x[i] - plane.point).dot(plane.normal);
                let compliance = 1.0 / (self.h * self.h * m.contact_stiffness[i]);
                let before = *multiplier;
                // A plane only pushes.
                *multiplier = (before - (height + compliance * before) / (w[i] + compliance)).max(0.0);
                x[i] += w[i] * (*multiplier - before) * plane.normal;
                if *multiplier > before {
                    let slide = x[i] - start[i];
                    let slide = slide - slide.dot(plane.normal) * plane.normal;
                    let most = plane.friction * w[i] * (*multiplier - before);
                    x[i] -= slide * (most / slide.length().max(f64::MIN_POSITIVE)).min(1.0);
                }
            }
        }
    }
}
