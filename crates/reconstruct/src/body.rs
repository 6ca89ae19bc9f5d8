//! The tetrahedra that fill a closed surface, measured.

use crate::{Error, MesherRule, Result, Settings};
use trocar_geometry::{LatticeMesher, Mesher, TetMesh, TetQuality, TetgenMesher, TriMesh};
use trocar_specimen::OrganFacts;

/// Fills a closed surface with tetrahedra and measures the result.
///
/// # Errors
/// When the mesher fails or leaves an element without volume.
pub fn fill_with_tets(organ: &str, surface: &TriMesh, settings: &Settings) -> Result<(TetMesh, OrganFacts)> {
    let wrong = |reason: String| Error::Organ { organ: organ.to_owned(), reason };
    let body = fill(surface, settings).map_err(|e| wrong(format!("no tetrahedra could be made: {e}")))?;
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

fn fill(surface: &TriMesh, settings: &Settings) -> trocar_geometry::Result<TetMesh> {
    match (settings.mesher, settings.element_size) {
        (MesherRule::Tetgen, _) => TetgenMesher::default().mesh(surface),
        (MesherRule::Lattice, Some(cell)) => LatticeMesher::graded(cell).mesh(surface),
        (MesherRule::Lattice, None) => Ok(LatticeMesher::fit(surface, settings.finest_cell, settings.max_tets)?.1),
    }
}
