//! Elements whose volume resists far more than at rest: those that the barrier of the volume energy
//! has reached.
//!
//! Tissue that a grasp pulls against its pins is squeezed flat beside it. The matrix has the
//! stiffness at rest, and each such element is some fifty times as stiff along one direction: the
//! gradient g of its volume ratio. Its additional stiffness is k g g', with k its volume times the
//! increase of the energy's second derivative: one rank of the low-rank update per element.

use super::elements::Elements;
use super::iterate::position;
use super::layout::Layout;
use crate::lanes::{LANES, Row};

/// Volume ratio below which an element may be one of these: where the barrier begins.
const MAX_RATIO: f32 = 0.2;

/// Elements with less volume are as stiff as with this: their second derivative holds for no step.
const MIN_RATIO: f32 = 0.05;

/// Greatest number of squeezed elements of a body in the update: the stiffest.
pub(super) const MAX_SQUEEZED: usize = 16;

/// An element that resists a change of volume more than at rest.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Squeezed {
    /// Its nodes; 0 for those that are not free.
    pub nodes: [u32; 4],
    /// Derivative of the volume ratio by the nodes' positions (1/m); zero for those that are not
    /// free.
    pub gradient: [[f32; 3]; 4],
    /// Stiffness that it has more than at rest along the gradient (N m).
    pub stiffness: f32,
}

impl Squeezed {
    /// Trace of the added stiffness (N/m).
    fn size(&self) -> f32 {
        self.stiffness * self.gradient.as_flattened().iter().map(|g| g * g).sum::<f32>()
    }

    /// Product of the gradient and a vector of three numbers a node.
    #[inline(always)]
    pub fn product(&self, x: &[f32]) -> f64 {
        let mut sum = 0.0;
        for (node, g) in self.nodes.iter().zip(&self.gradient) {
            for (g, x) in g.iter().zip(&x[3 * *node as usize..]) {
                sum += f64::from(*g) * f64::from(*x);
            }
        }
        sum
    }
}

impl Elements {
    /// Finds the squeezed elements at the accepted positions `x`, the stiffest first; `held` nodes
    /// are not free.
    pub fn find_squeezed(&self, layout: &Layout, x: &[Row], held: &[bool], found: &mut Vec<Squeezed>) {
        found.clear();
        for (ratios, batch) in self.ratios.iter().zip(&layout.batches) {
            for lane in 0..LANES {
                let (ratio, volume) = (ratios[lane], batch.volumes[lane]);
                if ratio >= MAX_RATIO || volume <= 0.0 {
                    continue;
                }
                let nodes = batch.nodes.map(|nodes| nodes[lane]);
                let [origin, a, b, c] = nodes.map(|i| position(&x[i as usize]));
                let (a, b, c) = (a - origin, b - origin, c - origin);
                // The ratio is a . (b x c) over six times the rest volume, or minus that.
                let by = (1.0 / (6.0 * volume)).copysign(a.dot(b.cross(c)) * ratio);
                let [p, q, r] = [by * b.cross(c), by * c.cross(a), by * a.cross(b)];
                let mut element = Squeezed {
                    nodes: [0; 4],
                    gradient: [[0.0; 3]; 4],
                    stiffness: volume * self.stress.hardening(ratio.max(MIN_RATIO)),
                };
                for (k, g) in [-(p + q + r), p, q, r].into_iter().enumerate() {
                    let i = nodes[k] as usize;
                    if i < layout.free && !held[i] {
                        (element.nodes[k], element.gradient[k]) = (nodes[k], g.to_array());
                    }
                }
                if element.size() > 0.0 {
                    found.push(element);
                }
            }
        }
        // Equal ones keep their order.
        found.sort_by(|a, b| b.size().total_cmp(&a.size()));
        found.truncate(MAX_SQUEEZED);
    }
}
