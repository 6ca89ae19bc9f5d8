//! Tissue that an instrument has hooked or crushed beyond what tissue bears.
//!
//! Real tissue tears at a stretch of about two; ours has no such end. So where an edge of an organ
//! is longer than [`MOST`] times its rest length, or an element has less than [`CRUSHED`] of its
//! rest volume, the nearest instrument lets go of what it holds and is not felt until all tissue is
//! below [`REST`] and above [`ROUND`] again. One that holds by a latch keeps its hold at first and
//! only presses no more; it lets go beyond [`FAR_TOO_MUCH`]. Each of these is told as an event, and
//! no figure of merit counts on it.
//!
//! Tissue that snaps back may stay folded: elements that would have to turn inside out to unfold
//! lock each other, whatever the energy. An organ that is beyond these limits and that no
//! instrument is at, or that stays beyond [`REST`] or [`ROUND`] for [`PATIENCE`], is put right
//! outside of time ([`trocar_tissue::State::relax`]), and that is told, too.

use crate::World;
use glam::DVec3;

/// Stretch of an edge at which the nearest instrument is unhooked.
pub(super) const MOST: f64 = 5.0;

/// Stretch at which nothing is waited for: at ten the solver says that the body diverged.
pub(super) const FAR_TOO_MUCH: f64 = 6.5;

/// Stretch of all edges at which it is felt again.
pub(super) const REST: f64 = 3.0;

/// Share of its rest volume below which an element is crushed: less than the strongest grasps of
/// the lifts leave. Below a thousandth solvers make no way any more.
pub(super) const CRUSHED: f64 = 0.01;

/// Share of which every element has to have more for an instrument to be felt again.
pub(super) const ROUND: f64 = 0.05;

/// Tissue that no instrument meets is looked at where an element has less than this share of its
/// rest volume.
pub(super) const SQUEEZED: f64 = 0.2;

/// Frames that an organ may stay beyond [`REST`] and [`ROUND`] after the last instrument has let go
/// of it: what is elastic has come back by then.
pub(super) const PATIENCE: u32 = 15;

/// An instrument farther than this from where tissue is strained most has nothing to do with it
/// [m].
pub(super) const NEAR: f64 = 0.03;

/// How far an organ is from its rest shape at worst.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Strain {
    /// Length of the most stretched edge over that at rest; 1 where none is stretched.
    pub stretch: f64,
    /// Least volume of an element over that at rest; 1 where that was not asked for.
    pub volume: f64,
    /// Where the worse of the two is [m].
    pub at: DVec3,
}

impl Strain {
    /// Beyond what tissue bears.
    pub fn is_too_much(&self) -> bool {
        self.is_beyond(false)
    }

    /// Beyond what an instrument stays for. `latched`: its latch alone holds the organ, and its
    /// blades press on nothing. How hard that may pull is for the tearing force to say; the stretch
    /// only ends what solvers bear.
    pub fn is_beyond(&self, latched: bool) -> bool {
        self.stretch > if latched { FAR_TOO_MUCH } else { MOST } || self.volume < CRUSHED
    }

    /// Not as good as at rest.
    pub fn lasts(&self) -> bool {
        self.stretch > REST || self.volume < ROUND
    }
}

/// The element of a body that has least of its rest volume: how much of it, and its middle [m].
fn most_crushed(world: &World, body: usize, now: &[DVec3]) -> (f64, DVec3) {
    let (data, mut least) = (&world.model.bodies()[body], (1.0, DVec3::ZERO));
    for tet in data.tets() {
        let volume = |x: &[DVec3]| {
            let [a, b, c, d] = tet.map(|i| x[i as usize]);
            (b - a).cross(c - a).dot(d - a)
        };
        let share = volume(now) / volume(data.rest_positions());
        if share < least.0 {
            least = (share, tet.iter().map(|i| 0.25 * now[*i as usize]).sum());
        }
    }
    least
}

/// The edges of all bodies with their squared rest lengths.
pub(super) struct Edges {
    bodies: Vec<Vec<([u32; 2], f64)>>,
    /// The world's count of cuts for which they are right.
    cuts: usize,
    positions: Vec<DVec3>,
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

    /// The strain of every body; `least` is the smallest share of its rest volume that any element
    /// has.
    pub fn strains(&mut self, world: &World, least: f64) -> Vec<Strain> {
        if self.cuts != world.cuts {
            *self = Self::of(world);
        }
        let Self { bodies, positions, .. } = self;
        let strain = |(body, edges): (usize, &Vec<([u32; 2], f64)>)| {
            positions.clear();
            let count = world.model.bodies()[body].len();
            positions.extend((0..count).map(|i| world.state.position(&world.model, body, i)));
            let (mut most, mut which) = (1.0, [0, 0]);
            for ([a, b], rest) in edges {
                let square = positions[*a as usize].distance_squared(positions[*b as usize]);
                if square > most * rest {
                    (most, which) = (square / rest, [*a, *b]);
                }
            }
            let [a, b] = which.map(|i| positions[i as usize]);
            let mut strain = Strain { stretch: most.sqrt(), volume: 1.0, at: 0.5 * (a + b) };
            if least < ROUND {
                let (volume, at) = most_crushed(world, body, positions);
                strain.volume = volume;
                // The place of what makes the strain last.
                if strain.stretch < REST || strain.stretch < MOST && volume < CRUSHED {
                    strain.at = at;
                }
            }
            strain
        };
        bodies.iter().enumerate().map(strain).collect()
    }
}
