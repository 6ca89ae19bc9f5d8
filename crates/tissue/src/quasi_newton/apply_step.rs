//! Motion of a body: the start of a search, and steps along a direction. No step squeezes an
//! element too far.

use super::body_system::QuasiNewtonSolver;
use super::iterate::{InitialGuess, Iterate, position};
use super::layout::Layout;
use super::memory::MIN_ROWS;
use crate::Body;
use crate::frame::Frame;
use crate::inversion_guard::HELD_STRETCH;
use crate::lanes::{LANES, Row};
use crate::threads::in_parts;
use fearless_simd::dispatch;
use glam::Vec3A;

/// Held nodes this near to their targets have arrived (m): rounding of positions.
const ARRIVED: f32 = 1e-7;

/// Squeezed elements are relieved one by one if there are at most this many and a hundredth of all.
const MAX_RELIEVED: usize = 8;

/// How often the steps of the nodes of squeezed elements are halved, and then dropped.
const MAX_HALVINGS: usize = 3;
const MAX_DROPS: usize = 5;

/// How often the steps of all nodes are shortened, and to what share.
const MAX_RETREATS: usize = 5;
const RETREAT_SHARE: f32 = 0.25;

/// How far held nodes followed their tools.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum ConstraintMotion {
    /// All the way.
    Arrived,
    /// Part of it, because an element would have been squeezed too far: they catch up later.
    Partial,
    /// Nothing could move.
    Blocked,
}

impl QuasiNewtonSolver {
    /// Moves to the start of the search, and evaluates the elements there. A body of which no node
    /// goes farther than `still` (m) and that no tool carries starts where it is.
    pub(super) fn start_substep(
        &mut self,
        frame: &Frame<'_>,
        share: f64,
        h: f32,
        still: f32,
        body: &Body,
    ) -> InitialGuess {
        let free = self.layout.free;
        let mut moves = self.farthest_free_motion(h) > still;
        let Iterate { start, v, targets, .. } = &mut self.iterate;
        targets[..free].copy_from_slice(&start[..free]);
        if moves {
            let free_nodes = targets.iter_mut().zip(v.iter()).zip(&self.held).filter(|(_, held)| !**held);
            free_nodes.for_each(|((to, v), _)| (0..3).for_each(|c| to[c] += h * v[c]));
        }
        let (layout, start) = (&self.layout, &*start);
        let (mut yielded, mut carried) = (false, false);
        frame.for_held(body, share, |vertex, x| {
            let i = layout.number[vertex] as usize;
            if i >= free {
                return;
            }
            if overstretches(body, layout, start, vertex, x) {
                yielded = true;
                return;
            }
            targets[i] = x.extend(0.0).to_array();
            carried |= targets[i] != start[i];
        });
        moves |= carried;
        self.progress.yielded = yielded;
        self.progress.carried = carried || yielded;
        if !moves {
            self.evaluate_in_place(h);
            return InitialGuess::Still;
        }
        let Iterate { x, targets, .. } = &mut self.iterate;
        x[..free].copy_from_slice(&targets[..free]);
        if !self.elements.evaluate(self.level, &self.layout, &self.iterate, h) {
            self.elements.accept();
            return InitialGuess::Ahead;
        }
        self.restore();
        self.elements.evaluate(self.level, &self.layout, &self.iterate, h);
        InitialGuess::Behind
    }

    /// Moves held nodes with their tools from the substep's beginning, and the free ones as in a
    /// linear body; evaluates the elements there.
    ///
    /// In a held body, other forces are left to the search, because this step skips the descent
    /// check: a crushed element presses on its nodes a thousand times harder than the stiffness at
    /// rest predicts, and would throw them out of the body.
    pub(super) fn move_constraints(&mut self, h: f32) -> ConstraintMotion {
        let (free, is_free) = (self.layout.free, self.is_free());
        let Iterate { x, targets, gradient, direction, .. } = &mut self.iterate;
        if is_free {
            direction.copy_from_slice(gradient);
        } else {
            direction.fill([0.0; 4]);
        }
        for i in (0..free).filter(|i| self.held[*i]) {
            for c in 0..3 {
                direction[i][c] = -self.system.holding(i) * (targets[i][c] - x[i][c]);
            }
        }
        self.precondition();
        let Iterate { x, targets, direction, base, .. } = &mut self.iterate;
        for i in 0..free {
            for c in 0..3 {
                let way = targets[i][c] - x[i][c];
                direction[i][c] = if self.held[i] { way } else { -direction[i][c] };
            }
        }
        base.copy_from_slice(&x[..self.layout.rows]);
        let stepped = self.apply_step(1.0, h);
        if stepped {
            self.elements.accept();
        } else {
            let Iterate { x, base, .. } = &mut self.iterate;
            x[..free].copy_from_slice(&base[..free]);
            self.elements.evaluate(self.level, &self.layout, &self.iterate, h);
        }
        let Iterate { x, targets, .. } = &self.iterate;
        let arrived = |i: usize| (0..3).all(|c| (x[i][c] - targets[i][c]).abs() <= ARRIVED);
        match (stepped, (0..free).all(|i| !self.held[i] || arrived(i))) {
            (false, _) => ConstraintMotion::Blocked,
            (true, false) => ConstraintMotion::Partial,
            (true, true) => ConstraintMotion::Arrived,
        }
    }

    /// Moves by a share of the direction from the base. If a few elements would be squeezed too
    /// far, the steps of their nodes are halved and at last dropped; if many would be, or others
    /// each time, the steps of all nodes are shortened. Returns false if that does not help either.
    pub fn apply_step(&mut self, share: f32, h: f32) -> bool {
        for _ in 0..=MAX_RETREATS {
            for round in 0..=MAX_HALVINGS + MAX_DROPS {
                let Self { level, layout, elements, iterate, .. } = self;
                let Iterate { x, base, direction, .. } = &mut *iterate;
                in_parts(&mut x[..layout.free], MIN_ROWS, |first, x| {
                    let ways = base[first..].iter().zip(&direction[first..]);
                    dispatch!(*level, _simd => for (x, (from, by)) in x.iter_mut().zip(ways) {
                        for c in 0..3 {
                            x[c] = from[c] + share * by[c];
                        }
                    });
                });
                if !elements.evaluate(*level, layout, iterate, h) {
                    return true;
                }
                let mut squeezed = 0;
                self.elements.for_squeezed(&self.layout, |_| squeezed += 1);
                if squeezed == 0 || squeezed > MAX_RELIEVED + self.layout.batches.len() * LANES / 100 {
                    break;
                }
                let (by, direction) = (if round < MAX_HALVINGS { 0.5 } else { 0.0 }, &mut self.iterate.direction);
                let free = self.layout.free as u32;
                self.elements.for_squeezed(&self.layout, |nodes| {
                    for i in nodes.into_iter().filter(|i| *i < free) {
                        direction[i as usize] = direction[i as usize].map(|d: f32| by * d);
                    }
                });
            }
            for d in self.iterate.direction.as_flattened_mut() {
                *d *= RETREAT_SHARE;
            }
        }
        false
    }
}

/// Whether an edge at a held vertex that goes to `x` would be too long, and longer than it is.
fn overstretches(body: &Body, layout: &Layout, start: &[Row], vertex: usize, x: Vec3A) -> bool {
    let here = position(&start[layout.number[vertex] as usize]);
    body.edges_of(vertex).iter().any(|edge| {
        let other = position(&start[layout.number[edge.to as usize] as usize]);
        let now = (x - other).length_squared();
        now > (HELD_STRETCH * edge.length).powi(2) && now > (here - other).length_squared()
    })
}
