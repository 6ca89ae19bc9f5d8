//! A clamped beam against theory under refinement.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and tell their figures")]

use trocar_testing::blocks::{GRAVITY, block, nodes, tissue};
use trocar_tissue::{BodyDescription, ConstitutiveModel, MassFloor, Material, ModelBuilder};
use trocar_tissue_reference::{Oracle, OracleState};

/// Tip deflection over Timoshenko's, w L^4/(8 E I) + w L^2/(2 k G A) with k = 5/6, for the beam's
/// own weight w per length; `n` elements over half its height. nu = 0: the clamp then holds no
/// lateral contraction, of which beam theory knows nothing.
fn deflection(constitutive: ConstitutiveModel, n: usize) -> f64 {
    let (length, height, width): (f64, f64, f64) = (32e-3, 4e-3, 2e-3);
    // Stiff: the tip falls by a 500th of the height.
    let young_modulus = 10e6;
    let mesh = block([16 * n, n, 2 * n], 2e-3 / n as f64);
    let material = Material { model: constitutive, poisson_ratio: 0.0, ..tissue(young_modulus) };
    let mut builder = ModelBuilder::new().gravity(GRAVITY).mass_floor(MassFloor::None);
    let pinned = nodes(&mesh, |p| p.x == 0.0);
    builder.body(BodyDescription { name: "beam".into(), mesh: &mesh, material, pinned, supports: vec![] }).unwrap();
    let model = builder.build().unwrap();
    let mut state = OracleState::new(&model);
    Oracle::new(&model).settle(&model, &mut state, &[]).unwrap();
    let tip = nodes(&mesh, |p| (p.x - length).abs() < 1e-9);
    let sag: f64 = tip.iter().map(|i| mesh.vertices[*i as usize].z - state.positions(0)[*i as usize].z).sum();
    let load = material.density * 9.81 * width * height;
    let bending = load * length.powi(4) / (8.0 * young_modulus * width * height.powi(3) / 12.0);
    let shear = load * length.powi(2) / (2.0 * 5.0 / 6.0 * 0.5 * young_modulus * width * height);
    sag / tip.len() as f64 / (bending + shear)
}

/// Linear tetrahedra are too stiff in bending by an error of second order in their size: it falls
/// with the square of the size, towards theory.
#[test]
fn a_beam_bends_as_theory_says_at_second_order() {
    for constitutive in ConstitutiveModel::ALL {
        let sizes: &[usize] = if constitutive == ConstitutiveModel::StableNeoHookean { &[1, 2, 4] } else { &[1, 2] };
        let off: Vec<f64> = sizes.iter().map(|n| 1.0 - deflection(constitutive, *n)).collect();
        let orders: Vec<f64> = off.windows(2).map(|d| (d[0] / d[1]).log2()).collect();
        println!("{constitutive:?}: too stiff by {off:.4?}, orders {orders:.2?}");
        assert!(off.iter().all(|d| *d > 0.0), "{constitutive:?} is too soft: {off:?}");
        // A relative error d of a stiff beam is d/(1 - d) of its compliance: far from theory the
        // order shows late.
        assert!(orders[0] > 1.2, "{constitutive:?}: {orders:?}");
        if let [.., a, b] = off[..]
            && off.len() > 2
        {
            assert!((1.7..2.3).contains(&orders[1]), "{orders:?}");
            let extrapolated = b - (a - b) / 3.0;
            assert!(extrapolated.abs() < 0.015, "Richardson's limit is {extrapolated} off theory");
        }
    }
}
