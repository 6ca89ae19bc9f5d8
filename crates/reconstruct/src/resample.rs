//! Resamples a surface as rough as its pixels to a smooth one through a signed distance, without
//! outward bias.

use crate::{Error, Result};
use trocar_geometry::{MeshDistance, TriMesh, isosurface, sample_distance, taubin};

/// The paper's values.
const LAMBDA: f64 = 0.5;
const MU: f64 = -0.53;
const SMOOTHING_ITERATIONS: usize = 10;

/// Resamples `raw`, which is closed but as rough as its pixels: signed distance on a grid, surface
/// at 0, largest component, Taubin smoothing. The grid is the paper's 1.5 mm, finer where the
/// organ's `radius` (m) needs it.
pub fn resample(organ: &str, raw: &TriMesh, radius: f64) -> Result<TriMesh> {
    let wrong = |reason: &str| Error::Organ { organ: organ.to_owned(), reason: reason.to_owned() };
    let bounds = raw.bounds().ok_or_else(|| wrong("its surface is empty"))?;
    let extent = (bounds.1 - bounds.0).max_element();
    // At most 200 cells along an axis; beyond that the grid takes more time than the recording.
    let spacing = 1.5e-3_f64.min(radius / 4.0).max(extent / 200.0);
    let grid = sample_distance(&MeshDistance::new(raw)?, bounds, spacing);
    tidy(organ, &isosurface(&grid, 0.0))
}

/// The largest component of a voxel surface, smoothed as in the paper, and checked to be closed.
pub fn tidy(organ: &str, rough: &TriMesh) -> Result<TriMesh> {
    let wrong = |reason: &str| Error::Organ { organ: organ.to_owned(), reason: reason.to_owned() };
    let mut surface = rough.largest_component();
    smooth(&mut surface);
    if surface.triangles.is_empty() || surface.volume() <= 0.0 {
        return Err(wrong("its surface encloses no volume; is the mask only a few pixels wide?"));
    }
    if !surface.is_watertight() {
        return Err(wrong("its surface does not close"));
    }
    Ok(surface)
}

/// Taubin's smoothing as in the paper.
pub fn smooth(surface: &mut TriMesh) {
    taubin(surface, LAMBDA, MU, SMOOTHING_ITERATIONS);
}
