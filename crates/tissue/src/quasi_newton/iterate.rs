//! The vectors of a body that a search works on.

use super::layout::Layout;
use crate::lanes::{LANES, Row};
use crate::state::BodyState;
use glam::Vec3A;

/// Positions, velocities and directions of one body, in the layout's order. All but `x` and `start`
/// have rows for free nodes only.
pub(super) struct Iterate {
    /// Positions of all nodes (m).
    pub x: Vec<Row>,
    /// Where the substep began (m).
    pub start: Vec<Row>,
    /// Velocities (m/s).
    pub v: Vec<Row>,
    /// Inertial predictor (m).
    pub predictor: Vec<Row>,
    /// Free motion of nodes in the substep, and motion of held ones with their tools (m).
    pub targets: Vec<Row>,
    /// Gradient of the incremental potential at the accepted positions, and at those of a trial
    /// (N).
    pub gradient: Vec<Row>,
    pub next_gradient: Vec<Row>,
    /// Direction of the search (m); a gradient on the way to it (N).
    pub direction: Vec<Row>,
    /// Positions where the line search began (m).
    pub base: Vec<Row>,
}

/// Where the search of a substep starts.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum InitialGuess {
    /// At the substep's beginning: nothing moves.
    Still,
    /// Free nodes continued with their velocities, held ones with their tools.
    Ahead,
    /// At the substep's beginning, although nodes move: elements would be squeezed too far on the
    /// way ahead.
    Behind,
}

impl Iterate {
    /// All zero.
    pub fn new(layout: &Layout) -> Self {
        let rows = || vec![[0.0f32; 4]; layout.rows];
        let all = || vec![[0.0f32; 4]; layout.nodes.max(layout.rows)];
        Self {
            x: all(),
            start: all(),
            v: rows(),
            predictor: rows(),
            targets: rows(),
            gradient: rows(),
            next_gradient: rows(),
            direction: rows(),
            base: rows(),
        }
    }

    /// Loads positions and velocities from the state. Returns whether all nodes are where they
    /// were.
    pub fn load(&mut self, layout: &Layout, state: &BodyState) -> bool {
        let mut same = true;
        for (x, vertex) in self.x.iter_mut().zip(&layout.vertex) {
            let now = state.x[*vertex as usize].extend(0.0).to_array();
            same &= now == *x;
            *x = now;
        }
        for i in 0..layout.free {
            self.v[i] = state.v[layout.vertex[i] as usize].extend(0.0).to_array();
        }
        same
    }

    /// Stores positions and velocities in the state.
    pub fn store(&self, layout: &Layout, state: &mut BodyState) {
        for i in 0..layout.free {
            let vertex = layout.vertex[i] as usize;
            state.x[vertex] = position(&self.x[i]);
            state.v[vertex] = position(&self.v[i]);
            // This solver has no warm start for sweeps: sweeps after it start without one.
            state.warm.falling[vertex] = 0.0;
        }
        for vertex in &layout.vertex[layout.free..] {
            state.v[*vertex as usize] = Vec3A::ZERO;
        }
    }

    /// Restores the beginning of the substep.
    pub fn restore(&mut self, free: usize) {
        self.x[..free].copy_from_slice(&self.start[..free]);
    }

    /// Position of a vertex (m).
    #[inline(always)]
    pub fn at(&self, layout: &Layout, vertex: u32) -> Vec3A {
        layout.value(vertex, |number| position(&self.x[number]))
    }

    /// Velocity of a vertex (m/s).
    #[inline(always)]
    pub fn velocity(&self, layout: &Layout, vertex: u32) -> Vec3A {
        let of = |number: usize| if number < layout.free { position(&self.v[number]) } else { Vec3A::ZERO };
        layout.value(vertex, of)
    }
}

/// The three coordinates of a row.
#[inline(always)]
pub(super) fn position(row: &Row) -> Vec3A {
    Vec3A::new(row[0], row[1], row[2])
}

/// Largest absolute coordinate of any row; infinite if one is not finite.
#[inline(always)]
pub(super) fn max_coordinate(rows: &[Row]) -> f32 {
    let (mut most, mut strange) = ([0.0f32; LANES], [0.0f32; LANES]);
    let (chunks, rest) = rows.as_flattened().as_chunks::<LANES>();
    for chunk in chunks {
        for lane in 0..LANES {
            let size = chunk[lane].abs();
            most[lane] = if size > most[lane] { size } else { most[lane] };
            // NaN if the number is not finite.
            strange[lane] += 0.0 * size;
        }
    }
    for number in rest {
        most[0] = most[0].max(number.abs());
        strange[0] += 0.0 * number;
    }
    if strange == [0.0; LANES] { most.into_iter().fold(0.0, f32::max) } else { f32::INFINITY }
}

/// Adds to a row.
#[inline(always)]
pub(super) fn add(row: &mut Row, by: Vec3A) {
    row.iter_mut().zip(by.to_array()).for_each(|(sum, part)| *sum += part);
}

#[cfg(test)]
mod tests {
    use super::max_coordinate;

    #[test]
    fn the_largest_coordinate_is_found_in_any_row() {
        for count in [1, 4, 7, 33] {
            for at in 0..count {
                for (number, expected) in
                    [(-3.0, 3.0), (f32::NAN, f32::INFINITY), (f32::NEG_INFINITY, f32::INFINITY), (0.5, 1.0)]
                {
                    let mut rows = vec![[-1.0, 0.0, 1.0, 0.0]; count];
                    rows[at][1] = number;
                    assert_eq!(max_coordinate(&rows), expected, "{number} at {at} of {count}");
                }
            }
        }
        assert_eq!(max_coordinate(&[]), 0.0);
    }
}
