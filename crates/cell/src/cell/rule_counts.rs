//! How often the force guard acted, and how often tissue was beyond its limits.

use serde::Serialize;

/// Counts of one control period. None of them changes the physics.
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
