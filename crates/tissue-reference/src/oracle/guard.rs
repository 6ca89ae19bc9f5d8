//! How far all nodes may go along a direction before an element loses its volume.

use super::potential::Elastic;
use super::solution::Failure;
use glam::DVec3;

/// A step leaves each element this share of the volume it has.
const KEPT_SHARE: f64 = 0.1;

/// The largest share of the step, up to 1, on the whole way of which every element keeps a tenth of
/// its volume.
pub(super) fn allowed_share(elastic: &Elastic, x: &[DVec3], step: &[DVec3]) -> f64 {
    let mut share = 1.0;
    for t in 0..elastic.tets.len() {
        let (f, d) = (elastic.deformation(t, x), elastic.deformation(t, step));
        let [a, b, c] = [f.x_axis, f.y_axis, f.z_axis];
        let [p, q, r] = [d.x_axis, d.y_axis, d.z_axis];
        let j = f.determinant();
        let slope = p.dot(b.cross(c)) + a.dot(q.cross(c)) + a.dot(b.cross(r));
        let second = p.dot(q.cross(c)) + p.dot(b.cross(r)) + a.dot(q.cross(r));
        share = first_below(KEPT_SHARE * j, [j, slope, second, d.determinant()], share);
    }
    share
}

/// Where the cubic with these coefficients first falls below `floor`, up to `end`; a little before
/// it rather than after it. 0 where it is NaN.
fn first_below(floor: f64, [c0, c1, c2, c3]: [f64; 4], end: f64) -> f64 {
    if c0 - end * (c1.abs() + c2.abs() + c3.abs()) >= floor {
        return end;
    }
    let at = |s: f64| c0 + s * (c1 + s * (c2 + s * c3));
    // It is monotonic between the roots of its derivative, c1 + 2 c2 s + 3 c3 s^2; where there are
    // none, this is NaN or out of range.
    let q = -(c2 + (c2 * c2 - 3.0 * c1 * c3).sqrt().copysign(c2));
    let (one, other) = (q / (3.0 * c3), c1 / q);
    let mut from = 0.0;
    for to in [one.min(other), one.max(other), end] {
        if !(from..=end).contains(&to) {
            continue;
        }
        if at(to) >= floor {
            from = to;
            continue;
        }
        let mut beyond = to;
        for _ in 0..52 {
            let middle = 0.5 * (from + beyond);
            if at(middle) >= floor {
                from = middle;
            } else {
                beyond = middle;
            }
        }
        return from;
    }
    // NaN: no step.
    if at(end) >= floor { end } else { 0.0 }
}

/// Checks that every element has a volume.
pub(super) fn check(elastic: &Elastic, x: &[DVec3]) -> Result<(), Failure> {
    for element in 0..elastic.tets.len() {
        let ratio = elastic.deformation(element, x).determinant();
        if ratio.is_nan() || ratio <= 0.0 {
            return Err(Failure::Inverted { element, ratio });
        }
    }
    Ok(())
}
