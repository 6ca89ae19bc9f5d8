//! The derivatives of contact, against differences.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use super::super::potential::{Elastic, Motion, Potential};
use super::super::state::{Nodes, Stretches};
use super::{Contacts, Touching};
use glam::{DQuat, DVec3};
use trocar_core::Pose;
use trocar_testing::blocks::{GRAVITY, block, noise, tissue};
use trocar_tissue::assembly::Stiffness;
use trocar_tissue::{
    BodyContact, BodyDescription, Collider, Hull, Model, ModelBuilder, Shape, ToolContact, ToolMotion,
};

fn noises(n: usize, seed: u64, size: f64) -> Vec<DVec3> {
    let one = |i: usize, c: u64| size * (2.0 * noise(1000 * seed + 3 * i as u64 + c) - 1.0);
    (0..n).map(|i| DVec3::new(one(i, 0), one(i, 1), one(i, 2))).collect()
}

/// Two blocks, the second above the first and a little inside its offset, and a tool of each shape.
fn scene() -> Model {
    let lower = block([3, 3, 1], 3e-3);
    let mut upper = block([2, 2, 1], 3e-3);
    upper.vertices.iter_mut().for_each(|p| *p = DVec3::new(1.1, 1.3, 0.0) * 1e-3 + *p + DVec3::Z * 3e-3);
    // Bodies that are apart at rest have the whole offset.
    upper.vertices.iter_mut().for_each(|p| p.z += 2e-3);
    let contact = BodyContact { friction: 0.4, ..BodyContact::default() };
    let mut builder = ModelBuilder::new().gravity(GRAVITY).tool_contact(ToolContact::Surface).body_contact(contact);
    for (name, mesh) in [("lower", &lower), ("upper", &upper)] {
        let name = name.into();
        builder.body(BodyDescription { name, mesh, material: tissue(5e3), pinned: vec![], supports: vec![] }).unwrap();
    }
    let corner = |k: u32| 2e-3 * DVec3::from_array([0, 1, 2].map(|c| if k >> c & 1 == 1 { 1.0 } else { -1.0 }));
    let hull = Hull::of(&(0..8).map(corner).collect::<Vec<_>>()).unwrap();
    let shapes = [
        Shape::Sphere { centre: DVec3::new(1.6, 1.1, 9.6) * 1e-3, radius: 2e-3 },
        Shape::Capsule { ends: [DVec3::new(-1.0, 3.3, 9.2) * 1e-3, DVec3::new(5.2, 4.9, 9.0) * 1e-3], radius: 1.5e-3 },
        Shape::Box { centre: DVec3::new(8.0, 8.0, 4.4) * 1e-3, rotation: DQuat::IDENTITY, half: DVec3::splat(2e-3) },
        Shape::HalfSpace { point: DVec3::Z * 0.2e-3, normal: DVec3::Z },
        hull.into(),
    ];
    for shape in shapes {
        let name = "tool".into();
        builder.collider(Collider { name, tool: 0, shape, rest_offset: 0.3e-3, friction: 0.5 }).unwrap();
    }
    builder.build().unwrap()
}

/// With everything held at one place, at that place and near it.
#[test]
fn gradient_and_hessian_are_the_energys_derivatives() {
    let model = scene();
    let elastic = Elastic::of(model.bodies());
    let touching = Touching::new(&model, 0..2);
    let n = elastic.rest.len();
    let fixed = vec![false; n];
    // The upper one comes down by 0.8 mm.
    let mut start = elastic.rest.clone();
    start[model.bodies()[0].len()..].iter_mut().for_each(|p| p.z -= 0.8e-3);
    let stretches = Stretches::new();
    let turn = DQuat::from_rotation_z(0.02);
    let motion =
        ToolMotion { from: Pose::IDENTITY, to: Pose { rotation: turn, translation: DVec3::new(2e-4, 1e-4, 0.0) } };
    for dynamic in [false, true] {
        let nodes = Nodes { x: start.clone(), v: vec![DVec3::ZERO; n], anchors: Vec::new() };
        let motion_of = dynamic.then(|| Motion::new(&elastic, &nodes, model.gravity(), 1.0 / 480.0));
        let kept = dynamic.then_some((&start[..], &stretches));
        let mut contacts = Contacts::new(&touching, &elastic.contact_stiffness, &fixed, &[motion], kept);
        let x: Vec<DVec3> = start.iter().zip(noises(n, 5, 2e-4)).map(|(p, d)| *p + d).collect();
        (0..4).for_each(|_| contacts.hold(&x, true));
        // Nodes, edges and triangles at tools; nodes at the other body.
        let mut pressed = [0; 4];
        for touch in contacts.list.iter().filter(|touch| touch.gap(&x, contacts.blur).depth < 0.0) {
            pressed[touch.pieces[0].count - 1] += 1;
        }
        assert!(pressed.iter().all(|count| *count > 0), "{pressed:?}");
        let pairs: Vec<[u32; 2]> = (0..n as u32).flat_map(|i| (0..i).map(move |k| [k, i])).collect();
        let mut matrix = Stiffness::with_pairs(&elastic.tets, &pairs, &fixed);
        let potential = Potential {
            elastic: &elastic,
            motion: motion_of,
            gravity: model.gravity(),
            limits: Vec::new(),
            contacts: Some(contacts),
            tethers: &[],
        };
        assert!(potential.hessian(&x, false, false, &mut matrix));
        let mut gradient = x.clone();
        potential.gradient(&x, &mut gradient);
        for seed in 10..16 {
            let along = noises(n, seed, 1.0);
            let d = 1e-9;
            let at = |s: f64| {
                let moved: Vec<DVec3> = x.iter().zip(&along).map(|(x, a)| *x + s * d * *a).collect();
                let mut gradient = moved.clone();
                (potential.gradient(&moved, &mut gradient), gradient)
            };
            let ((e1, g1), (e0, g0)) = (at(1.0), at(-1.0));
            let slope: f64 = gradient.iter().zip(&along).map(|(g, a)| g.dot(*a)).sum();
            let size = gradient.iter().map(|g| g.length_squared()).sum::<f64>().sqrt();
            assert!(((e1 - e0) / (2.0 * d) - slope).abs() < 1e-4 * size, "{} and {slope}", (e1 - e0) / (2.0 * d));
            let mut product = vec![DVec3::ZERO; n];
            for (i, j, block) in matrix.matrix().blocks() {
                let (i, j) = (i as usize, j as usize);
                product[i] += *block * along[j];
                if i != j {
                    product[j] += block.transpose() * along[i];
                }
            }
            let difference = |i: usize| (g1[i] - g0[i]) / (2.0 * d);
            let error = (0..n).map(|i| (product[i] - difference(i)).length_squared()).sum::<f64>().sqrt();
            let size = (0..n).map(|i| difference(i).length_squared()).sum::<f64>().sqrt();
            assert!(error < 1e-4 * size, "off by {error} N/m of {size}");
        }
    }
}
