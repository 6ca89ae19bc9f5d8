//! The strain-limiting part of a stored energy: tissue that is stretched beyond what any organ
//! bears becomes stiff.

use super::volume::dot;
use glam::{DMat3, DVec3};
use trocar_geometry::symmetric::eigen;

/// Square of the principal stretch above which the energy acts.
pub(crate) const MAX_FREE_STRETCH_SQUARED: f64 = 16.0;

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
        Stretches::of(f).map_or(DMat3::ZERO, |s| f * self.second(&s))
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

/// The matrix a b'.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Along one direction nothing acts across it, and the stress is 2 mu s (s^2 - 16).
    #[test]
    fn a_bar_is_pulled_back_along_itself() {
        let energy = StretchEnergy { mu: 3.0 };
        let stress = energy.stress(DMat3::from_diagonal(DVec3::new(5.0, 0.4, 3.9)));
        let expected = DMat3::from_diagonal(DVec3::new(2.0 * 3.0 * 5.0 * 9.0, 0.0, 0.0));
        assert!(dot(stress - expected, stress - expected) < 1e-20);
        assert!(Stretches::of(DMat3::from_diagonal(DVec3::splat(3.99))).is_none());
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
