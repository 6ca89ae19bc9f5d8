//! Properties of every cut, on random planes and rectangles.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use glam::{DQuat, DVec3};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::sync::LazyLock;
use trocar_geometry::TetMesh;
use trocar_testing::blocks::{self, appendix, block, noise, tissue};
use trocar_tissue::{Cut, Model, Severed, State, sever};

/// A tube with a state in which it is bent and twisted, and a block.
static ORGANS: LazyLock<Vec<(Model, State)>> = LazyLock::new(|| {
    let deformed = |mesh: &TetMesh, bend: f64| {
        let model = blocks::model(mesh, tissue(12e3), blocks::nodes(mesh, |p| p.x < 4e-3), DVec3::ZERO);
        let mut state = State::new(&model);
        for (i, p) in mesh.vertices.iter().enumerate() {
            let x = DQuat::from_rotation_y(bend * p.x) * *p + DVec3::Z * bend * p.x * p.y;
            state.set_position(&model, 0, i, x);
            state.set_velocity(&model, 0, i, DVec3::new(noise(3 * i as u64), noise(3 * i as u64 + 1), 0.0));
        }
        (model, state)
    };
    vec![deformed(&appendix(2.6e-3), 6.0), deformed(&block([8, 4, 4], 2e-3), 0.0)]
});

fn mesh_of(model: &Model, state: &State, body: usize) -> TetMesh {
    TetMesh { vertices: state.positions(model, body), tets: model.bodies()[body].tets().to_vec() }
}

/// Number of elements of each part that hangs together by faces; `open` says which faces do not
/// join.
fn sizes(mesh: &TetMesh, open: impl Fn(usize, usize) -> bool) -> Vec<usize> {
    let neighbours = mesh.neighbours();
    let mut seen = vec![false; mesh.tets.len()];
    let mut sizes = Vec::new();
    for first in 0..mesh.tets.len() {
        if std::mem::replace(&mut seen[first], true) {
            continue;
        }
        let (mut stack, mut size) = (vec![first], 0);
        while let Some(t) = stack.pop() {
            size += 1;
            for other in neighbours[t].iter().flatten().map(|other| *other as usize) {
                if !seen[other] && !open(t, other) {
                    seen[other] = true;
                    stack.push(other);
                }
            }
        }
        sizes.push(size);
    }
    sizes
}

/// Whether every edge of the surface is met as often one way as the other.
fn closed(mesh: &TetMesh) -> bool {
    let mut edges = BTreeMap::new();
    for [a, b, c] in mesh.boundary().0.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *edges.entry((from.min(to), from.max(to))).or_insert(0) += if from < to { 1 } else { -1 };
        }
    }
    edges.values().all(|sum| *sum == 0)
}

fn check(model: &Model, state: &State, cut: &Severed) {
    let whole = &model.bodies()[0];
    let before = mesh_of(model, state, 0);
    let (mut seen, mut open_faces, mut mass) = (vec![false; whole.tets().len()], 0, 0.0);
    let mut copies: Vec<Vec<(usize, usize)>> = vec![Vec::new(); whole.len()];
    for piece in &cut.pieces {
        let body = &cut.model.bodies()[piece.body];
        let mesh = mesh_of(&cut.model, &cut.state, piece.body);
        assert_eq!((body.len(), body.tets().len()), (piece.nodes.len(), piece.elements.len()));
        // Elements: each once, their corners where they were, at rest and now, moving as they did.
        for (t, element) in piece.elements.iter().enumerate() {
            assert!(!std::mem::replace(&mut seen[*element as usize], true));
            for (now, was) in body.tets()[t].iter().zip(whole.tets()[*element as usize]) {
                assert_eq!(piece.nodes[*now as usize], was);
            }
        }
        let mut used = vec![false; body.len()];
        body.tets().iter().flatten().for_each(|i| used[*i as usize] = true);
        assert!(!used.contains(&false), "no node stands alone");
        for (now, was) in piece.nodes.iter().map(|was| *was as usize).enumerate() {
            copies[was].push((piece.body, now));
            assert_eq!(cut.state.position(&cut.model, piece.body, now), state.position(model, 0, was));
            assert_eq!(cut.state.velocity(&cut.model, piece.body, now), state.velocity(model, 0, was));
            assert_eq!(body.rest_positions()[now], whole.rest_positions()[was]);
            assert_eq!(body.pinned()[now], whole.pinned()[was]);
            mass += body.mass(now);
        }
        assert!(closed(&mesh), "a piece's surface is closed");
        assert!(cut.pieces.len() == 1 || body.parts() == 1);
        let smallest = sizes(&mesh, |_, _| false).into_iter().min().unwrap();
        assert!(smallest >= 4, "a crumb of {smallest} elements");
        open_faces += mesh.boundary().0.triangles.len();
    }
    assert!(!seen.contains(&false));
    assert_eq!(open_faces, before.boundary().0.triangles.len() + 2 * cut.faces);
    for (was, copies) in copies.iter().enumerate() {
        let sum: f64 = copies.iter().map(|(body, i)| cut.model.bodies()[*body].mass(*i)).sum();
        assert!((sum / whole.mass(was) - 1.0).abs() < 1e-6, "node {was}: {sum} kg for {}", whole.mass(was));
    }
    let total: f64 = (0..whole.len()).map(|i| whole.mass(i)).sum();
    assert!((mass / total - 1.0).abs() < 1e-6);
}

fn unit() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-1.0..1.0f64).prop_filter_map("no direction", |v| DVec3::from(v).try_normalize())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_cut_keeps_what_it_must(
        organ in 0..2usize,
        node in any::<prop::sample::Index>(),
        normal in unit(),
        half in prop::array::uniform2(1e-3..3e-2f64),
        whole_plane in any::<bool>(),
    ) {
        let (model, state) = &ORGANS[organ];
        let point = state.position(model, 0, node.index(model.bodies()[0].len()));
        let mut plane = Cut::through(0, point, normal);
        if !whole_plane {
            plane.half_extents = half;
        }
        let cut = sever(model, state, &plane).unwrap();
        check(model, state, &cut);
        // And across the first.
        let across = Cut { body: 0, normal: plane.along, along: normal, ..plane };
        let again = sever(&cut.model, &cut.state, &across).unwrap();
        let (inner, outer) = (&cut.model.bodies()[0], &again.pieces);
        assert_eq!(outer.iter().map(|p| p.elements.len()).sum::<usize>(), inner.tets().len());
    }
}

#[test]
fn no_crumbs_fall_where_sides_by_centroid_alone_would_leave_some() {
    let (model, state) = &ORGANS[0];
    let mesh = mesh_of(model, state, 0);
    let mut would_fall = 0;
    for k in 0..60 {
        let point = mesh.vertices[(noise(k) * mesh.vertices.len() as f64) as usize];
        let normal = DVec3::new(noise(1000 + k) - 0.5, noise(2000 + k) - 0.5, noise(3000 + k) - 0.5).normalize();
        let above = |t: usize| (mesh.corners(t).iter().sum::<DVec3>() / 4.0 - point).dot(normal) > 0.0;
        let naive = sizes(&mesh, |a, b| above(a) != above(b));
        would_fall += naive.iter().filter(|size| **size < 4).count();
        let cut = sever(model, state, &Cut::through(0, point, normal)).unwrap();
        for piece in &cut.pieces {
            assert!(piece.elements.len() >= 4, "a crumb of {} elements", piece.elements.len());
        }
        // A smooth cut has less area to it than one by centroids.
        let rough: usize = mesh
            .neighbours()
            .iter()
            .enumerate()
            .map(|(t, n)| n.iter().flatten().filter(|o| above(t) != above(**o as usize)).count())
            .sum();
        assert!(cut.faces <= rough, "{} faces, {} by centroids", cut.faces, rough / 2);
    }
    assert!(would_fall > 10, "the planes are not such that crumbs could fall: {would_fall}");
}
