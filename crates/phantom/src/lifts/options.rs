//! Which lifts are filmed.

use super::HiddenSupport;

/// Grasp-lifts of the appendix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiftOptions {
    /// Number of lifts, of 80 frames each.
    pub count: usize,
    /// What holds the organ besides its bed.
    pub support: HiddenSupport,
    /// Cell of the mesh of the lifted tissue (m).
    pub cell: f64,
}

impl Default for LiftOptions {
    /// No lifts. Cells of 1.1 mm, half of the finest that reconstruction makes by default.
    fn default() -> Self {
        Self { count: 0, support: HiddenSupport::default(), cell: 1.1e-3 }
    }
}
