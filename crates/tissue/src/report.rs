//! The report of a frame: speeds, volumes, and the events that end a run.

use crate::Body;
use crate::state::BodyState;
use crate::threads::in_parts;
use glam::{DVec3, Vec3A};
use std::ops::Range;

/// Speed at which a node has diverged (m/s): the paper's particle velocity limit.
pub const SPEED_LIMIT: f64 = 20.0;

/// An edge of more than this many rest lengths has diverged.
const STRETCH_LIMIT: f32 = 10.0;

/// Elements or nodes that are worth a thread of their own, and the most parts of them.
const MIN_PART: usize = 6000;
const MAX_PARTS: usize = 8;

/// Why a run is over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Divergence {
    /// A position or velocity is not finite. The state is that of the last finite frame.
    NonFinite {
        /// The body.
        body: usize,
    },
    /// A node reached the speed limit of 20 m/s.
    OverSpeed {
        /// The body.
        body: usize,
    },
    /// The state or the model is not the one that the stepper was made for, or a grasp holds nodes
    /// that the model lacks. Nothing was stepped.
    OtherModel,
    /// A load is on a node that the model lacks, or not finite. Nothing was stepped.
    WrongLoad,
    /// An edge is longer than 10 times its rest length.
    OverStretch {
        /// The body.
        body: usize,
    },
    /// An integrator from outside this crate found no solution of a substep. The body is where the
    /// substep began.
    Unsolved {
        /// The body.
        body: usize,
    },
}

impl std::fmt::Display for Divergence {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::OtherModel => write!(f, "the stepper or a grasp was made for another model"),
            Self::WrongLoad => write!(f, "a load is on a node that the model lacks, or its force is not finite"),
            Self::NonFinite { body } => write!(f, "body {body} has a position that is not finite"),
            Self::OverSpeed { body } => write!(f, "a node of body {body} is at the speed limit of {SPEED_LIMIT} m/s"),
            Self::Unsolved { body } => write!(f, "no minimum was found for body {body}"),
            Self::OverStretch { body } => {
                write!(f, "an edge of body {body} is over {STRETCH_LIMIT} times its rest length")
            }
        }
    }
}

/// The report of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// Largest node speed at the end of the frame (m/s).
    pub max_speed: f64,
    /// Elements with signed volume at or below 0 at the end of the frame.
    pub inverted: usize,
    /// Smallest ratio of an element's volume to its rest volume.
    pub min_volume_ratio: f64,
    /// Substeps in which held nodes could not follow the tool without inverting or overstretching
    /// an element. They catch up later.
    pub grasp_limited: usize,
    /// Iterations of all bodies and substeps: sweeps, or quasi-Newton steps.
    pub iterations: usize,
    /// Substeps in which the quasi-Newton search failed and sweeps took over, summed over bodies.
    pub fallbacks: usize,
    /// The event that ended the run, if any.
    pub divergence: Option<Divergence>,
}

impl Default for StepReport {
    fn default() -> Self {
        Self {
            max_speed: 0.0,
            inverted: 0,
            min_volume_ratio: f64::INFINITY,
            grasp_limited: 0,
            iterations: 0,
            fallbacks: 0,
            divergence: None,
        }
    }
}

/// What is measured of a body's shape.
#[derive(Clone, Copy)]
struct Shape {
    /// Whether all positions are numbers; nothing else is measured if not.
    finite: bool,
    inverted: usize,
    min_volume_ratio: f64,
    /// Whether an edge is too long.
    stretched: bool,
}

/// The shape of a body, and where it was then: most bodies have not moved since the last frame.
pub(crate) struct Measured {
    x: Vec<Vec3A>,
    /// Of its lattice, if it has one.
    nodes: Vec<DVec3>,
    shape: Option<Shape>,
}

impl Measured {
    /// Nothing yet.
    pub fn new() -> Self {
        Self { x: Vec::new(), nodes: Vec::new(), shape: None }
    }

    /// The shape of the body.
    fn shape(&mut self, body: &Body, state: &BodyState) -> Shape {
        let nodes = state.lattice.as_ref().map_or(&[][..], |lattice| &lattice.positions);
        if let Some(shape) = self.shape.filter(|_| self.x == state.x && self.nodes == nodes) {
            return shape;
        }
        let shape = Shape::of(body, state);
        self.x.clone_from(&state.x);
        self.nodes.clear();
        self.nodes.extend_from_slice(nodes);
        self.shape = Some(shape);
        shape
    }
}

impl Shape {
    /// The shape of nothing.
    const NONE: Self = Self { finite: true, inverted: 0, min_volume_ratio: f64::INFINITY, stretched: false };

    fn of(body: &Body, state: &BodyState) -> Self {
        if !state.x.iter().all(|p| p.is_finite()) {
            return Self { finite: false, ..Self::NONE };
        }
        let elements = if let (Some(embedding), Some(lattice)) = (&body.lattice, &state.lattice) {
            // Tetrahedra in a lattice bear nothing; its cells do.
            embedding.body.volume_ratios(&lattice.positions).fold(Self::NONE, Self::with_ratio)
        } else {
            sum_of_parts(body.tets.len(), |range| {
                let elements = body.tets[range.clone()].iter().zip(&body.volumes[range]);
                elements.fold(Self::NONE, |shape, (tet, rest)| {
                    let [a, b, c, d] = tet.map(|i| state.x[i as usize]);
                    shape.with_ratio(f64::from((b - a).cross(c - a).dot(d - a)) / 6.0 / rest)
                })
            })
        };
        let edges = sum_of_parts(body.len(), |mut range| {
            let stretched = range.any(|i| {
                let too_long = |length: f32, j: u32| {
                    (state.x[j as usize] - state.x[i]).length_squared() > (STRETCH_LIMIT * length).powi(2)
                };
                // Every edge appears at both its ends.
                body.edges_of(i).iter().any(|e| e.to as usize > i && too_long(e.length, e.to))
            });
            Self { stretched, ..Self::NONE }
        });
        elements.with(edges)
    }

    /// The same with an element of that volume ratio.
    fn with_ratio(self, ratio: f64) -> Self {
        let inverted = self.inverted + usize::from(ratio <= 0.0);
        Self { inverted, min_volume_ratio: self.min_volume_ratio.min(ratio), ..self }
    }

    /// Both.
    fn with(self, other: Self) -> Self {
        Self {
            finite: self.finite && other.finite,
            inverted: self.inverted + other.inverted,
            min_volume_ratio: self.min_volume_ratio.min(other.min_volume_ratio),
            stretched: self.stretched || other.stretched,
        }
    }
}

/// The shape of `count` things, part by part on the threads of the pool that calls.
fn sum_of_parts(count: usize, of: impl Fn(Range<usize>) -> Shape + Send + Sync) -> Shape {
    let mut parts = [Shape::NONE; MAX_PARTS];
    let used = (count / MIN_PART).clamp(1, MAX_PARTS);
    in_parts(&mut parts[..used], 1, |first, parts| {
        for (k, part) in (first..).zip(parts) {
            *part = of(count * k / used..count * (k + 1) / used);
        }
    });
    parts.into_iter().fold(Shape::NONE, Shape::with)
}

impl StepReport {
    /// The sum of both.
    pub(crate) fn with(self, other: &Self) -> Self {
        Self {
            max_speed: self.max_speed.max(other.max_speed),
            inverted: self.inverted + other.inverted,
            min_volume_ratio: self.min_volume_ratio.min(other.min_volume_ratio),
            grasp_limited: self.grasp_limited + other.grasp_limited,
            iterations: self.iterations + other.iterations,
            fallbacks: self.fallbacks + other.fallbacks,
            divergence: match (self.divergence, other.divergence) {
                // It is the reason why the state was restored.
                (_, Some(lost @ Divergence::NonFinite { .. })) => Some(lost),
                (first, second) => first.or(second),
            },
        }
    }

    /// Adds the measures of a body at the end of the frame: speed, volumes, and the events that end
    /// a run. `last` keeps the shape for a body that does not move.
    pub(crate) fn measure(&mut self, index: usize, body: &Body, state: &BodyState, last: &mut Measured) {
        let Shape { finite, inverted, min_volume_ratio, stretched } = last.shape(body, state);
        if !finite || !state.v.iter().all(|v| v.is_finite()) {
            let divergence = Some(Divergence::NonFinite { body: index });
            *self = Self { max_speed: 0.0, inverted: 0, min_volume_ratio: f64::INFINITY, divergence, ..*self };
            return;
        }
        let fastest = state.v[..body.len()].iter().map(|v| v.length_squared()).fold(0.0, f32::max);
        let max_speed = f64::from(fastest).sqrt();
        let divergence = if max_speed >= SPEED_LIMIT {
            Some(Divergence::OverSpeed { body: index })
        } else if stretched {
            Some(Divergence::OverStretch { body: index })
        } else {
            self.divergence
        };
        *self = Self { max_speed, inverted, min_volume_ratio, divergence, ..*self };
    }
}
