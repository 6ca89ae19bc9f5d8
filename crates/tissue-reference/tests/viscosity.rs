//! The dashpots' viscosity against a Newtonian fluid's.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and tell their figures")]

use glam::{DMat3, DQuat, DVec3};
use trocar_geometry::{LatticeMesher, SignedDistance, TetMesh};
use trocar_testing::blocks::{model, nodes, tissue};
use trocar_tissue::Material;
use trocar_tissue_reference::oracle::Precision;
use trocar_tissue_reference::{Oracle, OracleState};

const VISCOSITY: f64 = 50.0;

/// Tissue in which nothing but viscosity acts.
fn fluid() -> Material {
    Material { viscosity: VISCOSITY, ..tissue(1.0) }
}

struct Box3(DVec3);

impl SignedDistance for Box3 {
    fn distance(&self, p: DVec3) -> f64 {
        let d = p.abs() - self.0;
        d.max(DVec3::ZERO).length() + d.max_element().min(0.0)
    }
}

fn lattice(half: DVec3, cell: f64) -> TetMesh {
    LatticeMesher::uniform(cell).mesh_shape(&Box3(half), (-half, half)).unwrap()
}

/// Power that a rate of strain D dissipates in the mesh, over the Newtonian 2 eta D:D + (bulk - 2
/// eta/3) tr(D)^2 of its volume.
fn power(mesh: &TetMesh, rate: DMat3, bulk: f64) -> f64 {
    let model = model(mesh, fluid(), vec![], DVec3::ZERO);
    let (mut state, dt) = (OracleState::new(&model), 1e-7);
    for (i, p) in mesh.vertices.iter().enumerate() {
        state.velocities_mut(0)[i] = 100.0 * (rate * *p);
    }
    let before = state.velocities(0).to_vec();
    let precision = Precision { gradient: 1e-6, ..Precision::default() };
    Oracle::with_precision(&model, precision).step(&model, &mut state, dt, &[]).unwrap();
    let lost: f64 = before
        .iter()
        .zip(state.velocities(0))
        .enumerate()
        .map(|(i, (a, b))| model.bodies()[0].mass(i) * a.dot(*a - *b) / dt)
        .sum();
    let squares: f64 = rate.to_cols_array().iter().map(|d| d * d).sum();
    let trace = rate.x_axis.x + rate.y_axis.y + rate.z_axis.z;
    1e-4 * lost / (mesh.volume() * (2.0 * VISCOSITY * squares + (bulk - 2.0 / 3.0 * VISCOSITY) * trace * trace))
}

#[test]
fn shear_and_swelling_dissipate_as_in_a_newtonian_fluid() {
    let mesh = lattice(DVec3::splat(10e-3), 1.5e-3);
    let shear = DMat3::from_cols(DVec3::ZERO, DVec3::X, DVec3::ZERO);
    let shear = (shear + shear.transpose()) * 0.5;
    let mut seen = Vec::new();
    for (a, b) in [(0.0, 0.0), (0.6, 0.0), (0.8, 0.0), (0.4, 0.7), (1.1, 0.3), (0.2, 1.2)] {
        let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, a, b, a - b));
        seen.push(power(&mesh, turn * shear * turn.transpose(), 0.0));
    }
    let swelling = power(&mesh, DMat3::IDENTITY, 5.0 / 3.0 * VISCOSITY);
    println!("over Newtonian: shear {seen:.3?}, swelling {swelling:.3}");
    let mean = seen.iter().sum::<f64>() / seen.len() as f64;
    assert!((mean - 1.0).abs() < 0.1, "{seen:?}");
    assert!(seen.iter().all(|s| (s - 1.0).abs() < 0.15), "{seen:?}");
    assert!((swelling - 1.0).abs() < 1e-2, "{swelling}");
}

/// A shear wave between two walls, v = sin(pi z/H) along x, decays at the rate eta k^2/rho.
#[test]
fn a_shear_wave_decays_at_the_viscosity_s_rate() {
    let half = DVec3::new(20e-3, 4e-3, 4e-3);
    let mut mesh = lattice(half, 1e-3);
    let height = 8e-3;
    let material = fluid();
    let lift = mesh.vertices.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    mesh.vertices.iter_mut().for_each(|p| p.z -= lift);
    let top = mesh.vertices.iter().map(|p| p.z).fold(0.0, f64::max);
    let walls = nodes(&mesh, |p| p.z < 1e-6 || p.z > top - 1e-6 || p.x.abs() > 19e-3);
    let model = model(&mesh, material, walls, DVec3::ZERO);
    let k = std::f64::consts::PI / height;
    let rate = VISCOSITY * k * k / material.density;
    let mut state = OracleState::new(&model);
    let free: Vec<usize> = (0..mesh.vertices.len()).filter(|i| !model.bodies()[0].pinned()[*i]).collect();
    for &i in &free {
        state.velocities_mut(0)[i].x = 1e-6 * (k * mesh.vertices[i].z).sin();
    }
    // The middle alone: far from the ends.
    let middle: Vec<usize> = free.into_iter().filter(|i| mesh.vertices[*i].x.abs() < 6e-3).collect();
    let mean = |state: &OracleState| -> f64 {
        middle.iter().map(|i| state.velocities(0)[*i].x * (k * mesh.vertices[*i].z).sin()).sum()
    };
    let (mut oracle, steps, dt) = (Oracle::new(&model), 20, 0.02 / rate);
    let early = mean(&state);
    for _ in 0..steps {
        oracle.step(&model, &mut state, dt, &[]).unwrap();
    }
    // Implicit Euler's own law: 1/(1 + rate dt) a step.
    let seen = ((early / mean(&state)).powf(1.0 / f64::from(steps)) - 1.0) / dt;
    println!("decays at {seen:.1} /s, a Newtonian fluid at {rate:.1} /s");
    assert!((seen / rate - 1.0).abs() < 0.15, "{seen} /s, {rate} /s");
}
