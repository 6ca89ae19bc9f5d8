//! How often each safety rule acted.

use serde::Serialize;

/// Counts of the actions of each rule.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RuleCounts {
    /// Commands that the force guard shortened.
    pub guarded: usize,
    /// Instruments that punctured an organ: no suspension of physics.
    pub punctures: usize,
    /// Instruments that had pierced an organ with less force than punctures it.
    pub pierced: usize,
    /// Instruments that had overstretched or crushed tissue.
    pub overstretched: usize,
    /// Of both: contacts of whole instruments that were disabled.
    pub disabled_contacts: usize,
    /// Of both: contacts of blades alone that were disabled.
    pub disabled_blades: usize,
    /// Instruments whose contact was enabled again.
    pub reconnected: usize,
    /// Organs that were relaxed instantly.
    pub relaxed: usize,
}
