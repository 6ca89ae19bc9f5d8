//! The outcome in figures, and the paper's beside it.

use super::measure::SimilarityRow;
use serde::Serialize;

/// The paper's figures (its table of real-to-sim similarity).
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PaperSimilarity {
    /// Mean silhouette IoU.
    pub iou: f64,
    /// SSIM and PSNR (dB) of its path-traced view.
    pub rendered: [f64; 2],
    /// The same after matching the exposure.
    pub matched: [f64; 2],
    /// The same of a second real frame.
    pub second_frame: [f64; 2],
    /// The same of the mean colour.
    pub mean_colour: [f64; 2],
}

/// What the paper measured on its rabbit.
pub(super) const PAPER: PaperSimilarity = PaperSimilarity {
    iou: 0.80,
    rendered: [0.43, 14.7],
    matched: [0.63, 20.4],
    second_frame: [0.67, 19.5],
    mean_colour: [0.66, 19.0],
};

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct SimilarityResult {
    /// Every specimen through its recording camera.
    pub rows: Vec<SimilarityRow>,
    /// Oblique views through the endoscope, of phantoms and of a coffee mug: none is in vivo.
    pub oblique: Vec<SimilarityRow>,
    /// What was left out, and why.
    pub skipped: Vec<String>,
    /// The paper's figures.
    pub paper: PaperSimilarity,
    /// Wall time of everything (s).
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}
