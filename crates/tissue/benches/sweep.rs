//! Cost of a sweep of Vertex Block Descent on a specimen of six organs: one table, minima over many
//! repetitions.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark stops where it cannot go on, and prints")]

use glam::DVec3;
use std::path::Path;
use std::time::Instant;
use trocar_geometry::TetMesh;
use trocar_geometry::io::read_msh;
use trocar_tissue::{
    BodyDescription, ConstitutiveModel, Descent, Isa, Material, Model, ModelBuilder, SolverSettings, Start, State,
    Stepper,
};

/// Six organs in one file, beside the repository.
const MESH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/peers/meshes/specimen_a.msh");

/// Share of each organ's nodes that is pinned, the lowest ones.
const PINNED: f64 = 0.42;

const FRAME: f64 = 1.0 / 60.0;
const SUBSTEPS: usize = 8;
const SWEEPS: usize = 10;

fn main() {
    let path = Path::new(MESH);
    if !path.exists() {
        println!("skipped: there is no {MESH}");
        return;
    }
    let repetitions: usize = std::env::args().filter_map(|a| a.parse().ok()).next().unwrap_or(30);
    let organs = components(&read_msh(path).unwrap());
    let begun = Instant::now();
    let (model, pairs) = model(&organs);
    let built = begun.elapsed().as_secs_f64() * 1e3;
    println!("{} bodies, {pairs} pairs of a free vertex and an element, built in {built:.0} ms", organs.len());
    println!("instructions  threads   ns/pair  ms/sweep  ms/frame  ms/substep beside the sweeps");
    for isa in Isa::ALL.into_iter().filter(|isa| isa.is_available()) {
        Isa::limit(isa);
        for threads in [1, 2] {
            let [frame, twice] = times(&model, threads, repetitions);
            let sweep = (twice - frame) / (SUBSTEPS * SWEEPS) as f64;
            let beside = frame / SUBSTEPS as f64 - sweep * SWEEPS as f64;
            let (name, pair) = (isa.name(), sweep * 1e6 / pairs as f64);
            println!("{name:12}  {threads:7} {pair:9.2} {sweep:9.4} {frame:9.2} {beside:9.4}");
        }
    }
}

/// Least times of a frame with the paper's sweeps, and with twice as many (ms).
fn times(model: &Model, threads: usize, repetitions: usize) -> [f64; 2] {
    let mut runs = [SWEEPS, 2 * SWEEPS].map(|iterations| {
        let schedule = SolverSettings::Descent(Descent { substeps: SUBSTEPS, iterations, start: Start::Adaptive });
        (State::new(model), Stepper::new(model, schedule, FRAME, threads).unwrap(), f64::INFINITY)
    });
    for _ in 0..repetitions {
        for (state, stepper, least) in &mut runs {
            let begun = Instant::now();
            let report = stepper.step(model, state, &[]);
            *least = least.min(begun.elapsed().as_secs_f64() * 1e3);
            assert!(report.divergence.is_none());
        }
    }
    runs.map(|(_, _, least)| least)
}

/// The connected parts of a mesh.
fn components(mesh: &TetMesh) -> Vec<TetMesh> {
    let mut root: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    loop {
        let mut changed = false;
        for tet in &mesh.tets {
            let least = tet.iter().map(|i| root[*i as usize]).min().unwrap();
            for i in tet {
                changed |= root[*i as usize] != least;
                root[*i as usize] = least;
            }
        }
        if !changed {
            break;
        }
    }
    let mut parts: Vec<u32> = root.clone();
    parts.sort_unstable();
    parts.dedup();
    let part = |which: &u32| {
        let mut number = vec![0; root.len()];
        let mut organ = TetMesh::default();
        for (i, _) in root.iter().enumerate().filter(|(_, r)| *r == which) {
            number[i] = organ.vertices.len() as u32;
            organ.vertices.push(mesh.vertices[i]);
        }
        let tets = mesh.tets.iter().filter(|t| root[t[0] as usize] == *which);
        organ.tets = tets.map(|t| t.map(|i| number[i as usize])).collect();
        organ
    };
    parts.iter().map(part).filter(|organ| !organ.tets.is_empty()).collect()
}

/// The organs' model, and its pairs of a free vertex and one of its elements.
fn model(organs: &[TetMesh]) -> (Model, usize) {
    let material = Material {
        model: ConstitutiveModel::StableNeoHookean,
        young_modulus: 12e3,
        poisson_ratio: 0.45,
        density: 1200.0,
        viscosity: 0.0,
    };
    let mut builder = ModelBuilder::new().gravity(DVec3::new(0.0, 0.0, -9.81));
    let mut pairs = 0;
    for (k, mesh) in organs.iter().enumerate() {
        let mut order: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
        order.sort_by(|a, b| mesh.vertices[*a as usize].z.total_cmp(&mesh.vertices[*b as usize].z));
        order.truncate((PINNED * order.len() as f64).round() as usize);
        let mut free = vec![true; mesh.vertices.len()];
        order.iter().for_each(|i| free[*i as usize] = false);
        pairs += mesh.tets.iter().flatten().filter(|i| free[**i as usize]).count();
        let body = BodyDescription { name: format!("organ {k}"), mesh, material, pinned: order, supports: vec![] };
        builder.body(body).unwrap();
    }
    (builder.build().unwrap(), pairs)
}
