//! The strain of organs, and the limits beyond which it is reported.

use crate::World;
use glam::DVec3;

/// Stretch of an edge beyond what tissue withstands.
pub(super) const MAX_STRETCH: f64 = 5.0;

/// An organ has recovered when every edge is below this stretch ...
const RESTED_STRETCH: f64 = 3.0;

/// An element below this share of its rest volume is crushed. The strongest grasps of lifts leave
/// more; below a thousandth the solvers make no progress.
pub(super) const MIN_VOLUME_SHARE: f64 = 0.01;

/// ... and every element is above this share of its rest volume.
const RESTED_VOLUME_SHARE: f64 = 0.05;

/// Volumes are measured if an element is below this share of its rest volume.
const MEASURED_BELOW: f64 = 0.4;

/// Tissue without an instrument at it is checked if an element is below this share of its rest
/// volume.
pub(super) const SQUEEZED: f64 = 0.2;

/// Number of frames for which an organ may stay strained after the last instrument has left it.
/// Elastic tissue recovers within this time.
pub(super) const MAX_FRAMES_ALONE: u32 = 15;

/// The worst strain of an organ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Strain {
    /// Length of the most stretched edge over that at rest; 1 where none is stretched.
    pub stretch: f64,
    /// Smallest volume of an element over that at rest; 1 if it was not measured.
    pub volume: f64,
    /// Position of the worse of the two (m).
    pub at: DVec3,
    /// Centroid of the smallest element (m).
    pub crushed_at: DVec3,
}

impl Strain {
    /// Whether real tissue does not survive it.
    pub fn is_too_much(&self) -> bool {
        self.stretch > MAX_STRETCH || self.volume < MIN_VOLUME_SHARE
    }

    /// Whether the organ has not recovered.
    pub fn lasts(&self) -> bool {
        self.stretch > RESTED_STRETCH || self.volume < RESTED_VOLUME_SHARE
    }
}

/// Six times the volume of an element with its nodes at `x` (m3).
fn volume(tet: &[u32; 4], x: &[DVec3]) -> f64 {
    let [a, b, c, d] = tet.map(|i| x[i as usize]);
    (b - a).cross(c - a).dot(d - a)
}

/// The smallest share of its rest volume (`rest`, times six) that an element of a body has, and the
/// element's centroid (m).
fn most_crushed(tets: &[[u32; 4]], rest: &[f64], now: &[DVec3]) -> (f64, DVec3) {
    let mut least = (1.0, None);
    for (tet, rest) in tets.iter().zip(rest) {
        let volume = volume(tet, now);
        if volume < least.0 * rest {
            least = (volume / rest, Some(tet));
        }
    }
    (least.0, least.1.map_or(DVec3::ZERO, |tet| tet.iter().map(|i| 0.25 * now[*i as usize]).sum()))
}

/// Bodies at rest: their edges with squared lengths (m2), and six times the volumes of their
/// elements (m3).
#[derive(Clone)]
struct Rest {
    edges: Vec<([u32; 2], f64)>,
    volumes: Vec<f64>,
}

/// The edges and volumes of all bodies at rest.
#[derive(Clone)]
pub(crate) struct Edges {
    bodies: Vec<Rest>,
    /// The world's number of cuts for which they are valid.
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
            let volumes = body.tets().iter().map(|tet| volume(tet, rest)).collect();
            Rest { edges: pairs.into_iter().map(|e| (e, length(e))).collect(), volumes }
        });
        Self { bodies: bodies.collect(), cuts: world.cuts, positions: Vec::new() }
    }

    /// The strain of every body; `least` is the smallest share of its rest volume of any element.
    pub fn strains(&mut self, world: &World, least: f64) -> Vec<Strain> {
        if self.cuts != world.cuts {
            *self = Self::of(world);
        }
        let Self { bodies, positions, .. } = self;
        let strain = |(body, Rest { edges, volumes }): (usize, &Rest)| {
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
            let at = 0.5 * (a + b);
            let mut strain = Strain { stretch: most.sqrt(), volume: 1.0, at, crushed_at: at };
            if least < MEASURED_BELOW {
                let (volume, at) = most_crushed(world.model.bodies()[body].tets(), volumes, positions);
                (strain.volume, strain.crushed_at) = (volume, at);
                // The position of the strain that lasts.
                if volume >= RESTED_VOLUME_SHARE {
                    return strain;
                }
                if strain.stretch < RESTED_STRETCH || strain.stretch < MAX_STRETCH && volume < MIN_VOLUME_SHARE {
                    strain.at = at;
                }
            }
            strain
        };
        bodies.iter().enumerate().map(strain).collect()
    }
}
