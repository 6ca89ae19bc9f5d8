//! Elements against finite differences, affine fields and rotations.

use super::*;
use crate::flow::Flow;
use crate::material::{Law, Part};
use crate::points::Symmetric;
use fearless_simd::{Level, dispatch};
use glam::DQuat;

fn material(law: Law, poisson_ratio: f64) -> Material {
    Material { law, young_modulus: 12e3, poisson_ratio, density: 1200.0 }
}

/// A full cell and a boundary cell.
fn hexahedra() -> [Hexahedron; 2] {
    let full = Hexahedron {
        nodes: [0, 1, 2, 3, 4, 5, 6, 7],
        cell: [0; 3],
        fraction: 1.0,
        centre: DVec3::splat(0.5),
        spread: DMat3::from_diagonal(DVec3::splat(GAUSS)),
    };
    let spread =
        DMat3::from_cols(DVec3::new(0.2, 0.05, 0.0), DVec3::new(0.05, 0.1, -0.02), DVec3::new(0.0, -0.02, 0.15));
    [full, Hexahedron { fraction: 0.3, centre: DVec3::new(0.6, 0.3, 0.4), spread, ..full }]
}

const CELL: f64 = 3e-3;

/// A number in -1..1 for each counter.
fn noise(k: usize) -> f64 {
    ((k as f64 * 12.9898 + 4.1414).sin() * 43758.547).fract()
}

fn moved(by: f64, affine: DMat3) -> [DVec3; 8] {
    std::array::from_fn(|c| {
        let rest = CELL * (0.5 * CORNERS[c] + DVec3::splat(0.5));
        let d = DVec3::new(noise(3 * c), noise(3 * c + 1), noise(3 * c + 2));
        affine * rest + by * CELL * d
    })
}

fn elements(check: impl Fn(Element<'_>, [DVec3; 8], &str)) {
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 2.5, -0.7, 1.0));
    let squeezed = turn * DMat3::from_diagonal(DVec3::new(0.6, 0.9, 1.3));
    for law in Law::ALL {
        for nu in [0.0, 0.45, 0.499] {
            for hex in &hexahedra() {
                for (by, affine) in [(0.0, DMat3::IDENTITY), (0.05, turn), (0.15, squeezed)] {
                    let material = material(law, nu);
                    let element = Element { hex, cell: CELL, fill: 1e-3, material: &material };
                    check(element, moved(by, affine), &format!("{law:?}, nu {nu}, {by}, fraction {}", hex.fraction));
                }
            }
        }
    }
}

/// d' H d.
fn along(blocks: &Blocks, d: &[DVec3; 8]) -> f64 {
    let mut sum = 0.0;
    for a in 0..8 {
        for b in 0..=a {
            let twice = if a == b { 1.0 } else { 2.0 };
            sum += twice * d[a].dot(blocks[a * (a + 1) / 2 + b] * d[b]);
        }
    }
    sum
}

#[test]
fn gradient_and_hessian_are_derivatives() {
    elements(|element, x, name| {
        let exact = element.evaluate(&x, Wanted::Exact);
        let blocks = exact.hessian.unwrap();
        let stiffness = 1e-6 * CELL * element.material.bulk_modulus() * element.hex.fraction;
        for a in 0..8 {
            for c in 0..3 {
                let h = 1e-5 * CELL;
                let at = |by: f64| {
                    let mut x = x;
                    x[a][c] += by;
                    element.evaluate(&x, Wanted::Gradient)
                };
                let (more, less) = (at(h), at(-h));
                let force = (more.energy - less.energy) / (2.0 * h);
                assert!((force - exact.gradient[a][c]).abs() < stiffness * CELL, "{name}: {force}");
                for b in 0..8 {
                    let difference = (more.gradient[b] - less.gradient[b]) / (2.0 * h);
                    let (row, column) = (a.max(b), a.min(b));
                    let block = blocks[row * (row + 1) / 2 + column];
                    let block = if b >= a { block } else { block.transpose() };
                    let error = (difference - block.col(c)).length();
                    assert!(error < 100.0 * stiffness, "{name}: ({b}, {a}) {error} of {stiffness}");
                }
            }
        }
    });
}

/// The projected stiffness has no negative curvature, and is exact where the exact one has none.
#[test]
fn the_projected_hessian_is_positive() {
    let mut indefinite = 0;
    elements(|element, x, name| {
        let exact = element.evaluate(&x, Wanted::Exact).hessian.unwrap();
        let projected = element.evaluate(&x, Wanted::Projected).hessian.unwrap();
        for k in 0..50 {
            let d: [DVec3; 8] = std::array::from_fn(|c| {
                DVec3::new(noise(99 * k + 3 * c), noise(99 * k + 3 * c + 1), noise(99 * k + 3 * c + 2))
            });
            assert!(along(&projected, &d) >= along(&exact, &d) - 1e-9, "{name}");
            assert!(along(&projected, &d) >= 0.0, "{name}");
        }
    });
    // Squeezing a rotated cell makes the exact one indefinite.
    let [full, _] = hexahedra();
    let material = material(Law::Corotated, 0.45);
    let element = Element { hex: &full, cell: CELL, fill: 0.0, material: &material };
    let x = moved(0.0, DMat3::from_diagonal(DVec3::splat(0.5)));
    let exact = element.evaluate(&x, Wanted::Exact).hessian.unwrap();
    let spin: [DVec3; 8] = std::array::from_fn(|c| DVec3::Z.cross(CORNERS[c]));
    indefinite += usize::from(along(&exact, &spin) < 0.0);
    assert_eq!(indefinite, 1);
}

/// An affine field gives the same F at every point: the energy is that of the volume.
#[test]
fn affine_fields_are_exact() {
    let affine = DMat3::from_cols(DVec3::new(1.1, 0.2, -0.1), DVec3::new(-0.3, 0.8, 0.25), DVec3::new(0.05, -0.2, 1.3));
    for law in Law::ALL {
        for hex in &hexahedra() {
            let material = material(law, 0.45);
            let element = Element { hex, cell: CELL, fill: 0.0, material: &material };
            let s = Svd::of(affine).s;
            let density = material.at(Part::Deviatoric, s).energy + material.at(Part::Volumetric, s).energy;
            let energy = element.evaluate(&moved(0.0, affine), Wanted::Gradient).energy;
            assert!((energy / (density * hex.fraction * CELL.powi(3)) - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn rotations_change_neither_energy_nor_forces() {
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, -1.5, 0.7, 3.0));
    elements(|element, x, name| {
        let here = element.evaluate(&x, Wanted::Gradient);
        let there = element.evaluate(&x.map(|p| turn * p + DVec3::splat(0.1)), Wanted::Gradient);
        let scale = element.material.bulk_modulus() * CELL.powi(3);
        assert!((here.energy - there.energy).abs() < 1e-12 * scale, "{name}");
        for (a, b) in here.gradient.iter().zip(&there.gradient) {
            assert!((turn * *a - *b).length() < 1e-11 * scale / CELL, "{name}");
        }
    });
}

/// The forces without singular values are those with them, also where tissue is inverted or its
/// limits of strain act, and have the same bits on every instruction set.
#[test]
fn both_ways_to_the_forces_agree() {
    let check = |element: Element<'_>, x: [DVec3; 8], name: &str| {
        let (energy, gradient, least) = forces(element, &x, None);
        let flow = Flow { stiffness: 700.0, before: vec![green(element, &x.map(|p| 1.01 * p))] };
        for before in [None, Some((&flow, &flow.before[0]))] {
            let baseline = dispatch!(Level::baseline(), simd => element.forces(simd, &x, before));
            assert_eq!(baseline, forces(element, &x, before), "{name}");
        }
        assert_eq!(dispatch!(Level::baseline(), simd => element.green(simd, &x)), green(element, &x), "{name}");
        assert!((least - element.least_volume_ratio(&x)).abs() < 1e-12, "{name}: {least}");
        let with = element.evaluate(&x, Wanted::Gradient);
        let scale = element.material.bulk_modulus() * CELL.powi(3);
        assert!((energy - with.energy).abs() < 1e-12 * scale.max(energy.abs()), "{name}: {energy} {}", with.energy);
        let size = gradient.iter().map(|g| g.length()).fold(scale / CELL, f64::max);
        for (a, b) in gradient.iter().zip(&with.gradient) {
            assert!((*a - *b).length() < 1e-11 * size, "{name}: {a} {b}");
        }
    };
    elements(check);
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 2.5, -0.7, 1.0));
    let [flat, inside_out, long] = [[0.3, 0.5, 0.7], [-0.4, 0.9, 1.1], [5.0, 0.6, 0.7]];
    for (law, hex) in Law::ALL.into_iter().flat_map(|law| hexahedra().map(|hex| (law, hex))) {
        let material = material(law, 0.45);
        let element = Element { hex: &hex, cell: CELL, fill: 1e-3, material: &material };
        for stretches in [flat, inside_out, long] {
            let affine = turn * DMat3::from_diagonal(DVec3::from_array(stretches));
            check(element, moved(0.02, affine), &format!("{law:?}, {stretches:?}, fraction {}", hex.fraction));
        }
    }
}

/// Viscous forces are the gradient of their potential, vanish in a rotation, and their stiffness is
/// the second derivative where nothing is strained.
#[test]
fn viscous_forces_have_a_potential() {
    elements(|element, x, name| {
        let flow = Flow { stiffness: 700.0, before: vec![green(element, &x)] };
        let viscous = |x: &[DVec3; 8]| {
            let ((with, a, _), (without, b, _)) =
                (forces(element, x, Some((&flow, &flow.before[0]))), forces(element, x, None));
            (with - without, std::array::from_fn::<DVec3, 8, _>(|c| a[c] - b[c]))
        };
        let scale = flow.stiffness * CELL * CELL;
        let turn = DMat3::from_rotation_z(0.8);
        let turned = viscous(&x.map(|p| turn * p));
        assert!(turned.1.iter().all(|force| force.length() < 1e-9 * scale), "{name}");
        let way: [DVec3; 8] = std::array::from_fn(|c| 1e-3 * DVec3::new((c as f64).sin(), (c as f64).cos(), 0.3));
        let at = |share: f64| std::array::from_fn(|c| x[c] + share * way[c]);
        let (more, less) = (viscous(&at(1.0 + 1e-4)).0, viscous(&at(1.0 - 1e-4)).0);
        let slope: f64 = viscous(&at(1.0)).1.iter().zip(&way).map(|(g, d)| g.dot(*d)).sum();
        assert!(((more - less) / 2e-4 / slope - 1.0).abs() < 1e-5, "{name}: {slope}");
        let mut blocks = [DMat3::ZERO; 36];
        element.add_viscous(&x, &flow, &mut blocks);
        let curvature = along(&blocks, &way);
        let change: f64 = viscous(&at(1e-4)).1.iter().zip(&way).map(|(g, d)| g.dot(*d)).sum();
        assert!((change / 1e-4 / curvature - 1.0).abs() < 1e-3, "{name}: {change} {curvature}");
    });
}

fn forces(element: Element<'_>, x: &[DVec3; 8], before: Option<(&Flow, &Symmetric)>) -> (f64, [DVec3; 8], f64) {
    dispatch!(Level::new(), simd => element.forces(simd, x, before))
}

fn green(element: Element<'_>, x: &[DVec3; 8]) -> Symmetric {
    dispatch!(Level::new(), simd => element.green(simd, x))
}
