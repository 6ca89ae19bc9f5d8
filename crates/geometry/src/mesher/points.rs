//! Points of the body-centred cubic lattice and the steps between them.
//!
//! The coordinates of a point count half cells: all three are even at the corners of the cubic
//! cells and odd at their centres.

/// A lattice point in half cells.
pub(super) type Point = [i32; 3];

/// The 14 steps from a point to its neighbours: 6 along the axes to the same sublattice (long
/// edges), 8 along the space diagonals to the other one (short edges).
pub(super) const STEPS: [Point; 14] = [
    [2, 0, 0],
    [-2, 0, 0],
    [0, 2, 0],
    [0, -2, 0],
    [0, 0, 2],
    [0, 0, -2],
    [-1, -1, -1],
    [1, -1, -1],
    [-1, 1, -1],
    [1, 1, -1],
    [-1, -1, 1],
    [1, -1, 1],
    [-1, 1, 1],
    [1, 1, 1],
];

/// Number of long steps; they come first in [`STEPS`].
pub(super) const LONG_STEPS: usize = 6;

/// Index of the opposite step.
pub(super) fn reverse(step: usize) -> usize {
    if step < LONG_STEPS { step ^ 1 } else { LONG_STEPS + 7 - (step - LONG_STEPS) }
}

/// Index of the step from `p` to its neighbour `q`.
pub(super) fn step_between(p: Point, q: Point) -> usize {
    let d = [q[0] - p[0], q[1] - p[1], q[2] - p[2]];
    match d.iter().position(|c| c.abs() == 2) {
        Some(axis) => 2 * axis + usize::from(d[axis] < 0),
        None => LONG_STEPS + usize::from(d[0] > 0) + 2 * usize::from(d[1] > 0) + 4 * usize::from(d[2] > 0),
    }
}

/// The point after a step.
pub(super) fn neighbour(p: Point, step: usize) -> Point {
    p.map_with(STEPS[step], |a, b| a + b)
}

/// Combines two triples component by component.
pub(super) trait MapWith<T: Copy> {
    fn map_with<B: Copy, R>(self, other: [B; 3], f: impl Fn(T, B) -> R) -> [R; 3];
}

impl<T: Copy> MapWith<T> for [T; 3] {
    fn map_with<B: Copy, R>(self, other: [B; 3], f: impl Fn(T, B) -> R) -> [R; 3] {
        [0, 1, 2].map(|i| f(self[i], other[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_reverse_and_are_found() {
        for (i, step) in STEPS.iter().enumerate() {
            let p = [4, 6, 8];
            let q = neighbour(p, i);
            assert_eq!(step_between(p, q), i);
            assert_eq!(step_between(q, p), reverse(i));
            assert_eq!(step.iter().all(|c| c % 2 == 0), i < LONG_STEPS);
        }
    }
}
