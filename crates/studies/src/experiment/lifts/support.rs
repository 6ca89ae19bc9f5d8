//! What holds the simulated appendix.

use trocar_specimen::{End, Pins};

/// What holds the simulated appendix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Support {
    /// The reconstruction's pins: an end and most of the 30% next to it.
    Specimen,
    /// The lowest 42% of all nodes beyond the end.
    Band,
    /// An end of 8% alone.
    Base,
}

impl Support {
    pub const ALL: [Self; 3] = [Self::Specimen, Self::Band, Self::Base];

    /// The name in tables and keys.
    pub fn name(self) -> &'static str {
        match self {
            Self::Specimen => "end + 30% (specimen)",
            Self::Band => "end + lower band",
            Self::Base => "end alone",
        }
    }

    /// Its pins, of an organ that has its `own`.
    pub fn pins(self, own: Pins) -> Pins {
        let end = match own {
            Pins::End { end, .. } => end,
            _ => End::Base,
        };
        match self {
            Self::Specimen => own,
            Self::Band => Pins::End { end, length: 0.14, band_length: 0.86, band_share: 0.42 },
            Self::Base => Pins::End { end, length: 0.08, band_length: 0.0, band_share: 0.0 },
        }
    }
}
