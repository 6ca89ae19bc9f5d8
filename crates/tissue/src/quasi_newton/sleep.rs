//! Whether a body takes part in the search of its island, and what is known of it at rest.

use super::layout::Layout;
use crate::lanes::Row;

/// Whether a body takes part in the search. A body at rest among others sleeps until they push it.
#[derive(Default)]
pub(super) struct Sleep {
    /// It takes part.
    pub active: bool,
    /// It took no part when that was last decided.
    pub was_resting: bool,
    /// It moved in this substep, has arrived, and sleeps until others push it.
    pub asleep: bool,
    /// Others push it differently than when it fell asleep.
    pub disturbed: bool,
}

/// What was found of a body where it is, and need not be found again while it stays there.
pub(super) struct RestCache {
    /// Positions, and beginning of the substep, of the last evaluation in place.
    pub x: Vec<Row>,
    pub start: Vec<Row>,
    /// Whether the warp is that of there.
    pub warped: bool,
    /// Positions and gradient for which the correction was last computed.
    pub correction_x: Vec<Row>,
    pub correction_gradient: Vec<Row>,
    /// How far that gradient would move any node (m), if the factor is still the same.
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
            correction_x: rows(),
            correction_gradient: rows(),
            correction: None,
        }
    }
}
