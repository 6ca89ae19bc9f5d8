//! Fills a closed surface with tetrahedra and measures them.

use crate::resample::smooth;
use crate::{Error, MesherRule, Result, Settings};
use trocar_geometry::{
    LatticeMesher, MeshDistance, Mesher, TetMesh, TetQuality, TetgenMesher, TriMesh, isosurface, sample_distance,
};
use trocar_specimen::OrganFacts;

/// Fills a closed surface with tetrahedra and measures the result.
pub fn fill_with_tets(organ: &str, surface: &TriMesh, settings: &Settings) -> Result<(TetMesh, OrganFacts)> {
    let wrong = |reason: String| Error::Organ { organ: organ.to_owned(), reason };
    let body = fill(surface, settings).map_err(|e| wrong(format!("it cannot be filled with tetrahedra: {e}")))?;
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
    let Settings { finest_cell, max_tets, .. } = *settings;
    match (settings.mesher, settings.element_size) {
        (MesherRule::Lattice, Some(cell)) => LatticeMesher::graded(cell).mesh(surface),
        (MesherRule::Lattice, None) => Ok(LatticeMesher::fit(surface, finest_cell, max_tets)?.1),
        (MesherRule::Tetgen, size) => {
            let size = size.unwrap_or_else(|| LatticeMesher::for_body(surface, finest_cell, max_tets).cell);
            TetgenMesher::default().mesh(&with_edges_of(size, surface)?)
        }
    }
}

/// The surface with triangles of about `size` (m). TetGen keeps the triangles it gets, and those of
/// a reconstruction are as fine as the pixels.
fn with_edges_of(size: f64, surface: &TriMesh) -> trocar_geometry::Result<TriMesh> {
    let bounds = surface.bounds().ok_or_else(|| trocar_geometry::Error::Mesh("the surface is empty".into()))?;
    let grid = sample_distance(&MeshDistance::new(surface)?, bounds, size);
    let mut coarse = isosurface(&grid, 0.0).largest_component();
    smooth(&mut coarse);
    Ok(coarse)
}
