//! The joint velocities after a step with implicit Coulomb friction, stops and stiff contacts.
//!
//! They minimise a convex function of the joint velocities v,
//!
//! F(v) = v^T H v / 2 - b^T v + sum_i f_i |v_i| + sum_r phi_r(J_r v),  low_i <= v_i <= high_i,
//!
//! Gauss's principle of least constraint for one step of implicit Euler (Moreau's time stepping, in
//! the form of Todorov 2014). H is the mass matrix with the implicit damping, f_i the impulse of
//! friction, phi_r the potential of a spring that may be one-sided or may slip. The unknowns are
//! velocities, not impulses: a joint that sticks has a velocity of exactly zero and does not creep,
//! and a joint that reaches a stop has exactly the velocity that brings it there.
//!
//! A round is a sweep of exact proximal steps, joint by joint, which finds the sticking joints, and
//! then a Newton step of the moving joints. Both decrease F, which is convex, so the rounds
//! converge, usually after two or three.

use super::joints::{JointSet, Joints, MAX_JOINTS};
use super::matrix::JointMatrix;

/// Maximum number of rounds, far more than needed.
const MAX_ROUNDS: usize = 200;
/// Changes of velocity below this share of the maximum are ignored.
const TOLERANCE: f64 = 1e-12;
/// Changes of impulse below this share of the summed magnitudes are rounding.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// A resistance along one direction in joint space: the impulse `-(offset + slope u)` at the speed
/// u = row . v, within bounds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub row: Joints,
    /// Impulse per unit of speed, not negative.
    pub slope: f64,
    /// Impulse against the row at zero speed.
    pub offset: f64,
    /// Minimum and maximum impulse along the row.
    pub bounds: [f64; 2],
}

impl Row {
    pub(super) const NONE: Self = Self { row: Joints::zeros(0), slope: 0.0, offset: 0.0, bounds: [0.0, 0.0] };

    /// The impulse along the row at the velocities `v`.
    pub(super) fn impulse(&self, v: &Joints) -> f64 {
        (-(self.offset + self.slope * self.row.dot(v))).max(self.bounds[0]).min(self.bounds[1])
    }

    /// Whether the impulse is inside its bounds at `v`, where it changes with speed.
    fn is_free(&self, v: &Joints) -> bool {
        let p = -(self.offset + self.slope * self.row.dot(v));
        p > self.bounds[0] && p < self.bounds[1]
    }
}

/// The function to minimise.
pub(super) struct Problem<'a> {
    pub h: &'a JointMatrix,
    pub b: &'a Joints,
    /// Impulse of friction of each joint.
    pub friction: &'a Joints,
    pub low: &'a Joints,
    pub high: &'a Joints,
    pub rows: &'a [Row],
}

impl Problem<'_> {
    /// Gradient of the smooth part. At the minimum it is the impulse of friction and stops.
    pub(super) fn gradient(&self, v: &Joints) -> Joints {
        let mut g = self.h.times(v);
        for (g, b) in g.iter_mut().zip(self.b.iter()) {
            *g -= b;
        }
        for r in self.rows {
            let p = r.impulse(v);
            if p != 0.0 {
                for (g, j) in g.iter_mut().zip(r.row.iter()) {
                    *g -= p * j;
                }
            }
        }
        g
    }

    /// The velocity of joint `i` that minimises F for this joint alone, with the curvature `q`.
    fn proximal(&self, i: usize, v: f64, g: f64, q: f64) -> f64 {
        let (t, f) = (v - g / q, self.friction[i] / q);
        let shrunk = if t > f {
            t - f
        } else if t < -f {
            t + f
        } else {
            0.0
        };
        shrunk.max(self.low[i]).min(self.high[i])
    }

    /// Moves `v` to the minimum. Returns whether it was reached.
    pub(super) fn minimise(&self, v: &mut Joints) -> bool {
        let n = v.len();
        for i in 0..n {
            v[i] = v[i].max(self.low[i]).min(self.high[i]);
        }
        // An upper bound of the curvature along each joint: all rows are free.
        let curvature = Joints::from_fn(n, |i| {
            self.h.at(i, i) + self.rows.iter().map(|r| r.slope * r.row.at(i) * r.row.at(i)).sum::<f64>()
        });
        let rounding = Joints::from_fn(n, |i| {
            let springs: f64 = self.rows.iter().map(|r| (r.offset * r.row.at(i)).abs()).sum();
            ROUNDING * (self.b[i].abs() + springs) / self.h.at(i, i)
        });
        for _ in 0..MAX_ROUNDS {
            let g = self.gradient(v);
            let slow = TOLERANCE * v.max_abs();
            let wrong = |i: usize| (self.proximal(i, v[i], g[i], curvature[i]) - v[i]).abs() > slow.max(rounding[i]);
            if !(0..n).any(wrong) {
                return true;
            }
            self.sweep(v, &curvature);
            self.newton(v);
        }
        false
    }

    /// Moves each joint in turn to its own minimum.
    fn sweep(&self, v: &mut Joints, curvature: &Joints) {
        let mut g = self.gradient(v);
        for i in 0..v.len() {
            let new = self.proximal(i, v[i], g[i], curvature[i]);
            if new == v[i] {
                continue;
            }
            if self.rows.is_empty() {
                let d = new - v[i];
                v[i] = new;
                for (k, g) in g.iter_mut().enumerate() {
                    *g += self.h.at(k, i) * d;
                }
            } else {
                v[i] = new;
                g = self.gradient(v);
            }
        }
    }

    /// A Newton step of the joints that neither stick nor are at a stop, up to the first one that
    /// sticks or reaches a stop.
    fn newton(&self, v: &mut Joints) {
        let n = v.len();
        let mut free = JointSet::default();
        for i in 0..n {
            if (v[i] != 0.0 || self.friction[i] == 0.0) && v[i] > self.low[i] && v[i] < self.high[i] {
                free.insert(i);
            }
        }
        if free.is_empty() {
            return;
        }
        let g = self.gradient(v);
        let mut list = [0; MAX_JOINTS];
        let mut m = 0;
        for i in free.iter() {
            list[m] = i;
            m += 1;
        }
        let mut h = JointMatrix::zeros(m);
        for a in 0..m {
            for b in 0..=a {
                h.set(a, b, self.h.at(list[a], list[b]));
            }
        }
        for r in self.rows.iter().filter(|r| r.is_free(v)) {
            h.add_outer(r.slope, &Joints::from_fn(m, |a| r.row.at(list[a])));
        }
        let slide = |i: usize, v: f64| if v == 0.0 { 0.0 } else { self.friction[i] * v.signum() };
        let down = Joints::from_fn(m, |a| -(g[list[a]] + slide(list[a], v[list[a]])));
        let Some(factor) = h.factor() else { return };
        let d = factor.solve(&down);
        // The step to the first kink or stop.
        let (mut reach, mut first) = (1.0, None);
        for a in 0..m {
            let (i, from) = (list[a], v[list[a]]);
            let mut ends = [self.low[i], self.high[i]];
            if self.friction[i] > 0.0 {
                ends = if from > 0.0 { [ends[0].max(0.0), ends[1]] } else { [ends[0], ends[1].min(0.0)] };
            }
            let end = if d[a] < 0.0 { ends[0] } else { ends[1] };
            if (from + d[a] - end) * d[a] > 0.0 && (end - from) / d[a] < reach {
                (reach, first) = ((end - from) / d[a], Some((i, end)));
            }
        }
        let old = *v;
        let step_to = |share: f64| {
            let mut to = old;
            for a in 0..m {
                to[list[a]] += share * d[a];
            }
            to
        };
        let slope = |to: &Joints| {
            let g = self.gradient(to);
            (0..m).map(|a| (g[list[a]] + slide(list[a], old[list[a]])) * d[a]).sum::<f64>()
        };
        let end = step_to(reach);
        // If rows reach or leave their bounds on the way, the function is not the parabola of the
        // Newton step. The minimum along the step is found by bisection: the slope is monotone.
        if self.rows.iter().any(|r| r.is_free(&old) != r.is_free(&end)) && slope(&end) > 0.0 {
            let (mut low, mut high) = (0.0, reach);
            for _ in 0..30 {
                let middle = 0.5 * (low + high);
                if slope(&step_to(middle)) > 0.0 { high = middle } else { low = middle }
            }
            *v = step_to(low);
            return;
        }
        *v = end;
        if let Some((i, end)) = first {
            v[i] = end;
        }
    }
}
