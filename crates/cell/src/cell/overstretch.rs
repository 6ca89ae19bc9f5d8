//! Tissue that an instrument has hooked or crushed beyond what tissue bears.
//!
//! Only vertices of the tissue touch: between them a blade that is driven hard enough enters, and then drags single vertices along from within. Real tissue tears at a stretch of about two; ours has
//! no such end. So where an edge of an organ is longer than [`MOST`] times its rest length, or an element has less than [`CRUSHED`] of its rest volume, the nearest instrument lets go of what it holds
//! and is not felt until all tissue is below [`REST`] and above [`ROUND`] again. It is told as an event, and no figure of merit counts on it.

use crate::World;
use glam::DVec3;

/// Stretch of an edge at which the nearest instrument is unhooked.
pub(super) const MOST: f64 = 5.0;

/// Stretch of all edges at which it is felt again.
pub(super) const REST: f64 = 3.0;

/// Share of its rest volume below which an element is crushed: less than the strongest grasps of the lifts leave. Below a thousandth solvers make no way any more.
pub(super) const CRUSHED: f64 = 0.01;

/// Share of which every element has to have more for an instrument to be felt again.
pub(super) const ROUND: f64 = 0.05;

/// The middle of the element that has least of its rest volume [m], and its body.
pub(super) fn most_crushed(world: &World) -> Option<(usize, DVec3)> {
    let mut least: Option<(f64, usize, DVec3)> = None;
    for (k, body) in world.model.bodies().iter().enumerate() {
        let (now, rest) = (world.state.positions(&world.model, k), body.rest_positions());
        for tet in body.tets() {
            let volume = |x: &[DVec3]| {
                let [a, b, c, d] = tet.map(|i| x[i as usize]);
                (b - a).cross(c - a).dot(d - a)
            };
            let share = volume(&now) / volume(rest);
            if least.is_none_or(|l| share < l.0) {
                least = Some((share, k, tet.iter().map(|i| 0.25 * now[*i as usize]).sum()));
            }
        }
    }
    least.map(|(_, k, at)| (k, at))
}

/// The edges of all bodies with their squared rest lengths.
pub(super) struct Edges {
    bodies: Vec<Vec<([u32; 2], f64)>>,
    /// The world's count of cuts for which they are right.
    cuts: usize,
    positions: Vec<DVec3>,
}

/// The edge that is stretched most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Worst {
    pub body: usize,
    pub stretch: f64,
    /// Its middle [m].
    pub at: DVec3,
}

impl Edges {
    pub fn of(world: &World) -> Self {
        let bodies = world.model.bodies().iter().map(|body| {
            let mut pairs: Vec<[u32; 2]> = Vec::with_capacity(6 * body.tets().len());
            for t in body.tets() {
                for (i, k) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
                    pairs.push([t[i].min(t[k]), t[i].max(t[k])]);
                }
            }
            pairs.sort_unstable();
            pairs.dedup();
            let rest = body.rest_positions();
            let length = |[a, b]: [u32; 2]| rest[a as usize].distance_squared(rest[b as usize]);
            pairs.into_iter().map(|e| (e, length(e))).collect()
        });
        Self { bodies: bodies.collect(), cuts: world.cuts, positions: Vec::new() }
    }

    /// The most stretched edge of all, if any is stretched at all.
    pub fn worst(&mut self, world: &World) -> Option<Worst> {
        if self.cuts != world.cuts {
            *self = Self::of(world);
        }
        let mut worst: Option<Worst> = None;
        for (body, edges) in self.bodies.iter().enumerate() {
            self.positions.clear();
            let count = world.model.bodies()[body].len();
            self.positions.extend((0..count).map(|i| world.state.position(&world.model, body, i)));
            let (mut most, mut which) = (1.0, None);
            for ([a, b], rest) in edges {
                let square = self.positions[*a as usize].distance_squared(self.positions[*b as usize]);
                if square > most * rest {
                    (most, which) = (square / rest, Some([*a, *b]));
                }
            }
            let stretch = most.sqrt();
            if let Some([a, b]) = which.filter(|_| worst.is_none_or(|w| stretch > w.stretch)) {
                let at = 0.5 * (self.positions[a as usize] + self.positions[b as usize]);
                worst = Some(Worst { body, stretch, at });
            }
        }
        worst
    }
}
