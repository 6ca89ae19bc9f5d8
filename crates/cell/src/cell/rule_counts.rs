//! How often the force guard acted, and what was beyond what tissue bears.

use serde::Serialize;

/// Counts of a control period. None of them stands for a change of physics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RuleCounts {
    /// Commands that the force guard shortened.
    pub guarded: usize,
    /// Instruments that punctured an organ.
    pub punctures: usize,
    /// Instruments whose axis came into an organ with less force than punctures it.
    pub pierced: usize,
    /// Organs that an instrument began to overstretch or crush.
    pub overstretched: usize,
    /// Organs that stayed strained without an instrument at them.
    pub folded: usize,
}
