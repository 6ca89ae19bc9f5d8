//! The layer of tissue and what presses on it.

use crate::{Result, scenes};
use glam::DVec3;
use trocar_geometry::TetMesh;
use trocar_tissue::{
    Backend, BodyContact, BodyDescription, Collider, LatticeSettings, Material, Model, ModelBuilder, Shape, ToolContact,
};

/// What bears the layer.
#[derive(Clone, Copy, Debug)]
pub enum Base {
    /// Its tetrahedra.
    Tetrahedra,
    /// A lattice with cells as large as the tetrahedra's cubes.
    Lattice,
}

impl Base {
    /// The name in a scene file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tetrahedra => "tetrahedra",
            Self::Lattice => "lattice",
        }
    }
}

/// The layer's width and thickness (m).
pub const WIDTH: f64 = 24e-3;
pub const THICKNESS: f64 = 8e-3;

/// Gap between the layer and the body above it (m): they do not press yet.
pub const GAP: f64 = 1.7e-3;

/// Height of the body above it (m).
const HEIGHT: f64 = 8e-3;

/// Viscosity over Young's modulus (s).
const VISCOSITY_TIME: f64 = 4e-3;

/// The tissue. Young's modulus is in Pa.
pub fn material(young_modulus: f64, poisson_ratio: f64) -> Material {
    Material { viscosity: VISCOSITY_TIME * young_modulus, ..scenes::material(young_modulus, poisson_ratio) }
}

/// A layer with so many elements over its thickness that is fixed to its ground, and a tool.
///
/// # Errors
/// Material or tool out of range.
pub fn layer(
    base: Base,
    cells: usize,
    material: Material,
    shape: Shape,
    friction: f64,
    mode: ToolContact,
    stiffer: f64,
) -> Result<Model> {
    let builder = ModelBuilder::new().gravity(DVec3::ZERO).tool_contact(mode);
    let mut builder = builder.contact_stiffness(CONTACT_STIFFNESS * stiffer).backend(match base {
        Base::Tetrahedra => Backend::Tetrahedra,
        Base::Lattice => {
            Backend::Lattice(LatticeSettings { cell: THICKNESS / cells as f64, ..LatticeSettings::default() })
        }
    });
    add_layer(&mut builder, cells, material)?;
    builder.collider(Collider { name: "tool".to_owned(), tool: 0, shape, rest_offset: 0.0, friction })?;
    Ok(builder.build()?)
}

/// The layer, a body above its middle that does not press yet, and the nodes of that body's top.
///
/// # Errors
/// A material out of range.
pub fn two_bodies(cells: usize, material: Material) -> Result<(Model, Vec<u32>)> {
    let contact = BodyContact { friction: 0.0, ..BodyContact::default() };
    let mut builder = ModelBuilder::new().gravity(DVec3::ZERO).body_contact(contact);
    add_layer(&mut builder, cells, material)?;
    let edge = THICKNESS / cells as f64;
    let mut mesh = block([cells; 3], HEIGHT / cells as f64);
    // No node is above another.
    let corner = DVec3::splat(0.5 * (WIDTH - HEIGHT)) + edge * DVec3::new(-0.18, 0.1, 0.0);
    mesh.vertices.iter_mut().for_each(|p| *p += corner.with_z(THICKNESS + GAP));
    let top = THICKNESS + GAP + HEIGHT - 0.5 * edge;
    let held = (0..mesh.vertices.len() as u32).filter(|i| mesh.vertices[*i as usize].z > top).collect();
    let name = "body".to_owned();
    builder.body(BodyDescription { name, mesh: &mesh, material, pinned: Vec::new(), supports: Vec::new() })?;
    Ok((builder.build()?, held))
}

/// The builder's default, over Young's modulus times a node's size.
const CONTACT_STIFFNESS: f64 = 20.0;

/// The layer's mesh.
pub fn mesh(cells: usize) -> TetMesh {
    let edge = THICKNESS / cells as f64;
    let across = (WIDTH / edge).round() as usize;
    block([across, across, cells], edge)
}

fn add_layer(builder: &mut ModelBuilder, cells: usize, material: Material) -> Result<()> {
    let mesh = mesh(cells);
    let pinned = (0..mesh.vertices.len() as u32).filter(|i| mesh.vertices[*i as usize].z == 0.0).collect();
    let name = "layer".to_owned();
    builder.body(BodyDescription { name, mesh: &mesh, material, pinned, supports: Vec::new() })?;
    Ok(())
}

/// A box of cubes of edge `edge` (m), six tetrahedra each, lower corner at the origin.
fn block(cells: [usize; 3], edge: f64) -> TetMesh {
    let [nx, ny, nz] = cells;
    let index = |i: usize, j: usize, k: usize| ((k * (ny + 1) + j) * (nx + 1) + i) as u32;
    let mut mesh = TetMesh::default();
    for (k, j, i) in grid([nz + 1, ny + 1, nx + 1]) {
        mesh.vertices.push(edge * DVec3::new(i as f64, j as f64, k as f64));
    }
    for (k, j, i) in grid([nz, ny, nx]) {
        let corner = |c: usize| index(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2 & 1));
        for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
            mesh.tets.push([corner(0), corner(a), corner(b), corner(7)]);
        }
    }
    mesh
}

fn grid([a, b, c]: [usize; 3]) -> impl Iterator<Item = (usize, usize, usize)> {
    (0..a).flat_map(move |i| (0..b).flat_map(move |j| (0..c).map(move |k| (i, j, k))))
}
