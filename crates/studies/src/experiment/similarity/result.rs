//! The figures of the study and of the paper.

use super::deforming::DeformingRow;
use super::measure::SimilarityRow;
use serde::Serialize;

/// The paper's figures (table of real-to-sim similarity).
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PaperSimilarity {
    /// Mean silhouette IoU.
    pub iou: f64,
    /// SSIM and PSNR (dB) of the path-traced view.
    pub rendered: [f64; 2],
    /// The same after matching the exposure.
    pub matched: [f64; 2],
    /// The same of a second real frame.
    pub second_frame: [f64; 2],
    /// The same of the mean colour.
    pub mean_colour: [f64; 2],
    /// Mean silhouette IoU through the cell's own camera, 7.9 mm and 4.6 mm beside the recording's.
    pub wrong_camera_iou: f64,
}

/// The paper's figures on its rabbit.
pub(super) const PAPER: PaperSimilarity = PaperSimilarity {
    iou: 0.80,
    rendered: [0.43, 14.7],
    matched: [0.63, 20.4],
    second_frame: [0.67, 19.5],
    mean_colour: [0.66, 19.0],
    wrong_camera_iou: 0.24,
};

/// Figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct SimilarityResult {
    /// All specimens, through their recording cameras.
    pub rows: Vec<SimilarityRow>,
    /// Oblique views through the endoscope, of a phantom and of a mug; none is in vivo.
    pub oblique: Vec<SimilarityRow>,
    /// Filmed lifts beside simulated ones, at rest and under load.
    pub deforming: Vec<DeformingRow>,
    /// Skipped recordings, and why.
    pub skipped: Vec<String>,
    /// The paper's figures.
    pub paper: PaperSimilarity,
}
