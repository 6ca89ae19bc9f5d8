//! Sag of an organ in lattices of several cell sizes beside its sag by a reference.
//!
//! `cargo run --release -p trocar-lattice --example sag -- ORGAN.msh REFERENCE.txt [CELL_MM ...]`
//! where `crates/lattice/examples/sag_reference.py ORGAN.msh REFERENCE.txt` made the reference: for
//! each node of the organ whether it is pinned, and its displacement (m) under a thousandth of
//! gravity.

#![allow(clippy::print_stdout, reason = "an example that prints a table")]

use glam::DVec3;
use std::error::Error;
use std::path::Path;
use std::time::Instant;
use trocar_geometry::{TetMesh, io::read_msh};
use trocar_lattice::{
    Body, BodyDescription, BodyState, BoundaryRule, Conditions, Lattice, LatticeOptions, Law, Material, Newton,
    Precision,
};

/// Share of gravity, small enough for the linear theory of the reference.
const SHARE: f64 = 1e-3;

/// Pinned nodes and displacements (m).
fn reference(path: &Path) -> Result<Vec<(bool, DVec3)>, Box<dyn Error>> {
    let mut nodes = Vec::new();
    for line in std::fs::read_to_string(path)?.lines().filter(|line| !line.starts_with('#')) {
        let numbers = line.split(' ').map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        let [pinned, x, y, z] = numbers[..] else { return Err(format!("{}: '{line}'", path.display()).into()) };
        nodes.push((pinned > 0.0, DVec3::new(x, y, z)));
    }
    Ok(nodes)
}

/// What one lattice gave.
struct Sag {
    /// Displacement of each node of the mesh (m).
    moved: Vec<DVec3>,
    body: Body,
    /// How long lattice and solve took (s).
    seconds: [f64; 2],
}

/// The mesh without elements of which all nodes are pinned, and the nodes that it has.
fn movable(mesh: &TetMesh, reference: &[(bool, DVec3)]) -> (TetMesh, Vec<u32>) {
    let moves = |tet: &&[u32; 4]| tet.iter().any(|node| !reference[*node as usize].0);
    let tets: Vec<[u32; 4]> = mesh.tets.iter().filter(moves).copied().collect();
    let mut nodes: Vec<u32> = tets.iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    let at = |node: u32| nodes.partition_point(|other| *other < node) as u32;
    let vertices = nodes.iter().map(|node| mesh.vertices[*node as usize]).collect();
    (TetMesh { vertices, tets: tets.iter().map(|tet| tet.map(at)).collect() }, nodes)
}

/// `whole`: elements of which all nodes are pinned are part of the lattice.
fn sag(
    mesh: &TetMesh,
    reference: &[(bool, DVec3)],
    options: &LatticeOptions,
    whole: bool,
) -> Result<Sag, Box<dyn Error>> {
    let begun = Instant::now();
    let all = (0..mesh.vertices.len() as u32).collect();
    let (part, nodes) = if whole { (mesh.clone(), all) } else { movable(mesh, reference) };
    let lattice = Lattice::of_mesh(&part, options)?;
    let points = lattice.embed_nodes()?;
    let is_pinned = |i: &u32| reference[nodes[*i as usize] as usize].0;
    let pinned: Vec<u32> = (0..points.len() as u32).filter(is_pinned).collect();
    let pins = lattice.embed_held(&pinned)?;
    let material = Material { law: Law::Corotated, young_modulus: 12e3, poisson_ratio: 0.45, density: 1200.0 };
    let body = Body::new(BodyDescription { name: "organ".into(), lattice, material, pins, fixed: vec![] })?;
    let mut state = BodyState::new(&body);
    let built = begun.elapsed().as_secs_f64();
    let mut newton = Newton::new(&body, Precision::default())?;
    newton.settle(&body, &Conditions::gravity(DVec3::Z * -9.81 * SHARE), &mut state)?;
    let mut moved = vec![DVec3::ZERO; mesh.vertices.len()];
    for (point, node) in points.iter().zip(nodes) {
        moved[node as usize] = point.interpolate(&state.positions) - mesh.vertices[node as usize];
    }
    let seconds = [built, begun.elapsed().as_secs_f64() - built];
    Ok(Sag { moved, body, seconds })
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, organ, path, cells @ ..] = &arguments[..] else {
        return Err("usage: sag ORGAN.msh REFERENCE.txt [CELL_MM ...]".into());
    };
    let mut cells = cells.iter().map(|cell| cell.parse()).collect::<Result<Vec<f64>, _>>()?;
    if cells.is_empty() {
        cells = vec![4.0, 3.0, 2.3, 1.5, 1.0];
    }
    let mesh = read_msh(Path::new(organ))?;
    let reference = reference(Path::new(path))?;
    if reference.len() != mesh.vertices.len() {
        return Err(format!("{path} has {} nodes, {organ} {}", reference.len(), mesh.vertices.len()).into());
    }
    let mean = |moved: &[DVec3]| moved.iter().map(|u| -u.z).sum::<f64>() / moved.len() as f64;
    let exact: Vec<DVec3> = reference.iter().map(|(_, u)| *u).collect();
    println!(
        "mean sag of the reference: {:.4} um, {} pinned",
        1e6 * mean(&exact),
        reference.iter().filter(|r| r.0).count()
    );
    println!(
        "| rule | cell (mm) | nodes | hexahedra | doubled | sag too small by | shape error | lattice (s) | solve (s) |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (name, rule, whole) in [
        ("Moments", BoundaryRule::Moments, true),
        ("Moments, without pinned elements", BoundaryRule::Moments, false),
        ("Fraction", BoundaryRule::Fraction, true),
    ] {
        for cell in &cells {
            let options = LatticeOptions { rule, ..LatticeOptions::new(1e-3 * cell) };
            let Sag { moved, body, seconds: [built, solved] } = sag(&mesh, &reference, &options, whole)?;
            let error = 1.0 - mean(&moved) / mean(&exact);
            // What is left after one factor on Young's modulus.
            let factor = exact.iter().zip(&moved).map(|(a, b)| a.dot(*b)).sum::<f64>()
                / moved.iter().map(|u| u.length_squared()).sum::<f64>();
            let left: f64 = exact.iter().zip(&moved).map(|(a, b)| (*a - factor * *b).length_squared()).sum();
            let shape = (left / exact.iter().map(|u| u.length_squared()).sum::<f64>()).sqrt();
            let lattice = body.lattice();
            println!(
                "| {name} | {cell} | {} | {} | {} | {:.1}% | {:.2}% | {built:.2} | {solved:.2} |",
                lattice.nodes().len(),
                lattice.hexahedra().len(),
                lattice.doubled_cells(),
                100.0 * error,
                100.0 * shape
            );
        }
    }
    Ok(())
}
