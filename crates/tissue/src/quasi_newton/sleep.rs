//! Whether a body takes part in the search of its island, and the results at rest that are reused.

use super::layout::Layout;
use crate::lanes::Row;

/// Whether a body takes part in the search. A body at rest among others sleeps until they push it.
#[derive(Default)]
pub(super) struct Sleep {
    /// Whether it takes part.
    pub active: bool,
    /// Whether it took no part at the last decision.
    pub was_resting: bool,
    /// Whether it moved in this substep, has arrived, and sleeps until others push it.
    pub asleep: bool,
    /// Whether others push it differently than when it fell asleep.
    pub disturbed: bool,
}

/// Results for a body at a place, which are reused while it stays there.
pub(super) struct RestCache {
    /// Positions, and beginning of the substep, of the last evaluation in place.
    pub x: Vec<Row>,
    pub start: Vec<Row>,
    /// Whether the warp belongs to that place.
    pub warped: bool,
    /// Gradient of elements and inertia at that place, and the predictor for which it holds;
    /// whether it is known.
    pub gradient: Vec<Row>,
    pub predictor: Vec<Row>,
    pub has_gradient: bool,
    /// Positions and gradient for which the correction was last computed.
    pub correction_x: Vec<Row>,
    pub correction_gradient: Vec<Row>,
    /// The largest motion of a node by that gradient (m), if the factor is still the same.
    pub correction: Option<f32>,
}

impl RestCache {
    /// Nothing is known.
    pub fn new(layout: &Layout) -> Self {
        let rows = || vec![[0.0f32; 4]; layout.rows];
        let all = || vec![[0.0f32; 4]; layout.nodes.max(layout.rows)];
        Self {
            x: all(),
            start: all(),
            warped: false,
            gradient: rows(),
            predictor: rows(),
            has_gradient: false,
            correction_x: rows(),
            correction_gradient: rows(),
            correction: None,
        }
    }
}
