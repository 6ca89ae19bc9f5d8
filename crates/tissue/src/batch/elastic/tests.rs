use super::*;
use crate::Isa;
use crate::registers::{BLOCK, parts};
use fearless_simd::dispatch;
use glam::DVec3;
use trocar_lattice::{Body, BodyDescription, Flow, Lattice, LatticeOptions, Law};
use trocar_testing::blocks::{appendix, noise};

/// A body with this fill of its boundary cells.
fn body(fill: f64) -> Body {
    let options = LatticeOptions { fill, ..LatticeOptions::new(4e-3) };
    let lattice = Lattice::of_mesh(&appendix(3e-3), &options).unwrap();
    let material = Material { law: Law::StableNeoHookean, young_modulus: 8e3, poisson_ratio: 0.45, density: 1e3 };
    Body::new(BodyDescription { name: "appendix".into(), lattice, material, pins: vec![], fixed: vec![] }).unwrap()
}

/// Displacements of nodes (cells): turned, sheared, and shaken by noise; the last lanes are also
/// squeezed and stretched beyond the limits.
fn displacements(topology: &Topology) -> Vec<[Block<f32>; 3]> {
    let mut u = vec![[Block([0.0; BLOCK]); 3]; topology.len()];
    for (i, rest) in topology.rest.iter().enumerate() {
        for lane in 0..BLOCK {
            let size = lane as f64 / 15.0;
            let turn = glam::DQuat::from_scaled_axis(DVec3::new(0.7, -0.4, 0.9) * 2.0 * size);
            let stretch = match lane {
                13 => DVec3::new(0.12, 1.0, 1.1),
                14 => DVec3::new(4.6, 0.6, 0.5),
                15 => DVec3::new(5.2, 0.3, 0.1),
                _ => DVec3::new(1.0 + 0.2 * size, 1.0 - 0.1 * size, 1.0),
            };
            let shaken = DVec3::from_array([0, 1, 2].map(|k| noise((48 * i + 3 * lane + k) as u64) - 0.5)) * 0.2 * size;
            let moved = turn * (stretch * (*rest / topology.cell)) + shaken - *rest / topology.cell;
            for k in 0..3 {
                u[i][k].0[lane] = moved[k] as f32;
            }
        }
    }
    u
}

#[inline(always)]
fn all<S: Simd>(simd: S, topology: &Topology, u: &[[Block<f32>; 3]], gradient: &mut [[Block<f32>; 3]]) -> Block<f32> {
    let mut least = Block([0.0; BLOCK]);
    for part in 0..parts::<S>() {
        let ratio = add_elastic(simd, topology, u, gradient, part);
        store::<S>(ratio, &mut least, part);
    }
    least
}

/// Forces and volume ratios of every lane are those of the elements of `trocar-lattice` in double
/// precision.
#[test]
fn forces_are_those_of_the_lattice() {
    for fill in [1e-3, 1e-2] {
        let body = body(fill);
        let topology = Topology::new(&body).unwrap();
        let u = displacements(&topology);
        let mut gradient = vec![[Block([0.0; BLOCK]); 3]; topology.len()];
        let least = dispatch!(Isa::detect().level(), simd => all(simd, &topology, &u, &mut gradient));
        let unit = body.material().young_modulus * topology.cell * topology.cell;
        for lane in 0..BLOCK {
            let at = |place: &u32| {
                let [x, y, z] = [0, 1, 2].map(|k| f64::from(u[*place as usize][k].0[lane]));
                topology.rest[*place as usize] + DVec3::new(x, y, z) * topology.cell
            };
            let x: Vec<DVec3> = topology.places.iter().map(at).collect();
            let mut expected = vec![DVec3::ZERO; x.len()];
            let (_, ratio) = body.add_elastic(&x, &Flow::default(), &mut expected);
            let (mut off, mut size) = (0.0, 0.0);
            for (place, expected) in topology.places.iter().zip(&expected) {
                let own = DVec3::from_array([0, 1, 2].map(|k| f64::from(gradient[*place as usize][k].0[lane])));
                off += (own - *expected / unit).length_squared();
                size += (*expected / unit).length_squared();
            }
            // At rest forces are rounding: a strain of 1e-6 in each cell.
            let scale = size.sqrt().max(0.1 * (topology.cells.len() as f64).sqrt());
            // Fictitious tissue is simpler, and beyond the limits of strain it has none.
            let bar = if lane < 13 { 0.3 * fill + 2e-5 } else { 5.0 * fill };
            assert!(off.sqrt() < bar * scale, "fill {fill}, lane {lane}: {} of {scale}", off.sqrt());
            assert!((f64::from(least.0[lane]) - ratio).abs() < 1e-4, "lane {lane}: {} {ratio}", least.0[lane]);
        }
    }
}
