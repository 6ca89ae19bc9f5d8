//! Where a body starts a substep from and how far it goes along a direction: nowhere that squeezes an element too far.

use super::layout::Layout;
use super::part::{QuasiNewtonSolver, position};
use crate::Body;
use crate::descent::HELD_STRETCH;
use crate::integrator::Frame;
use crate::lanes::{LANES, Row};
use fearless_simd::dispatch;
use glam::Vec3A;

/// Held nodes this near to their targets have arrived [m]: rounding of positions.
const ARRIVED: f32 = 1e-7;

/// Guessed motions below this are left out [m]: a body at rest starts where it is.
const STILL: f32 = 1e-9;

/// More squeezed elements than these and a hundredth of all are not cured one by one.
const MANY: usize = 8;

/// Times the steps of squeezed elements' nodes are halved, and then dropped, before a search gives up.
const HALVINGS: usize = 3;
const DROPS: usize = 5;

/// Times all nodes' steps are cut, and to what share, where that does not help.
const RETREATS: usize = 5;
const RETREAT: f32 = 0.25;

/// Where a substep starts from.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Guess {
    /// Where it was: nothing moves.
    Still,
    /// Free nodes went on with their velocities, held ones with their tools.
    Ahead,
    /// Where it was, though things move: elements would not bear it that nodes go on by themselves.
    Behind,
}

/// How far held nodes came with their tools.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Pulled {
    /// All the way.
    There,
    /// Less, or an element would have been squeezed too far: they catch up later.
    PartOfTheWay,
    /// Nothing could move.
    Nowhere,
}

impl QuasiNewtonSolver {
    /// Moves to where the substep starts from; the forces there are those of the last pass then.
    pub(super) fn guess(&mut self, frame: &Frame<'_>, share: f64, h: f32, body: &Body) -> Guess {
        let free = self.layout.free;
        let mut moves = false;
        for i in 0..free {
            let mut to = self.start[i];
            for c in 0..3 {
                let by = h * self.v[i][c];
                if !self.held[i] && by.abs() > STILL {
                    to[c] += by;
                }
            }
            moves |= to != self.start[i];
            self.targets[i] = to;
        }
        let (targets, layout, start) = (&mut self.targets, &self.layout, &self.start);
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
        self.yielded = yielded;
        self.carried = carried || yielded;
        if !moves {
            self.pass_in_place(h);
            return Guess::Still;
        }
        self.x[..free].copy_from_slice(&self.targets[..free]);
        if !self.pass(h) {
            self.elements.accept();
            return Guess::Ahead;
        }
        self.x[..free].copy_from_slice(&self.start[..free]);
        self.pass(h);
        Guess::Behind
    }

    /// Goes from where the substep began, held nodes with their tools and the free ones as a linear body would follow; the forces there are those of the last pass then.
    ///
    /// In a body that something holds other forces have no part in it, since nobody asks whether it gets better by them: a crushed element presses on its nodes a thousand times harder than
    /// the stiffness at rest explains, and would throw them out of the body. They are for searches.
    pub(super) fn pull(&mut self, h: f32) -> Pulled {
        if self.is_free() {
            self.direction.copy_from_slice(&self.gradient);
        } else {
            self.direction.fill([0.0; 4]);
        }
        for i in (0..self.layout.free).filter(|i| self.held[*i]) {
            for c in 0..3 {
                self.direction[i][c] = -self.holding(i) * (self.targets[i][c] - self.x[i][c]);
            }
        }
        self.precondition();
        for i in 0..self.layout.free {
            for c in 0..3 {
                let way = self.targets[i][c] - self.x[i][c];
                self.direction[i][c] = if self.held[i] { way } else { -self.direction[i][c] };
            }
        }
        self.base.copy_from_slice(&self.x[..self.layout.rows]);
        let went = self.go(1.0, h);
        if went {
            self.elements.accept();
        } else {
            self.x[..self.layout.free].copy_from_slice(&self.base[..self.layout.free]);
            self.pass(h);
        }
        let arrived = |i: usize| (0..3).all(|c| (self.x[i][c] - self.targets[i][c]).abs() <= ARRIVED);
        let all = (0..self.layout.free).all(|i| !self.held[i] || arrived(i));
        match (went, all) {
            (false, _) => Pulled::Nowhere,
            (true, false) => Pulled::PartOfTheWay,
            (true, true) => Pulled::There,
        }
    }

    /// Goes `share` of the direction. Where a few elements would be squeezed too far, their nodes go less far, and at last not at all; where many would be, or others again and again, all
    /// nodes go less far. False if that does not help either.
    pub fn go(&mut self, share: f32, h: f32) -> bool {
        for _ in 0..=RETREATS {
            for round in 0..=HALVINGS + DROPS {
                let Self { level, layout, x, base, direction, .. } = self;
                dispatch!(*level, _simd => {
                    let ways = base.iter().zip(direction.iter());
                    for (x, (from, by)) in x[..layout.free].iter_mut().zip(ways) {
                        for c in 0..3 {
                            x[c] = from[c] + share * by[c];
                        }
                    }
                });
                if !self.pass(h) {
                    return true;
                }
                let mut squeezed = 0;
                self.elements.for_squeezed(&self.layout, |_| squeezed += 1);
                if squeezed == 0 || squeezed > MANY + self.layout.batches.len() * LANES / 100 {
                    break;
                }
                let (by, direction) = (if round < HALVINGS { 0.5 } else { 0.0 }, &mut self.direction);
                let free = self.layout.free as u32;
                self.elements.for_squeezed(&self.layout, |nodes| {
                    for i in nodes.into_iter().filter(|i| *i < free) {
                        direction[i as usize] = direction[i as usize].map(|d: f32| by * d);
                    }
                });
            }
            for d in self.direction.as_flattened_mut() {
                *d *= RETREAT;
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
