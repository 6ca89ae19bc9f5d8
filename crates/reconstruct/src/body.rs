//! From a closed surface to a clean one and to the tetrahedra that fill it.

use crate::{Error, Result, Settings};
use trocar_geometry::{LatticeMesher, MeshDistance, TetMesh, TetQuality, TriMesh, isosurface, sample_distance, taubin};
use trocar_specimen::OrganFacts;

/// Taubin's smoothing as in the paper.
const LAMBDA: f64 = 0.5;
const MU: f64 = -0.53;
const SMOOTHING_ITERATIONS: usize = 10;

/// Resamples `raw`, which closes but is as rough as its pixels: signed distance on a grid, surface at 0, largest component,
/// Taubin smoothing. The grid is the paper's 1.5 mm, finer where the organ's `radius` [m] asks for it.
///
/// # Errors
/// When nothing closed comes out.
pub fn resample(organ: &str, raw: &TriMesh, radius: f64) -> Result<TriMesh> {
    let wrong = |reason: &str| Error::Organ { organ: organ.to_owned(), reason: reason.to_owned() };
    let bounds = raw.bounds().ok_or_else(|| wrong("its surface is empty"))?;
    let extent = (bounds.1 - bounds.0).max_element();
    // Never more than 200 cells along an axis: past that the grid, not the recording, is what takes the time.
    let spacing = 1.5e-3_f64.min(radius / 4.0).max(extent / 200.0);
    let grid = sample_distance(&MeshDistance::new(raw)?, bounds, spacing);
    let mut surface = isosurface(&grid, 0.0).largest_component();
    taubin(&mut surface, LAMBDA, MU, SMOOTHING_ITERATIONS);
    if surface.triangles.is_empty() || surface.volume() <= 0.0 {
        return Err(wrong("its surface encloses no volume; is the mask only a few pixels wide?"));
    }
    if !surface.is_watertight() {
        return Err(wrong("its surface does not close"));
    }
    Ok(surface)
}

/// Fills a closed surface with tetrahedra and measures the result.
///
/// # Errors
/// When the mesher fails or leaves an element without volume.
pub fn fill_with_tets(organ: &str, surface: &TriMesh, settings: &Settings) -> Result<(TetMesh, OrganFacts)> {
    let wrong = |reason: String| Error::Organ { organ: organ.to_owned(), reason };
    let (_, body) = LatticeMesher::fit(surface, settings.finest_cell, settings.max_tets)
        .map_err(|e| wrong(format!("no tetrahedra could be made: {e}")))?;
    let quality = TetQuality::of(&body);
    if quality.inverted > 0 {
        return Err(wrong(format!("{} of {} tetrahedra have no positive volume", quality.inverted, body.tets.len())));
    }
    let facts = OrganFacts {
        nodes: body.vertices.len(),
        tets: body.tets.len(),
        watertight: surface.is_watertight(),
        inverted: quality.inverted,
        min_dihedral_deg: quality.min_dihedral_deg,
        median_dihedral_deg: quality.median_min_dihedral_deg,
        median_edge_mm: 1e3 * quality.median_edge,
        volume_cm3: 1e6 * quality.volume,
        ..OrganFacts::default()
    };
    Ok((body, facts))
}
