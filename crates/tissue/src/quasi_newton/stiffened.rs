//! Elements that resist far more than at rest: those that the barrier of the volume energy has
//! reached, and those that are stretched beyond the limit.
//!
//! Tissue that a grasp pulls against its pins is squeezed flat beside it, or stretched many times.
//! The matrix has the stiffness at rest, and each such element is some fifty times as stiff along
//! one direction: the gradient g of its volume ratio, or of the square of a principal stretch. Its
//! additional stiffness is k g g', with k its volume times the increase of the energy's second
//! derivative: one rank of the low-rank update per element.

use super::elements::Elements;
use super::iterate::position;
use super::layout::{Batch, Layout};
use crate::lanes::{LANES, Row};
use crate::material::Stretches;
use glam::{DMat3, Vec3A};

/// Volume ratio below which an element may be one of these: where the barrier begins.
const MAX_RATIO: f32 = 0.2;

/// Elements with less volume are as stiff as with this: their second derivative holds for no step.
const MIN_RATIO: f32 = 0.05;

/// Greatest number of stiffened elements of a body in the update: the stiffest.
pub(super) const MAX_STIFFENED: usize = 16;

/// An element that resists one change of shape more than at rest.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Stiffened {
    /// Its nodes; 0 for those that are not free.
    pub nodes: [u32; 4],
    /// Derivative of the volume ratio, or of the square of a principal stretch, by the nodes'
    /// positions (1/m); zero for those that are not free.
    pub gradient: [[f32; 3]; 4],
    /// Stiffness that it has more than at rest along the gradient (N m).
    pub stiffness: f32,
}

impl Stiffened {
    /// Trace of the added stiffness (N/m).
    fn size(&self) -> f32 {
        self.stiffness * self.gradient.as_flattened().iter().map(|g| g * g).sum::<f32>()
    }

    /// The gradient at each node that is free.
    pub fn gradients(&self) -> impl Iterator<Item = (u32, [f32; 3])> {
        self.nodes.into_iter().zip(self.gradient).filter(|(_, g)| *g != [0.0; 3])
    }
}

impl Elements {
    /// Finds the stiffened elements at the positions `x` of the last evaluation, the stiffest
    /// first; `held` nodes are not free.
    pub fn find_stiffened(&self, layout: &Layout, x: &[Row], held: &[bool], found: &mut Vec<Stiffened>) {
        found.clear();
        let mut keep = |element: Stiffened| {
            let element = element.of_free_nodes(|i| i < layout.free && !held[i]);
            if element.size() > 0.0 {
                found.push(element);
            }
        };
        for (ratios, batch) in self.ratios.iter().zip(&layout.batches) {
            for lane in 0..LANES {
                let (ratio, volume) = (ratios[lane], batch.volumes[lane]);
                if ratio < MAX_RATIO && volume > 0.0 {
                    keep(squeezed(batch, lane, x, ratio, volume * self.stress.hardening(ratio.max(MIN_RATIO))));
                }
            }
        }
        if let (true, Some(limit)) = (self.stretched, &self.limit) {
            for (beyond, batch) in self.beyond.iter().zip(&layout.batches).filter(|(beyond, _)| **beyond != 0) {
                let is_beyond = |lane: &usize| beyond >> lane & 1 != 0 && batch.volumes[*lane] > 0.0;
                for lane in (0..LANES).filter(is_beyond) {
                    stretched(batch, lane, x, batch.volumes[lane] * limit.mu as f32).for_each(&mut keep);
                }
            }
        }
        // Equal ones keep their order.
        found.sort_by(|a, b| b.size().total_cmp(&a.size()));
        found.truncate(MAX_STIFFENED);
    }
}

impl Stiffened {
    /// Without the nodes that are not `free`.
    fn of_free_nodes(mut self, free: impl Fn(usize) -> bool) -> Self {
        for (node, g) in self.nodes.iter_mut().zip(&mut self.gradient) {
            if !free(*node as usize) {
                (*node, *g) = (0, [0.0; 3]);
            }
        }
        self
    }
}

/// Edges of an element from its first corner.
fn edges(batch: &Batch, lane: usize, x: &[Row]) -> [Vec3A; 3] {
    let [origin, a, b, c] = batch.nodes.map(|nodes| position(&x[nodes[lane] as usize]));
    [a - origin, b - origin, c - origin]
}

/// An element that is squeezed to the volume `ratio`.
fn squeezed(batch: &Batch, lane: usize, x: &[Row], ratio: f32, stiffness: f32) -> Stiffened {
    let [a, b, c] = edges(batch, lane, x);
    // The ratio is a . (b x c) over six times the rest volume, or minus that.
    let by = (1.0 / (6.0 * batch.volumes[lane])).copysign(a.dot(b.cross(c)) * ratio);
    let [p, q, r] = [by * b.cross(c), by * c.cross(a), by * a.cross(b)];
    let gradient = [-(p + q + r), p, q, r].map(|g| g.to_array());
    Stiffened { nodes: batch.nodes.map(|nodes| nodes[lane]), gradient, stiffness }
}

/// An element that is stretched beyond the limit, once for each direction; nothing if it is not.
fn stretched(batch: &Batch, lane: usize, x: &[Row], stiffness: f32) -> impl Iterator<Item = Stiffened> {
    let edges = edges(batch, lane, x);
    let m = [0, 1, 2].map(|k| Vec3A::from(batch.gradients[k].map(|along| along[lane])));
    let f = [0, 1, 2].map(|c| edges[0] * m[0][c] + edges[1] * m[1][c] + edges[2] * m[2][c]);
    let f = DMat3::from_cols_array_2d(&f.map(|column| column.as_dvec3().to_array()));
    let nodes = batch.nodes.map(|nodes| nodes[lane]);
    Stretches::of(f).into_iter().flat_map(|s| s.directions()).map(move |direction| {
        let moved = (2.0 * (f * direction)).as_vec3a();
        let [p, q, r] = m.map(|m| moved * m.dot(direction.as_vec3a()));
        let gradient = [-(p + q + r), p, q, r].map(|g| g.to_array());
        Stiffened { nodes, gradient, stiffness }
    })
}
