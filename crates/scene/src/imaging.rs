//! What differs in pictures from the light, the sensors and the tissue that the program assumes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Factors on what pictures are made with; physics knows nothing of them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Imaging {
    /// Factor on the light of all lamps, the endoscope's too.
    pub lamp: f64,
    /// Factor on the exposure of all cameras.
    pub exposure: f64,
    /// Factor on the noise of all sensors, where noise is switched on.
    pub noise: f64,
    /// Factor on the strength of highlights on tissue.
    pub gloss: f64,
    /// Factors on the red, green and blue of the organs.
    pub tint: [f64; 3],
}

impl Default for Imaging {
    fn default() -> Self {
        Self { lamp: 1.0, exposure: 1.0, noise: 1.0, gloss: 1.0, tint: [1.0; 3] }
    }
}
