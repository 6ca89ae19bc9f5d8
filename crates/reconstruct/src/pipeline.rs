//! The stages in their order.

use crate::{Recording, Result};
use std::path::Path;
use trocar_camera::{ColorImage, DepthImage, Mask};
use trocar_geometry::{RepairReport, io::Unit};
use trocar_progress::Progress;
use trocar_specimen::Specimen;

/// Settings of the reconstruction; one set serves every recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Frames on each side of the window's centre (paper: 90).
    pub window: usize,
    /// Every how many frames of the window are used (paper: 2).
    pub stride: usize,
    /// Frame at the window's centre; the middle of the recording by default.
    pub centre: Option<usize>,
    /// Fewest samples a pixel needs (paper: 3); a recording of fewer frames needs as many as it has.
    pub min_samples: usize,
    /// Edge of the finest lattice cell [m].
    pub finest_cell: f64,
    /// About how many tetrahedra a body may have: larger organs get larger cells.
    pub max_tets: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { window: 90, stride: 2, centre: None, min_samples: 3, finest_cell: 1.9e-3, max_tets: 50_000 }
    }
}

/// What the camera saw of one organ, for the report.
#[derive(Clone, Debug)]
pub struct OrganView {
    /// Its name.
    pub name: String,
    /// Its mask in the composite.
    pub mask: Mask,
    /// Surface depth minus measured depth on the compared pixels [m]; 0 elsewhere.
    pub depth_error: Vec<f32>,
    /// Which pixels were compared.
    pub compared: Mask,
}

/// A specimen and what was seen on the way to it.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// The result.
    pub specimen: Specimen,
    /// The window's centre frame, as recorded.
    pub input: ColorImage,
    /// Instruments in that frame.
    pub instruments: Mask,
    /// The composite's colour.
    pub background: ColorImage,
    /// The composite's depth.
    pub depth: DepthImage,
    /// Frames the composite used.
    pub frames_used: usize,
    /// Share of the image that only the composite could fill under the instrument masks of the centre frame.
    pub recovered_share: f64,
    /// Share of pixels with composite depth.
    pub coverage: f64,
    /// Median over pixels of the range between the 10th and 90th percentile of depth [m].
    pub depth_range_median: f64,
    /// Per organ, in the specimen's order.
    pub organs: Vec<OrganView>,
    /// Things the user should know (dropped frames, filled holes, clipped organs), a sentence each.
    pub notes: Vec<String>,
}

/// Reconstructs every organ of a recording.
pub fn reconstruct(recording: &Recording, settings: &Settings, progress: &dyn Progress) -> Result<Reconstruction> {
    let _ = (recording, settings, progress);
    todo!()
}

/// Makes a one-organ specimen of a ready surface (a real organ model), repaired if need be; z is up. The organ is named
/// after the file.
pub fn from_surface(
    path: &Path,
    unit: Unit,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<(Specimen, RepairReport)> {
    let _ = (path, unit, settings, progress);
    todo!()
}
