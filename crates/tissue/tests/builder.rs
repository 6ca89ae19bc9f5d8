//! Errors of the builder, and properties of a built model.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use glam::DVec3;
use trocar_geometry::TetMesh;
use trocar_testing::blocks::{FRAME, GRAVITY, block, model, tissue};
use trocar_tissue::{
    BodyDescription, Descent, MassFloor, Material, ModelBuilder, SolverSettings, Start, Stepper, SupportPlane,
};

#[test]
fn unusable_bodies_are_refused_by_name() {
    let good = block([2, 2, 2], 2e-3);
    let refuse = |mesh: &TetMesh, material: Material, pinned: Vec<u32>, words: &[&str]| {
        let body = BodyDescription { name: "spleen".into(), mesh, material, pinned, supports: vec![] };
        let said = ModelBuilder::new().body(body).unwrap_err().to_string();
        assert!(words.iter().chain(&["spleen"]).all(|w| said.contains(w)), "{said}");
    };
    let fine = tissue(12e3);
    refuse(&TetMesh::default(), fine, vec![], &["no element"]);
    let mut flat = good.clone();
    flat.vertices.iter_mut().for_each(|v| v.z = 0.0);
    refuse(&flat, fine, vec![], &["element 0", "volume"]);
    let mut turned = good.clone();
    turned.tets[5].swap(0, 1);
    refuse(&turned, fine, vec![], &["element 5"]);
    let mut nan = good.clone();
    nan.vertices[4].y = f64::NAN;
    refuse(&nan, fine, vec![], &["node 4"]);
    let mut lonely = good.clone();
    lonely.vertices.push(DVec3::ONE);
    refuse(&lonely, fine, vec![], &["node 27", "no element"]);
    refuse(&good, Material { young_modulus: 12e12, ..fine }, vec![], &["Young", "unit"]);
    refuse(&good, Material { poisson_ratio: 0.5, ..fine }, vec![], &["Poisson"]);
    refuse(&good, Material { density: f64::NAN, ..fine }, vec![], &["density"]);
    refuse(&good, fine, vec![99], &["node 99"]);
    refuse(&good, fine, vec![3, 4, 3], &["node 3", "twice"]);
    let mut sliver = good.clone();
    sliver.vertices[13] = DVec3::new(2e-3, 2e-3, 1e-9);
    refuse(&sliver, fine, vec![], &["flat"]);
    for (scale, size) in [(1000.0, "4.000e0 m"), (1e-3, "4.000e-6 m")] {
        let mut scaled = good.clone();
        scaled.vertices.iter_mut().for_each(|v| *v *= scale);
        refuse(&scaled, fine, vec![], &[size, "--units mm", "0.001"]);
    }
    assert!(ModelBuilder::new().build().is_err());
}

#[test]
fn light_nodes_are_raised_to_a_quarter_of_the_median() {
    // A block with one corner cube collapsed towards its corner: its nodes carry little.
    let mut mesh = block([4, 4, 4], 2e-3);
    for v in &mut mesh.vertices {
        if v.x < 3e-3 && v.y < 3e-3 && v.z < 3e-3 {
            *v *= 0.05;
        }
    }
    let model = model(&mesh, tissue(12e3), vec![], GRAVITY);
    let body = &model.bodies()[0];
    assert!(body.raised_masses() > 0);
    let mut masses: Vec<f64> = (0..body.len()).map(|i| body.mass(i)).collect();
    masses.sort_by(f64::total_cmp);
    assert!(masses[0] >= 0.249 * masses[masses.len() / 2]);
}

#[test]
fn the_mass_floor_is_a_choice() {
    let mut mesh = block([4, 4, 4], 2e-3);
    mesh.vertices.iter_mut().filter(|v| v.max_element() < 3e-3).for_each(|v| *v *= 0.05);
    let with = |floor: MassFloor| {
        let mut builder = ModelBuilder::new().mass_floor(floor);
        let (name, material) = ("block".into(), tissue(12e3));
        let body = BodyDescription { name, mesh: &mesh, material, pinned: vec![], supports: vec![] };
        builder.body(body).map(|_| {
            let model = builder.build().unwrap();
            let body = &model.bodies()[0];
            (body.raised_masses(), (0..body.len()).map(|i| body.mass(i)).sum::<f64>())
        })
    };
    let (none, bare) = with(MassFloor::None).unwrap();
    assert_eq!(none, 0);
    assert!((bare / (1200.0 * mesh.volume()) - 1.0).abs() < 1e-5);
    let (quarter, more) = with(MassFloor::default()).unwrap();
    assert!(quarter > 0 && more > bare);
    assert!(with(MassFloor::MedianShare(1.0)).unwrap().0 > quarter);
    for wrong in [-0.1, 1.1, f64::NAN] {
        assert!(with(MassFloor::MedianShare(wrong)).is_err());
    }
}

#[test]
fn parts_and_filtered_pairs_are_told() {
    let one = block([2, 2, 2], 2e-3);
    let mut two = one.clone();
    two.vertices.extend(one.vertices.iter().map(|v| *v + DVec3::X * 0.01));
    two.tets.extend(one.tets.iter().map(|t| t.map(|i| i + 27)));
    let mut builder = ModelBuilder::new();
    for mesh in [&one, &two] {
        let (name, material) = ("block".into(), tissue(12e3));
        builder.body(BodyDescription { name, mesh, material, pinned: vec![], supports: vec![] }).unwrap();
    }
    builder.filter_pair(1, 0).unwrap();
    builder.filter_pair(0, 1).unwrap();
    builder.filter_pair(1, 1).unwrap();
    assert!(builder.filter_pair(0, 2).unwrap_err().to_string().contains("there are 2"));
    let model = builder.build().unwrap();
    assert_eq!(model.bodies().iter().map(|b| b.parts()).collect::<Vec<_>>(), [1, 2]);
    assert!(!model.collides(0, 1) && !model.collides(1, 0) && !model.collides(1, 1));
    assert!(model.collides(0, 0) && !model.collides(0, 7));
}

#[test]
fn unusable_supports_schedules_and_frames_are_refused() {
    let mesh = block([2, 2, 2], 2e-3);
    for (normal, friction) in [(DVec3::Z * 2.0, 0.1), (DVec3::Z, -0.1), (DVec3::Z, f64::INFINITY), (DVec3::NAN, 0.1)] {
        let supports = vec![SupportPlane { point: DVec3::ZERO, normal, friction }.into()];
        let body =
            BodyDescription { name: "block".into(), mesh: &mesh, material: tissue(12e3), pinned: vec![], supports };
        assert!(ModelBuilder::new().body(body).is_err());
    }
    let model = model(&mesh, tissue(12e3), vec![], GRAVITY);
    let descent =
        |substeps, iterations| SolverSettings::Descent(Descent { substeps, iterations, start: Start::Adaptive });
    for (schedule, dt, word) in [
        (descent(0, 10), FRAME, "substeps"),
        (descent(8, 0), FRAME, "iterations"),
        (descent(usize::MAX, 10), FRAME, "substeps"),
        (SolverSettings::PAPER, 0.0, "frame"),
        (SolverSettings::PAPER, -1.0, "frame"),
        (SolverSettings::PAPER, f64::NAN, "frame"),
        (SolverSettings::PAPER, f64::INFINITY, "frame"),
    ] {
        let Err(said) = Stepper::new(&model, schedule, dt, 1) else { panic!("{schedule:?}, {dt} s is taken") };
        assert!(said.to_string().contains(word), "{said}");
    }
}
