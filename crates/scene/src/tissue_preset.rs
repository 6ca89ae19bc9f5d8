//! Measured values of a tissue, by its name: `[organ.NAME.material] preset = "liver"`.
//!
//! The values and their sources are in `docs/tissue-values.md`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A tissue whose values were measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TissuePreset {
    /// The appendix as a solid body that hangs and lifts: the paper's modulus.
    Appendix,
    /// Liver.
    Liver,
    /// The wall of the gallbladder.
    Gallbladder,
    /// The wall of the bile duct.
    BileDuct,
    /// The wall of the small bowel at low strain.
    SmallBowel,
}

impl TissuePreset {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Appendix, Self::Liver, Self::Gallbladder, Self::BileDuct, Self::SmallBowel];

    /// Its name in scene files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Appendix => "appendix",
            Self::Liver => "liver",
            Self::Gallbladder => "gallbladder",
            Self::BileDuct => "bile-duct",
            Self::SmallBowel => "small-bowel",
        }
    }

    /// Young's modulus (Pa). Where a shear modulus was measured it is three times that, as in
    /// tissue that keeps its volume; of bowel, the geometric mean of the moduli along and around
    /// it.
    pub fn young_modulus_pa(self) -> f64 {
        match self {
            Self::Appendix => 12e3,
            Self::Liver => 5.4e3,
            Self::Gallbladder => 255e3,
            Self::BileDuct => 498e3,
            Self::SmallBowel => 235e3,
        }
    }

    /// Toughness (J/m2), where it was measured.
    pub fn toughness_j_m2(self) -> Option<f64> {
        (self == Self::Liver).then_some(200.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table of the docs has these values.
    #[test]
    fn the_docs_have_the_values() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/tissue-values.md");
        let text = std::fs::read_to_string(path).unwrap();
        for preset in TissuePreset::ALL {
            let row = format!("| `{}` |", preset.name());
            let line = text.lines().find(|line| line.starts_with(&row)).unwrap_or_else(|| panic!("no row {row}"));
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            assert_eq!(cells[2].parse::<f64>().unwrap(), 1e-3 * preset.young_modulus_pa(), "{row}");
            assert_eq!(cells[3].parse::<f64>().ok(), preset.toughness_j_m2(), "{row}");
        }
    }
}
