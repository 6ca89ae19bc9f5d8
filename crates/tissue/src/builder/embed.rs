//! Embeds a body in a lattice of hexahedra.

use crate::body::{BodyData, Embedding, EmbeddingData};
use crate::{LatticeSettings, Result};
use glam::DVec3;
use trocar_geometry::TetMesh;
use trocar_lattice::{Body as LatticeBody, BodyDescription, Lattice, LatticeOptions, Material};

/// Embeds a body. None if all of it is pinned.
///
/// # Errors
/// A cell out of range, or too many of them.
pub(crate) fn embed(body: &BodyData, settings: LatticeSettings) -> Result<Option<Embedding>> {
    let moves = |tet: &&[u32; 4]| tet.iter().any(|node| !body.pinned[*node as usize]);
    let elements: Vec<u32> =
        (0..body.rest.tets.len() as u32).filter(|t| moves(&&body.rest.tets[*t as usize])).collect();
    if elements.is_empty() {
        return Ok(None);
    }
    let tets: Vec<[u32; 4]> = elements.iter().map(|t| body.rest.tets[*t as usize]).collect();
    let mut nodes: Vec<u32> = tets.iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    let at = |node: u32| nodes.partition_point(|other| *other < node) as u32;
    let mesh = TetMesh {
        vertices: nodes.iter().map(|node| body.rest.vertices[*node as usize] - body.origin).collect(),
        tets: tets.iter().map(|tet| tet.map(at)).collect(),
    };
    let refused =
        |error: trocar_lattice::Error| crate::Error::Body { body: body.name.clone(), reason: error.to_string() };
    // The pieces of a cut body have the grid of the whole.
    let options = LatticeOptions { origin: Some(DVec3::ZERO), ..LatticeOptions::new(settings.cell) };
    let lattice = Lattice::of_mesh(&mesh, &options).map_err(refused)?;
    let embedded = lattice.embed_nodes().map_err(refused)?;
    let pinned: Vec<u32> = nodes.iter().filter(|node| body.pinned[**node as usize]).map(|node| at(*node)).collect();
    let pins = lattice.embed_held(&pinned).map_err(refused)?;
    let material = Material {
        law: settings.law,
        young_modulus: body.material.young_modulus,
        poisson_ratio: body.material.poisson_ratio,
        density: body.material.density,
    };
    let description = BodyDescription { name: body.name.clone(), lattice, material, pins, fixed: Vec::new() };
    let lattice = LatticeBody::new(description).map_err(refused)?;
    let mut points = vec![None; body.pinned.len()];
    for (node, point) in nodes.iter().zip(embedded) {
        points[body.internal[*node as usize] as usize] = Some(point);
    }
    let rest = lattice.rest_stiffness();
    let nodes = points.len();
    Ok(Some(Embedding::new(EmbeddingData { settings, elements, body: lattice, rest, points, nodes })))
}
