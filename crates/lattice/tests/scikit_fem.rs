//! A clamped beam under its weight against quadratic tetrahedra of scikit-fem
//! (`oracles/skfem_beam.py` makes the fixture).

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and tell their figures")]

use glam::DVec3;
use trocar_lattice::{
    Body, BodyDescription, BodyState, BoundaryRule, Conditions, Lattice, LatticeOptions, Law, Material, Newton,
    Precision,
};
use trocar_testing::blocks::block;

/// The fixture's probes and displacements (m) under a heading.
fn reference(heading: &str) -> Vec<(DVec3, DVec3)> {
    let heading = format!("{heading} ");
    let lines = include_str!("fixtures/skfem_beam.txt").lines().skip_while(|line| !line.starts_with(&heading)).skip(1);
    let pair = |line: &str| -> Option<(DVec3, DVec3)> {
        let numbers: Vec<f64> = line.split(' ').map_while(|x| x.parse().ok()).collect();
        let [a, b, c, d, e, f] = <[f64; 6]>::try_from(numbers).ok()?;
        Some((DVec3::new(a, b, c), DVec3::new(d, e, f)))
    };
    lines.map_while(pair).collect()
}

/// Mean distance from the linear reference over the mean displacement.
fn error(law: Law, nu: f64, options: LatticeOptions) -> f64 {
    off(law, nu, options, 1e-3, &reference(&format!("nu {nu}")), Clamp::Nodes)
}

/// What holds the side at x = 0.
#[derive(Clone, Copy)]
enum Clamp {
    /// Fixed nodes of the lattice.
    Nodes,
    /// Pins at the side.
    Pins,
}

/// Mean distance from `reference` over the mean displacement, under a share of gravity.
fn off(law: Law, nu: f64, options: LatticeOptions, share: f64, reference: &[(DVec3, DVec3)], clamp: Clamp) -> f64 {
    // The lattice is cut from this mesh; it does not matter how fine that is.
    let mesh = block([12, 4, 3], 2e-3);
    let lattice = Lattice::of_mesh(&mesh, &options).unwrap();
    let clamped =
        |points: &[DVec3]| -> Vec<u32> { (0..points.len() as u32).filter(|i| points[*i as usize].x < 1e-9).collect() };
    let (fixed, pins) = match clamp {
        Clamp::Nodes => (clamped(lattice.nodes()), vec![]),
        Clamp::Pins => (vec![], lattice.embed_held(&clamped(&mesh.vertices)).unwrap()),
    };
    let material = Material { law, young_modulus: 12e3, poisson_ratio: nu, density: 1200.0 };
    let body = Body::new(BodyDescription { name: "beam".into(), lattice, material, pins, fixed }).unwrap();
    let mut state = BodyState::new(&body);
    let mut newton = Newton::new(&body, Precision::default()).unwrap();
    newton.settle(&body, &Conditions::gravity(DVec3::Z * -9.81 * share), &mut state).unwrap();
    assert_eq!(reference.len(), 27);
    let probes: Vec<DVec3> = reference.iter().map(|(p, _)| *p).collect();
    let points = body.lattice().embed(&probes).unwrap();
    let off = |(point, (p, u)): (&trocar_lattice::EmbeddedPoint, &(DVec3, DVec3))| {
        (point.interpolate(&state.positions) - *p - *u).length()
    };
    let sum: f64 = points.iter().zip(reference).map(off).sum();
    sum / reference.iter().map(|(_, u)| u.length()).sum::<f64>()
}

/// Full cells converge at second order, for every Poisson's ratio. The reference is itself off by
/// some 0.3%: at the edges of the clamped side the stress is singular.
#[test]
fn full_cells_converge_to_quadratic_tetrahedra() {
    for law in Law::ALL {
        for nu in [0.3, 0.45, 0.49, 0.499] {
            let off = [2e-3, 1e-3].map(|cell| error(law, nu, LatticeOptions::new(cell)));
            println!("{law:?}, nu {nu}: off by {off:.4?}");
            assert!(off[0] < 0.035 && off[1] < 0.3 * off[0] + 1e-3, "{law:?}, nu {nu}: {off:?}");
        }
    }
}

/// Cells that the beam fills in part are nearly as accurate as full ones, with points that have the
/// material's moments. With fractions of the whole cell they are not.
#[test]
fn boundary_cells_converge_too() {
    for nu in [0.3, 0.45, 0.499] {
        for cell in [2.6e-3, 2.1e-3, 1.7e-3, 1.3e-3, 1.1e-3] {
            // The clamped side lies in a plane of the grid, the others do not.
            let origin = Some(DVec3::new(0.0, -0.35, -0.6) * cell);
            let of = |rule| error(Law::Corotated, nu, LatticeOptions { origin, rule, ..LatticeOptions::new(cell) });
            let (moments, fraction) = (of(BoundaryRule::Moments), of(BoundaryRule::Fraction));
            println!("nu {nu}, {} mm: off by {moments:.4}, with fractions {fraction:.4}", 1e3 * cell);
            // As full cells of the same size: second order.
            assert!(moments < 0.008 * (1e3 * cell).powi(2) && fraction > 4.0 * moments);
        }
    }
}

/// Under full gravity the beam bends by half of its length: the laws themselves are compared.
#[test]
fn bent_beams_converge_to_quadratic_tetrahedra() {
    for law in Law::ALL {
        let reference = reference(&format!("bent {law:?}"));
        let off = [2e-3, 1e-3].map(|cell| off(law, 0.45, LatticeOptions::new(cell), 1.0, &reference, Clamp::Nodes));
        println!("{law:?}: off by {off:.4?}");
        assert!(off[0] < 0.035 && off[1] < 0.3 * off[0] + 3e-3, "{law:?}: {off:?}");
    }
}

/// Pins clamp a side along the grid as fixed nodes do, also in the middle of cells.
#[test]
fn pins_clamp_as_fixed_nodes() {
    for cell in [2.1e-3, 1.1e-3] {
        for offset in [0.0, 0.3, 0.5, 0.8] {
            let options =
                LatticeOptions { origin: Some(DVec3::new(-offset, -0.35, -0.6) * cell), ..LatticeOptions::new(cell) };
            let pinned = off(Law::Corotated, 0.45, options, 1e-3, &reference("nu 0.45"), Clamp::Pins);
            println!("{} mm, the side at {offset} of a cell: off by {pinned:.4}", 1e3 * cell);
            assert!(pinned < 0.008 * (1e3 * cell).powi(2), "{cell}, {offset}: {pinned}");
        }
    }
}
