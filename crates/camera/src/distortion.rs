//! OpenCV's lens distortion and its inverse: the rational model of `calib3d` and the equidistant
//! model of `fisheye` (OpenCV documentation, "Camera Calibration and 3D Reconstruction" and
//! "Fisheye camera model").

use glam::{DMat2, DVec2};
use serde::{Deserialize, Serialize};

/// Tolerance of image points in units of the focal length: 1e-10 px for a focal length of 1000 px.
const TOLERANCE: f64 = 1e-13;
/// Maximum number of Newton steps. About five suffice except at the edge of the lens.
const MAX_STEPS: usize = 60;

/// OpenCV's rational distortion, with coefficients in its order: k1 k2 p1 p2 k3 k4 k5 k6. A file
/// has the first 4, 5 or all 8.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<f64>", into = "Vec<f64>")]
pub struct Distortion(pub [f64; 8]);

impl Distortion {
    /// Whether all coefficients are zero.
    pub fn is_none(&self) -> bool {
        self.0 == [0.0; 8]
    }

    /// The distorted image point of an ideal image point (x, y) = (X/Z, Y/Z).
    pub fn apply(&self, p: DVec2) -> DVec2 {
        let [k1, k2, p1, p2, k3, k4, k5, k6] = self.0;
        let r2 = p.length_squared();
        let radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
        let xy = p.x * p.y;
        DVec2::new(
            p.x * radial + 2.0 * p1 * xy + p2 * (r2 + 2.0 * p.x * p.x),
            p.y * radial + p1 * (r2 + 2.0 * p.y * p.y) + 2.0 * p2 * xy,
        )
    }

    /// The ideal image point of the distorted image point `q`; `None` if there is none before the
    /// fold. Outside the image it was fitted to, the polynomial may decrease again: beyond this
    /// fold, points coincide with others.
    pub fn invert(&self, q: DVec2) -> Option<DVec2> {
        if self.is_none() {
            return Some(q);
        }
        // Starts at the point without distortion. If that crosses the fold, starts at the solution
        // of the radial part alone.
        self.newton(q, q).or_else(|| self.newton(q, self.radial_start(q)))
    }

    /// [`Self::invert`], or a point at the fold if there is no inverse.
    pub(crate) fn invert_or_fold(&self, q: DVec2) -> DVec2 {
        self.invert(q).unwrap_or_else(|| self.radial_start(q))
    }

    /// Newton's method. Each step is halved until the residual decreases and the map preserves
    /// orientation.
    fn newton(&self, q: DVec2, start: DVec2) -> Option<DVec2> {
        let mut p = start;
        let mut residual = q - self.apply(p);
        for _ in 0..MAX_STEPS {
            if residual.length_squared() < TOLERANCE * TOLERANCE {
                break;
            }
            let jacobian = self.jacobian(p);
            let step = jacobian.inverse() * residual;
            let mut share = 1.0;
            loop {
                let next = p + share * step;
                let left = q - self.apply(next);
                // This form rejects NaN.
                if left.length_squared() < residual.length_squared() && self.preserves_orientation(next) {
                    (p, residual) = (next, left);
                    break;
                }
                share *= 0.5;
                if share < 1e-4 {
                    // Converged up to rounding, or stuck.
                    return (residual.length() < 1e-11 && self.preserves_orientation(p)).then_some(p);
                }
            }
        }
        (residual.length() < 1e-11 && self.preserves_orientation(p)).then_some(p)
    }

    /// Whether the map preserves orientation at `p`, in radius and as a whole.
    fn preserves_orientation(&self, p: DVec2) -> bool {
        let [.., k4, k5, k6] = self.0;
        let r2 = p.length_squared();
        self.jacobian(p).determinant() > 0.0 && self.slope(r2) > 0.0 && 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)) > 0.0
    }

    /// d(r radial)/dr at the squared radius `r2`.
    fn slope(&self, r2: f64) -> f64 {
        let (radial, change) = self.radial(r2);
        radial + 2.0 * r2 * change
    }

    /// The radial factor and its derivative with respect to the squared radius.
    fn radial(&self, r2: f64) -> (f64, f64) {
        let [k1, k2, _, _, k3, k4, k5, k6] = self.0;
        let above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
        let above_change = k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3);
        let below_change = k4 + r2 * (2.0 * k5 + 3.0 * r2 * k6);
        (above / below, (above_change * below - above * below_change) / (below * below))
    }

    fn jacobian(&self, p: DVec2) -> DMat2 {
        let [_, _, p1, p2, ..] = self.0;
        let (radial, change) = self.radial(p.length_squared());
        let cross = 2.0 * p.x * p.y * change + 2.0 * p1 * p.x + 2.0 * p2 * p.y;
        DMat2::from_cols(
            DVec2::new(radial + 2.0 * p.x * p.x * change + 2.0 * p1 * p.y + 6.0 * p2 * p.x, cross),
            DVec2::new(cross, radial + 2.0 * p.y * p.y * change + 6.0 * p1 * p.y + 2.0 * p2 * p.x),
        )
    }

    /// The point in the direction of `q` whose radial part has the radius of `q`, or the last one
    /// before the fold.
    fn radial_start(&self, q: DVec2) -> DVec2 {
        let wanted = q.length();
        let (mut low, mut high) = (0.0, 0.0);
        // Small steps outwards until the radius is passed or the fold is reached.
        for _ in 0..4000 {
            high += 0.005 * (1.0 + high);
            if !self.increases_radius(high) || high * self.radial(high * high).0 >= wanted {
                break;
            }
            low = high;
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.increases_radius(middle) && middle * self.radial(middle * middle).0 < wanted {
                low = middle;
            } else {
                high = middle;
            }
        }
        q.normalize_or_zero() * low
    }

    fn increases_radius(&self, r: f64) -> bool {
        let [.., k4, k5, k6] = self.0;
        let r2 = r * r;
        self.slope(r2) > 0.0 && 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)) > 0.0
    }
}

impl TryFrom<Vec<f64>> for Distortion {
    type Error = String;

    fn try_from(v: Vec<f64>) -> std::result::Result<Self, String> {
        if !matches!(v.len(), 0 | 4 | 5 | 8) {
            return Err(format!(
                "distortion has {} coefficients; OpenCV's k1 k2 p1 p2 [k3 [k4 k5 k6]] has 4, 5 or 8",
                v.len()
            ));
        }
        let mut k = [0.0; 8];
        for (k, v) in k.iter_mut().zip(v) {
            *k = v;
        }
        Ok(Self(k))
    }
}

impl From<Distortion> for Vec<f64> {
    fn from(d: Distortion) -> Self {
        d.0.to_vec()
    }
}

/// OpenCV's fisheye distortion k1 k2 k3 k4. The image of a ray at angle a from the axis is at
/// distance a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8) from the centre, in units of the focal
/// length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Fisheye(pub [f64; 4]);

impl Fisheye {
    /// Distance from the centre of the image of a ray at `angle` (rad) from the axis.
    pub fn apply(&self, angle: f64) -> f64 {
        let [k1, k2, k3, k4] = self.0;
        let a2 = angle * angle;
        angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))
    }

    /// The angle (rad) of the ray whose image is at `distance` from the centre; `None` beyond half
    /// a turn or beyond the fold.
    pub fn invert(&self, distance: f64) -> Option<f64> {
        let [k1, k2, k3, k4] = self.0;
        let slope = |a: f64| {
            let a2 = a * a;
            1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * 9.0 * k4)))
        };
        const SEARCH_STEPS: usize = 64;
        let (mut low, mut high) = (0.0, 0.0);
        for i in 1..=SEARCH_STEPS {
            high = std::f64::consts::PI * i as f64 / SEARCH_STEPS as f64;
            if slope(high) <= 0.0 || self.apply(high) >= distance {
                break;
            }
            low = high;
        }
        // The root is bracketed. A Newton step that leaves the bracket is replaced by bisection.
        let mut a = distance.clamp(low, high);
        for _ in 0..MAX_STEPS {
            let value = self.apply(a) - distance;
            if value.abs() < TOLERANCE {
                break;
            }
            if value > 0.0 || slope(a) <= 0.0 {
                high = a;
            } else {
                low = a;
            }
            let next = a - value / slope(a);
            a = if next > low && next < high { next } else { 0.5 * (low + high) };
        }
        ((self.apply(a) - distance).abs() < 1e-11 && slope(a) > 0.0).then_some(a)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// OpenCV's sample (5 coefficients), a wide rational lens, a pincushion and a barrel that folds
    /// at r = 0.82.
    const LENSES: [[f64; 8]; 4] = [
        [-0.2855, 0.0792, 1.27e-3, -1.1e-4, 0.0412, 0.0, 0.0, 0.0],
        [0.5479, -0.0210, -7.21e-5, 2.06e-5, -0.00265, 0.8897, 0.0861, -0.0139],
        [0.4, 0.2, 1e-3, 2e-3, 0.1, 0.0, 0.0, 0.0],
        [-0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    ];

    #[test]
    fn invert_inverts_apply_up_to_the_fold() {
        for (lens, reach) in LENSES.iter().zip([0.9, 1.5, 2.0, 0.81]) {
            let lens = Distortion(*lens);
            for i in 0..40 {
                for turn in 0..12 {
                    let r = reach * f64::from(i) / 39.0;
                    let p = r * DVec2::from_angle(0.5 * f64::from(turn));
                    let back = lens.invert(lens.apply(p));
                    assert!(back.is_some_and(|b| (b - p).length() < 1e-8), "{lens:?} at {p}: {back:?}");
                }
            }
        }
    }

    #[test]
    fn there_is_no_inverse_beyond_the_fold() {
        let lens = Distortion(LENSES[3]);
        // The fold is at r^2 = 1 / 1.5, where the distorted radius is two thirds of r.
        let farthest = (2.0_f64 / 3.0).sqrt() * 2.0 / 3.0;
        assert!(lens.invert(DVec2::new(0.999 * farthest, 0.0)).is_some());
        assert_eq!(lens.invert(DVec2::new(1.001 * farthest, 0.0)), None);
        assert!((lens.invert_or_fold(DVec2::new(2.0, 0.0)).x - (2.0_f64 / 3.0).sqrt()).abs() < 1e-6);
        assert_eq!(Fisheye([-0.3, 0.0, 0.0, 0.0]).invert(1.0), None);
        for bad in [DVec2::NAN, DVec2::INFINITY] {
            assert_eq!(lens.invert(bad), None);
        }
    }

    #[test]
    fn a_fisheye_is_inverted_beyond_a_right_angle() {
        for k in [[0.0; 4], [-0.02, 0.003, -0.0006, 0.00004], [0.1, -0.02, 0.01, -0.001]] {
            for i in 0..100 {
                let angle = 1.9 * f64::from(i) / 99.0;
                let back = Fisheye(k).invert(Fisheye(k).apply(angle));
                assert!(back.is_some_and(|a| (a - angle).abs() < 1e-10), "{k:?} at {angle}: {back:?}");
            }
        }
    }
}
