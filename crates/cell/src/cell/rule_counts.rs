//! How often each safety rule acted.

use serde::Serialize;

/// How often each rule acted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RuleCounts {
    /// Arms and periods in which the force guard shortened a command.
    pub guarded: usize,
    /// Instruments that had pierced an organ.
    pub pierced: usize,
    /// Instruments that had hooked or crushed tissue beyond what it bears.
    pub overstretched: usize,
    /// Of both, how often contact of a whole instrument was disabled.
    pub disabled_contacts: usize,
    /// Of both, how often contact of blades alone was disabled.
    pub disabled_blades: usize,
    /// Instruments whose contact was enabled again.
    pub reconnected: usize,
    /// Organs that were relaxed outside of time.
    pub relaxed: usize,
}
