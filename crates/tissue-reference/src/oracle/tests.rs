//! The oracle's derivatives, guard and line search, against differences and sampling.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use super::element::projected;
use super::guard::allowed_share;
use super::newton::{Solver, norm};
use super::potential::{Elastic, Motion, Potential};
use super::state::Nodes;
use glam::{DMat3, DVec3};
use trocar_geometry::TetMesh;
use trocar_tissue::assembly::{Stiffness, blocks, tangent};
use trocar_tissue::{BodyDescription, ConstitutiveModel, Material, Model, ModelBuilder, SupportPlane};

/// A number in -1..1 for each counter.
fn noise(k: usize) -> f64 {
    2.0 * ((k as f64 * 12.9898).sin() * 43758.5453).rem_euclid(1.0) - 1.0
}

fn noises(n: usize, seed: usize, size: f64) -> Vec<DVec3> {
    (0..n).map(|i| size * DVec3::from_array([0, 1, 2].map(|c| noise(3 * i + c + 1000 * seed)))).collect()
}

/// The matrix times a vector over all nodes, whose entries at fixed nodes count as 0.
fn times(matrix: &Stiffness, v: &[DVec3]) -> Vec<DVec3> {
    let mut out = vec![DVec3::ZERO; v.len()];
    for (i, j, block) in matrix.matrix().blocks() {
        let (i, j) = (matrix.free()[i as usize], matrix.free()[j as usize]);
        out[i] += *block * v[j];
        if i != j {
            out[j] += block.transpose() * v[i];
        }
    }
    out
}

/// Two by two by two cubes of 2 mm, six elements each.
fn block() -> TetMesh {
    let index = |i: usize, j: usize, k: usize| (9 * k + 3 * j + i) as u32;
    let mut mesh = TetMesh::default();
    for k in 0..27 {
        mesh.vertices.push(2e-3 * DVec3::new((k % 3) as f64, (k / 3 % 3) as f64, (k / 9) as f64));
    }
    for k in 0..8 {
        let corner = |c: usize| index(k % 2 + (c & 1), k / 2 % 2 + (c >> 1 & 1), k / 4 + (c >> 2 & 1));
        for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
            mesh.tets.push([corner(0), corner(a), corner(b), corner(7)]);
        }
    }
    mesh
}

fn model(constitutive: ConstitutiveModel, friction: f64) -> Model {
    let mesh = block();
    let material =
        Material { model: constitutive, young_modulus: 12e3, poisson_ratio: 0.45, density: 1200.0, viscosity: 4.0 };
    let plane = SupportPlane { point: DVec3::Z * 1e-3, normal: DVec3::Z, friction };
    let mut builder = ModelBuilder::new().gravity(DVec3::Z * -9.81);
    let supports = vec![plane.into()];
    builder.body(BodyDescription { name: "block".into(), mesh: &mesh, material, pinned: vec![26], supports }).unwrap();
    builder.build().unwrap()
}

/// A potential with all its parts, and a deformed place without special position.
fn deformed<'a>(elastic: &'a Elastic, model: &Model, dynamic: bool) -> (Potential<'a>, Vec<DVec3>) {
    let rest = model.bodies()[0].rest_positions();
    let n = rest.len();
    let motion = dynamic.then(|| {
        let nodes = Nodes { x: rest.to_vec(), v: noises(n, 3, 0.3), anchors: Vec::new() };
        Motion::new(elastic, &nodes, model.gravity(), 1.0 / 480.0)
    });
    let mut potential =
        Potential { elastic, motion, gravity: model.gravity(), limits: Vec::new(), contacts: None, tethers: &[] };
    let x: Vec<DVec3> = rest.iter().zip(noises(n, 5, 3e-4)).map(|(p, d)| 1.1 * *p + d).collect();
    if potential.rubs() {
        potential.limits = potential.friction_limits(&x);
        assert!(potential.limits.iter().any(|l| *l > 0.0));
    }
    (potential, x)
}

#[test]
fn gradient_and_hessian_are_the_energys_derivatives() {
    for constitutive in ConstitutiveModel::ALL {
        for (friction, dynamic) in [(0.0, false), (0.0, true), (0.6, true)] {
            let model = model(constitutive, friction);
            let elastic = Elastic::new(&model.bodies()[0]);
            let (potential, x) = deformed(&elastic, &model, dynamic);
            let mut fixed = vec![false; x.len()];
            fixed[4] = true;
            let mut matrix = Stiffness::new(&elastic.tets, &fixed);
            assert!(potential.hessian(&x, false, false, &mut matrix));
            let mut gradient = x.clone();
            potential.gradient(&x, &mut gradient);
            for seed in 10..18 {
                let mut along = noises(x.len(), seed, 1.0);
                along[4] = DVec3::ZERO;
                let d = 1e-8;
                let at = |s: f64| {
                    let moved: Vec<DVec3> = x.iter().zip(&along).map(|(x, a)| *x + s * d * *a).collect();
                    let mut gradient = moved.clone();
                    (potential.gradient(&moved, &mut gradient), gradient)
                };
                let ((e1, g1), (e0, g0)) = (at(1.0), at(-1.0));
                let slope: f64 = gradient.iter().zip(&along).map(|(g, a)| g.dot(*a)).sum();
                let what = format!("{constitutive:?}, friction {friction}, dynamic {dynamic}");
                assert!(((e1 - e0) / (2.0 * d) - slope).abs() < 1e-5 * norm(&gradient, &fixed), "{what}");
                let product = times(&matrix, &along);
                let difference: Vec<DVec3> = g1.iter().zip(&g0).map(|(a, b)| (*a - *b) / (2.0 * d)).collect();
                let error: Vec<DVec3> = product.iter().zip(&difference).map(|(a, b)| *a - *b).collect();
                let (error, size) = (norm(&error, &fixed), norm(&difference, &fixed));
                assert!(error < 1e-5 * size, "{what}: off by {error} N/m of {size}");
            }
        }
    }
}

/// Quadratic forms show the eigenvalues. Where all are positive, a tangent loses nothing.
#[test]
fn projection_takes_the_negative_part_alone() {
    let twist = DMat3::from_cols(DVec3::new(0.7, 0.3, -0.1), DVec3::new(-0.2, 0.6, 0.2), DVec3::new(0.1, -0.3, 0.8));
    for constitutive in ConstitutiveModel::ALL {
        let model = model(constitutive, 0.0);
        let psi = model.bodies()[0].material().hyperelastic();
        let form = |t: &[[f64; 9]; 9], v: &[f64]| -> f64 {
            (0..9).map(|c| (0..9).map(|r| v[c] * t[c][r] * v[r]).sum::<f64>()).sum()
        };
        let vector = |seed: usize| -> Vec<f64> { (0..9).map(|k| noise(50 * seed + k)).collect() };
        let raw = tangent(psi.as_ref(), twist);
        let safe = projected(&raw).unwrap();
        for seed in 0..500 {
            let v = vector(seed);
            assert!(form(&safe, &v) >= form(&raw, &v) - 1e-6 && form(&safe, &v) > -1e-9, "{constitutive:?}");
        }
        assert!((0..9).any(|k| (safe[k][k] - raw[k][k]).abs() > 1.0), "{constitutive:?}: nothing was negative");
        let again = projected(&safe).unwrap();
        assert!(safe.iter().flatten().zip(again.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-6));
        let gradients = Elastic::new(&model.bodies()[0]).gradients[0];
        let [a, b] = [blocks(&safe, &gradients)[1][2], blocks(&safe, &gradients)[2][1].transpose()];
        assert!((a - b).to_cols_array().iter().all(|d| d.abs() < 1e-3), "the stiffness is symmetric");
    }
    assert!(projected(&[[f64::NAN; 9]; 9]).is_none());
}

#[test]
fn no_element_loses_its_volume_on_the_way_that_is_allowed() {
    let model = model(ConstitutiveModel::Corotated, 0.0);
    let elastic = Elastic::new(&model.bodies()[0]);
    let x = model.bodies()[0].rest_positions();
    let least = |share: f64, step: &[DVec3]| {
        let moved: Vec<DVec3> = x.iter().zip(step).map(|(x, d)| *x + share * *d).collect();
        (0..elastic.tets.len()).map(|t| elastic.deformation(t, &moved).determinant()).fold(f64::INFINITY, f64::min)
    };
    let mut cut = 0;
    for seed in 0..200 {
        let step = noises(x.len(), seed, 1e-4 * (1 + seed) as f64);
        let share = allowed_share(&elastic, x, &step);
        assert!((0..=100).all(|k| least(share * f64::from(k) / 100.0, &step) >= 0.0999), "{seed}");
        if share < 1.0 {
            cut += 1;
            let left = least(share, &step);
            assert!(left < 0.1001, "{seed}: {share} leaves {left}, less could be left");
        }
    }
    assert!((50..200).contains(&cut), "{cut}");
}

#[test]
fn every_newton_step_lowers_the_energy() {
    for constitutive in ConstitutiveModel::ALL {
        let model = model(constitutive, 0.0);
        let elastic = Elastic::new(&model.bodies()[0]);
        let (potential, far) = deformed(&elastic, &model, true);
        let mut fixed = vec![false; far.len()];
        fixed[26] = true;
        // Far from the minimum and not convex; squeezed so far, St. Venant-Kirchhoff tissue
        // collapses (see below).
        let squeeze = match constitutive {
            ConstitutiveModel::StVenantKirchhoff => DVec3::new(0.8, 1.2, 0.8),
            _ => DVec3::new(0.5, 1.4, 0.6),
        };
        let far: Vec<DVec3> = far.iter().map(|p| squeeze * *p).collect();
        let mut before = f64::INFINITY;
        let mut scratch = far.clone();
        let mut steps = 0;
        loop {
            let mut x = far.clone();
            let done = Solver::new(1e-10, steps).minimise(&potential, &fixed, 1e-10, &mut x).is_ok();
            let energy = potential.gradient(&x, &mut scratch);
            assert!(energy <= before + 1e-13 * elastic.scale, "{constitutive:?} step {steps}: {energy} after {before}");
            if done {
                break;
            }
            (before, steps) = (energy, steps + 1);
            assert!(steps < 60, "{constitutive:?}: {:.3e} N", norm(&scratch, &fixed));
        }
        assert!(steps > 2, "{constitutive:?}: not far enough away to tell");
    }
}

/// Why the test above squeezes St. Venant-Kirchhoff tissue less: its energy falls all the way to a
/// flat element and beyond. The guard leaves that element a tenth of its volume in each step, and
/// it holds up all others; no Newton step, projected or not, leads out of there.
#[test]
fn st_venant_kirchhoff_tissue_squeezed_too_far_goes_flat() {
    let model = model(ConstitutiveModel::StVenantKirchhoff, 0.0);
    let elastic = Elastic::new(&model.bodies()[0]);
    let (potential, far) = deformed(&elastic, &model, true);
    let mut fixed = vec![false; far.len()];
    fixed[26] = true;
    let far: Vec<DVec3> = far.iter().map(|p| DVec3::new(0.5, 1.4, 0.6) * *p).collect();
    let after = |steps: usize| {
        let (mut x, mut gradient) = (far.clone(), far.clone());
        assert!(Solver::new(1e-10, steps).minimise(&potential, &fixed, 1e-10, &mut x).is_err());
        let least = (0..elastic.tets.len()).map(|t| elastic.deformation(t, &x).determinant());
        (least.fold(f64::INFINITY, f64::min), potential.gradient(&x, &mut gradient))
    };
    let mut before = after(2);
    for steps in 3..10 {
        let (least, energy) = after(steps);
        assert!((0.09..0.11).contains(&(least / before.0)), "step {steps}: {least} after {}", before.0);
        assert!(energy < before.1, "step {steps}: {energy} J after {}", before.1);
        before = (least, energy);
    }
}
