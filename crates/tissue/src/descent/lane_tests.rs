//! The sweep in lanes equals the sweep vertex by vertex, with any instruction set.
#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use super::kernel::Kernel;
use super::stretched::StretchedElements;
use super::vertex_step::Substep;
use crate::contact::ContactSet;
use crate::support::{SupportField, SupportPlane};
use crate::{BodyDescription, ConstitutiveModel, Isa, Material, Model, ModelBuilder};
use glam::{DVec3, Vec3A};
use trocar_geometry::TetMesh;

/// A box of cubes of six elements each, with its nodes out of line.
fn block(n: usize) -> TetMesh {
    let mut mesh = TetMesh::default();
    let index = |c: [usize; 3]| ((c[2] * (n + 1) + c[1]) * (n + 1) + c[0]) as u32;
    for k in 0..(n + 1).pow(3) {
        let at = [k % (n + 1), k / (n + 1) % (n + 1), k / (n + 1).pow(2)].map(|c| c as f64);
        mesh.vertices.push(2e-3 * (DVec3::from(at) + 0.15 * noise(k)));
    }
    for k in 0..n.pow(3) {
        let at = [k % n, k / n % n, k / n.pow(2)];
        let corner = |c: usize| index([at[0] + (c & 1), at[1] + (c >> 1 & 1), at[2] + (c >> 2 & 1)]);
        for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
            mesh.tets.push([corner(0), corner(a), corner(b), corner(7)]);
        }
    }
    mesh
}

/// Seventy elements around one edge: strips too long for the lanes.
fn wheel() -> TetMesh {
    let mut mesh = TetMesh { vertices: vec![DVec3::ZERO, 5e-3 * DVec3::Z], ..TetMesh::default() };
    for k in 0..70u32 {
        let angle = f64::from(k) * std::f64::consts::TAU / 70.0;
        mesh.vertices.push(5e-3 * DVec3::new(angle.cos(), angle.sin(), 0.4 + 0.1 * noise(k as usize).x));
        mesh.tets.push([0, 2 + k, 2 + (k + 1) % 70, 1]);
    }
    mesh
}

/// A deterministic vector in -1..1.
fn noise(k: usize) -> DVec3 {
    let one = |k: f64| (k.sin() * 43758.5453).fract();
    DVec3::new(one(k as f64 * 12.9898), one(k as f64 * 78.233 + 1.0), one(k as f64 * 37.719 + 2.0))
}

fn model(mesh: &TetMesh, viscosity: f64) -> Model {
    let material = Material {
        model: ConstitutiveModel::StableNeoHookean,
        young_modulus: 12e3,
        poisson_ratio: 0.45,
        density: 1200.0,
        viscosity,
    };
    let pinned = (0..mesh.vertices.len() as u32).filter(|i| mesh.vertices[*i as usize].z > 9e-3).collect();
    let middle = mesh.vertices.iter().sum::<DVec3>() / mesh.vertices.len() as f64;
    let plane = SupportPlane { point: middle - 1e-3 * DVec3::Z, normal: DVec3::Z, friction: 0.4 };
    let field = SupportField::under(mesh, DVec3::Y, 1e-3, 0.3).unwrap();
    let supports = vec![plane.into(), field.into()];
    let body = BodyDescription { name: "block".into(), mesh, material, pinned, supports };
    let mut builder = ModelBuilder::new();
    builder.body(body).unwrap();
    builder.build().unwrap()
}

#[test]
fn lanes_do_what_single_vertices_do() {
    let block = block(6);
    for (mesh, viscosity, squeeze) in [
        (&block, 0.0, 1.0),
        (&block, 60.0, 1.0),
        (&block, 0.0, 0.2),
        (&block, 0.0, 5.0),
        (&wheel(), 0.0, 1.0),
        (&wheel(), 60.0, 0.2),
    ] {
        let model = model(mesh, viscosity);
        let body = &model.bodies[0];
        let mut rest = vec![Vec3A::ZERO; body.len()];
        for (node, at) in mesh.vertices.iter().enumerate() {
            rest[body.internal[node] as usize] = (at - body.origin).as_vec3a();
        }
        let jolted = |by: f64, seed: usize| -> Vec<Vec3A> {
            let jolt = |(i, p): (usize, &Vec3A)| *p + (by * noise(i + seed)).as_vec3a();
            rest.iter().enumerate().map(jolt).collect()
        };
        // Nearly flat elements meet the barrier, large steps the guard, and long ones the limit of
        // stretch.
        let squeezed = |p: &Vec3A| *p * Vec3A::new(1.0, 1.0, squeeze);
        let mut begin: Vec<Vec3A> = jolted(2e-5, 9).iter().map(squeezed).collect();
        begin[body.color_start[body.colors()] as usize..]
            .iter_mut()
            .zip(&rest[body.color_start[body.colors()] as usize..])
            .for_each(|(x, p)| *x = squeezed(p));
        let fixed: Vec<bool> = (0..body.len()).map(|i| body.vertices[i].pinned || i % 7 == 3).collect();
        let sweep = |isa| {
            let (start, predictor) = (jolted(1e-4, 200), jolted(2e-3, 400));
            let contacts = ContactSet::of_everything(body, &start);
            let mut stretched = StretchedElements::default();
            stretched.find(body, &begin);
            let substep = Substep {
                body,
                h: 1.0 / 480.0,
                start: &start,
                predictor: &predictor,
                fixed: &fixed,
                contacts: &contacts,
                stretched: &stretched,
                isa,
                single_thread: false,
            };
            let (mut x, mut moved, mut expected) = (begin.clone(), begin.clone(), begin.clone());
            super::sweep::sweep(&substep, &mut x, &mut moved);
            let Kernel::StableNeoHookean(term) = Kernel::of(body) else { return (x, expected) };
            super::sweep::sweep_with(&substep, &term, &mut expected, &mut moved);
            (x, expected)
        };
        let (x, expected) = sweep(Isa::Portable);
        let largest = expected.iter().zip(&begin).map(|(a, b)| (*a - *b).length()).fold(0.0, f32::max);
        assert!(largest > 2e-5, "nothing moves: {largest}");
        for (i, (x, expected)) in x.iter().zip(&expected).enumerate() {
            let error = (*x - *expected).length();
            assert!(
                error < 1e-3 * largest,
                "vertex {i}: off by {error} m of {largest} m ({viscosity} Pa s, {squeeze})"
            );
            assert!(!fixed[i] || *x == begin[i]);
        }
        for isa in Isa::ALL {
            assert!(sweep(isa).0 == x, "{}: other bits", isa.name());
        }
    }
}

#[test]
fn every_corner_and_edge_is_in_a_strip_once() {
    let (mesh, viscosity) = (block(5), 60.0);
    let model = model(&mesh, viscosity);
    let body = &model.bodies[0];
    let mut groups = 0;
    for group in body.groups.all() {
        groups += 1;
        for lane in 0..group.count as usize {
            let vertex = group.first as usize + lane;
            let steps = body.groups.steps_of(group);
            let sum: f32 = steps.iter().map(|step| step.inverse_6v.0[lane].abs()).sum();
            let expected: f32 = body.corners_of(vertex).map(|k| body.corners[k].inverse_6v).sum();
            assert!((sum - expected).abs() < 1e-4 * expected, "vertex {vertex}: {sum}, {expected}");
            let sum: f32 = steps.iter().map(|step| step.edge.0[lane]).sum();
            let expected: f32 = body.edges_of(vertex).iter().map(|edge| edge.laplacian).sum();
            assert!((sum - expected).abs() < 1e-4 * expected.abs(), "vertex {vertex}: {sum}, {expected}");
        }
    }
    let free = body.vertices.iter().filter(|vertex| !vertex.pinned).count();
    assert_eq!(free, body.color_start[body.colors()] as usize);
    assert!(groups >= free.div_ceil(16) && groups <= free / 16 + body.colors());
}
