//! The strain-limiting part of a stored energy: tissue that is stretched beyond what any organ
//! bears becomes stiff.

use super::volume::dot;
use glam::{DMat3, DVec3};
use trocar_geometry::symmetric::{cofactor, eigen};

/// Square of the principal stretch above which the energy acts.
pub(crate) const MAX_FREE_STRETCH_SQUARED: f64 = 16.0;

/// Newton's steps to the largest eigenvalue, at most, and the share of it that ends them.
const MAX_NEWTON_STEPS: usize = 40;
const NEWTON_TOLERANCE: f64 = 1e-14;

/// Product of the distances of the largest eigenvalue from the others, over its square, from which
/// its eigenvector is certain.
const MIN_GAP: f64 = 1e-4;

/// mu/2 (s^2 - 16)^2 for every principal stretch s above 4: mu/2 |(C - 16 I)+|^2, with C = F'F and
/// the positive part of its eigenvalues.
///
/// Soft tissue stiffens under tension as its collagen straightens, and tears at stretches of 1.5 to
/// 2.5. The materials here do neither: without this term a few newtons stretch soft tissue tenfold.
/// The nominal stress along a bar is at a stretch of 5, 6 and 7 about 90, 240 and 460 mu. The
/// energy is convex in F, and does not press across the stretch. A model of tearing would replace
/// it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StretchEnergy {
    /// Shear modulus mu (Pa).
    pub mu: f64,
}

/// The principal stretches of an F that is stretched beyond the limit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretches {
    /// Squares of the principal stretches.
    squares: DVec3,
    /// The principal directions at rest.
    axes: DMat3,
}

impl Stretches {
    /// Of F; None if no stretch is beyond the limit.
    pub fn of(f: DMat3) -> Option<Self> {
        // The largest is at most the sum.
        if dot(f, f) <= MAX_FREE_STRETCH_SQUARED {
            return None;
        }
        let (squares, axes) = eigen(f.transpose() * f);
        (squares.max_element() > MAX_FREE_STRETCH_SQUARED).then_some(Self { squares, axes })
    }

    /// The directions at rest along which the tissue is stretched beyond the limit.
    pub fn directions(self) -> impl Iterator<Item = DVec3> {
        (0..3).filter(move |k| self.squares[*k] > MAX_FREE_STRETCH_SQUARED).map(move |k| self.axes.col(k))
    }
}

impl StretchEnergy {
    /// Energy density at F (J/m3).
    pub fn energy(&self, f: DMat3) -> f64 {
        Stretches::of(f).map_or(0.0, |s| 0.5 * self.mu * beyond(s.squares).length_squared())
    }

    /// Its part of the stress: 2 mu F (C - 16 I)+ (Pa).
    pub fn stress(&self, f: DMat3) -> DMat3 {
        if dot(f, f) <= MAX_FREE_STRETCH_SQUARED {
            return DMat3::ZERO;
        }
        match beyond_along_one(f.transpose() * f) {
            Some(beyond) => f * (beyond * (2.0 * self.mu)),
            None => Stretches::of(f).map_or(DMat3::ZERO, |s| f * self.second(&s)),
        }
    }

    /// 2 mu (C - 16 I)+ (Pa).
    fn second(&self, s: &Stretches) -> DMat3 {
        s.axes * DMat3::from_diagonal(2.0 * self.mu * beyond(s.squares)) * s.axes.transpose()
    }

    /// First-order change of [`Self::stress`] when F changes by `change` (Pa). The positive part
    /// changes by the divided differences of its eigenvalues (Daleckii and Krein 1965).
    pub fn stress_change(&self, f: DMat3, change: DMat3) -> DMat3 {
        let Some(s) = Stretches::of(f) else { return DMat3::ZERO };
        let product = f.transpose() * change;
        let mut turned = s.axes.transpose() * (product + product.transpose()) * s.axes;
        for j in 0..3 {
            for i in 0..3 {
                turned.col_mut(j)[i] *= self.slope(&s, i, j);
            }
        }
        change * self.second(&s) + f * (s.axes * turned * s.axes.transpose())
    }

    /// Divided difference of 2 mu (c - 16)+ at the squares of stretches i and j (Pa).
    fn slope(&self, s: &Stretches, i: usize, j: usize) -> f64 {
        let (a, b) = (s.squares[i], s.squares[j]);
        let [above, below] = [a.max(b), a.min(b)];
        let part = if below > MAX_FREE_STRETCH_SQUARED {
            1.0
        } else if above <= MAX_FREE_STRETCH_SQUARED {
            0.0
        } else {
            (above - MAX_FREE_STRETCH_SQUARED) / (above - below)
        };
        2.0 * self.mu * part
    }

    /// Gradient of the energy density by a node whose shape function has the rest gradient `m`
    /// (Pa/m), and its second derivative (Pa/m2), positive semidefinite.
    pub fn at_node(&self, f: DMat3, m: DVec3) -> Option<(DVec3, DMat3)> {
        let s = Stretches::of(f)?;
        let along = s.axes.transpose() * m;
        let moved = f * s.axes;
        let stiffness = dot(DMat3::from_diagonal(2.0 * self.mu * beyond(s.squares)), outer(along, along));
        let mut block = DMat3::from_diagonal(DVec3::splat(stiffness));
        for i in 0..3 {
            for j in 0..3 {
                let slope = self.slope(&s, i, j);
                block += outer(moved.col(i), moved.col(j)) * (slope * along[i] * along[j]);
                block += outer(moved.col(i), moved.col(i)) * (slope * along[j] * along[j]);
            }
        }
        Some((f * (self.second(&s) * m), block))
    }
}

/// The parts of squared stretches that are beyond the limit.
fn beyond(squares: DVec3) -> DVec3 {
    (squares - DVec3::splat(MAX_FREE_STRETCH_SQUARED)).max(DVec3::ZERO)
}

/// (C - 16 I)+ if C has one eigenvalue above 16; None if it has others, or two that are too close.
///
/// Newton's method from above finds the largest eigenvalue c of a symmetric matrix without passing
/// it. The adjugate of C - c I is a multiple of the projection onto its eigenvector.
fn beyond_along_one(c: DMat3) -> Option<DMat3> {
    let (trace, minors, determinant) = (c.x_axis.x + c.y_axis.y + c.z_axis.z, sum_of_minors(c), c.determinant());
    let at = |x: f64| ((x - trace) * x + minors) * x - determinant;
    // One eigenvalue is above 16, or all three are.
    let limit = MAX_FREE_STRETCH_SQUARED;
    if at(limit) >= 0.0 || (3.0 * limit - 2.0 * trace) * limit + minors > 0.0 && trace > 3.0 * limit {
        return None;
    }
    let mut largest = dot(c, c).sqrt();
    for _ in 0..MAX_NEWTON_STEPS {
        let slope = (3.0 * largest - 2.0 * trace) * largest + minors;
        let step = at(largest) / slope;
        largest -= step;
        if step <= NEWTON_TOLERANCE * largest {
            break;
        }
    }
    let rest = c - DMat3::from_diagonal(DVec3::splat(largest));
    let adjugate = cofactor(rest);
    let size = adjugate.x_axis.x + adjugate.y_axis.y + adjugate.z_axis.z;
    (size > MIN_GAP * largest * largest).then(|| adjugate * ((largest - limit) / size))
}

/// Sum of the principal minors of two rows: the second invariant.
fn sum_of_minors(c: DMat3) -> f64 {
    let minor = |i: usize, j: usize| c.col(i)[i] * c.col(j)[j] - c.col(j)[i] * c.col(i)[j];
    minor(0, 1) + minor(0, 2) + minor(1, 2)
}

/// The matrix a b'.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;
    use trocar_core::Random;

    /// Along one direction nothing acts across it, and the stress is 2 mu s (s^2 - 16).
    #[test]
    fn a_bar_is_pulled_back_along_itself() {
        let energy = StretchEnergy { mu: 3.0 };
        let stress = energy.stress(DMat3::from_diagonal(DVec3::new(5.0, 0.4, 3.9)));
        let expected = DMat3::from_diagonal(DVec3::new(2.0 * 3.0 * 5.0 * 9.0, 0.0, 0.0));
        assert!(dot(stress - expected, stress - expected) < 1e-20);
        assert!(Stretches::of(DMat3::from_diagonal(DVec3::splat(3.99))).is_none());
    }

    /// The quick way for one direction gives the stress of all eigenvectors.
    #[test]
    fn one_direction_is_found_without_the_others() {
        let energy = StretchEnergy { mu: 3.0 };
        let mut quick = 0;
        for seed in 0..2000 {
            let random = Random::from_keys(&[seed]);
            let number = |k: u64| random.normal(k);
            let turn = |k: u64| {
                let q = DQuat::from_xyzw(number(k), number(k + 1), number(k + 2), number(k + 3)).normalize();
                DMat3::from_quat(q)
            };
            let stretch = DVec3::new(number(20), number(21), number(22)).exp() * 3.0;
            let f = turn(0) * DMat3::from_diagonal(stretch) * turn(10);
            let expected = Stretches::of(f).map_or(DMat3::ZERO, |s| f * energy.second(&s));
            let off = energy.stress(f) - expected;
            assert!(dot(off, off).sqrt() <= 1e-9 * dot(expected, expected).sqrt() + 1e-9, "{stretch}");
            let above = stretch.to_array().iter().filter(|s| **s > 4.0).count();
            let found = beyond_along_one(f.transpose() * f).is_some();
            assert!(!found || above == 1, "{stretch}");
            quick += usize::from(found);
        }
        assert!(quick > 500, "{quick}");
        let nearly = energy.stress(DMat3::from_diagonal(DVec3::new(4.001, 3.9999999, 1.0)));
        assert!(
            (nearly.x_axis.x - 6.0 * 4.001 * (4.001f64.powi(2) - 16.0)).abs() < 1e-9 && nearly.y_axis.y.abs() < 1e-9
        );
    }

    /// A node's gradient and block are those of the stress and its change.
    #[test]
    fn nodes_feel_the_stress() {
        let energy = StretchEnergy { mu: 3.0 };
        let skew =
            DMat3::from_cols(DVec3::new(1.1, 0.2, -0.1), DVec3::new(-0.3, 0.8, 0.25), DVec3::new(0.05, -0.2, 1.3));
        let m = DVec3::new(0.7, -1.1, 0.4);
        for stretch in [DVec3::new(5.0, 0.4, 0.7), DVec3::new(5.0, 6.0, 0.2), DVec3::splat(5.0)] {
            let f = DMat3::from_diagonal(stretch) * skew;
            let (gradient, block) = energy.at_node(f, m).unwrap();
            assert!((gradient - energy.stress(f) * m).length() < 1e-9 * gradient.length());
            for axis in DVec3::AXES {
                let column = energy.stress_change(f, outer(axis, m)) * m;
                assert!((column - block * axis).length() < 1e-9 * block.x_axis.length(), "{stretch}: {column}");
            }
        }
    }
}
