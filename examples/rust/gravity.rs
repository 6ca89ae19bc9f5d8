//! A soft rod, held at one end, sags under gravity.

#![allow(clippy::print_stdout, reason = "an example prints its result")]

use trocar::prelude::*;

/// A rod along x, 60 mm long and 10 mm thick, with round ends.
struct Rod;

impl SignedDistance for Rod {
    fn distance(&self, p: DVec3) -> f64 {
        p.distance(DVec3::X * p.x.clamp(0.0, 0.06)) - 0.005
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let bounds = (DVec3::new(-0.005, -0.005, -0.005), DVec3::new(0.065, 0.005, 0.005));
    let mesh = LatticeMesher::uniform(0.003).mesh_shape(&Rod, bounds)?;
    let pinned = (0..mesh.vertices.len() as u32).filter(|i| mesh.vertices[*i as usize].x < 0.005);
    let tissue = Material {
        model: ConstitutiveModel::StableNeoHookean,
        young_modulus: 30e3,
        poisson_ratio: 0.45,
        density: 1050.0,
        viscosity: 180.0,
    };
    let mut builder = ModelBuilder::new().gravity(DVec3::new(0.0, 0.0, -9.81));
    builder.body(BodyDescription {
        name: "rod".to_owned(),
        mesh: &mesh,
        material: tissue,
        pinned: pinned.collect(),
        supports: Vec::new(),
    })?;
    let model = builder.build()?;
    let mut state = State::new(&model);
    let mut stepper = Stepper::new(&model, SolverSettings::default(), 1.0 / 60.0, 0)?;
    for _ in 0..120 {
        let report = stepper.step(&model, &mut state, &[]);
        assert_eq!(report.inverted, 0, "no element ever inverts");
    }
    let lowest = state.positions(&model, 0).iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    println!("after 2 s the tip hangs {:.1} mm low; state {:016x}", -1e3 * lowest, state.hash());
    Ok(())
}
