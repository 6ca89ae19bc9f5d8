//! The tetrahedra that fill a closed surface, measured.

use crate::{Error, Result, Settings};
use trocar_geometry::{LatticeMesher, MeshDistance, Mesher, TetMesh, TetQuality, TriMesh};
use trocar_specimen::OrganFacts;

/// Fills a closed surface with tetrahedra and measures the result.
///
/// # Errors
/// When the mesher fails or leaves an element without volume.
pub fn fill_with_tets(organ: &str, surface: &TriMesh, settings: &Settings) -> Result<(TetMesh, OrganFacts)> {
    let wrong = |reason: String| Error::Organ { organ: organ.to_owned(), reason };
    let bounds = surface.bounds().ok_or_else(|| wrong("its surface is empty".into()))?;
    let mesher = LatticeMesher::for_volume(surface.volume(), settings.finest_cell, settings.max_tets);
    let body = mesher.mesh(&MeshDistance::new(surface)?, bounds).map_err(|e| {
        wrong(format!("no tetrahedra could be made: {e} (cells of {:.2} mm; smaller ones may help)", 1e3 * mesher.cell))
    })?;
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
