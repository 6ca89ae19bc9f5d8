//! Detection against every triangle in double precision with the winding number for a sign, and
//! against exact convex shapes.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic; the timing is printed")]

use super::proximity::{Limits, Near, Proximity};
use crate::{BodyDescription, ConstitutiveModel, Hull, Material, Model, ModelBuilder, State};
use glam::{DQuat, DVec3};
use std::path::Path;
use std::time::Instant;
use trocar_geometry::io::read_msh;
use trocar_geometry::{MeshDistance, SignedDistance, TetMesh};

/// A number in 0..1 for each counter, the same on every machine.
fn noise(k: u64) -> f64 {
    trocar_core::unit(trocar_core::mix(k.wrapping_mul(0x9e37_79b9_7f4a_7c15)))
}

fn random(seed: u64) -> DVec3 {
    DVec3::new(noise(3 * seed), noise(3 * seed + 1), noise(3 * seed + 2)) * 2.0 - 1.0
}

/// A box of cubes of six tetrahedra each, coordinates 0 to `cells`, bent by `to`.
fn block(cells: [u32; 3], to: impl Fn(DVec3) -> DVec3) -> TetMesh {
    let [nx, ny, nz] = cells;
    let index = |i: u32, j: u32, k: u32| (k * (ny + 1) + j) * (nx + 1) + i;
    let mut mesh = TetMesh::default();
    for n in 0..(nx + 1) * (ny + 1) * (nz + 1) {
        let (i, j, k) = (n % (nx + 1), n / (nx + 1) % (ny + 1), n / ((nx + 1) * (ny + 1)));
        mesh.vertices.push(to(DVec3::new(f64::from(i), f64::from(j), f64::from(k))));
    }
    for (i, j, k) in (0..nx * ny * nz).map(|n| (n % nx, n / nx % ny, n / (nx * ny))) {
        let corner = |c: u32| index(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2 & 1));
        for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
            mesh.tets.push([corner(0), corner(a), corner(b), corner(7)]);
        }
    }
    mesh
}

/// A lump of some 40 mm at `centre`.
fn organ(seed: u64, centre: DVec3) -> TetMesh {
    let cells = [8, 7, 6];
    let half = DVec3::new(4.0, 3.5, 3.0);
    let turn = DQuat::from_axis_angle(random(seed).normalize(), 6.0 * noise(seed));
    let size = DVec3::new(18e-3, 16e-3, 14e-3) * (1.0 + 0.2 * random(seed + 1));
    block(cells, |p| {
        let u = (p - half) / half;
        // A cube's points drawn in towards a ball, with dents.
        let round = u * (1.0 - 0.4 * (1.0 - u.abs().max_element() / u.length().max(1e-9)));
        let dent = 1.0 + 0.06 * (4.0 * u.x + seed as f64).sin() * (4.0 * u.y).cos();
        let rough = 0.02 * random(seed * 7919 + (p.x + 10.0 * p.y + 100.0 * p.z) as u64);
        centre + turn * ((round * dent + rough) * size)
    })
}

fn model(meshes: &[TetMesh]) -> Model {
    let material = Material {
        model: ConstitutiveModel::StableNeoHookean,
        young_modulus: 12e3,
        poisson_ratio: 0.45,
        density: 1200.0,
        viscosity: 0.0,
    };
    let mut builder = ModelBuilder::new();
    for mesh in meshes {
        let body = BodyDescription { name: "organ".into(), mesh, material, pinned: vec![], supports: vec![] };
        builder.body(body).unwrap();
    }
    builder.build().unwrap()
}

/// Moves a whole body.
fn shift(model: &Model, state: &mut State, body: usize, by: DVec3) {
    for node in 0..model.bodies()[body].len() {
        let p = state.position(model, body, node);
        state.set_position(model, body, node, p + by);
    }
}

/// The boundary of a body where it is now, and the node of each of its vertices.
fn boundary(model: &Model, state: &State, body: usize) -> (trocar_geometry::TriMesh, Vec<u32>) {
    let mesh = TetMesh { vertices: state.positions(model, body), tets: model.bodies()[body].tets().to_vec() };
    mesh.boundary()
}

/// Every surface vertex of `a` with its signed distance from `b`, by internal number: all
/// triangles, the winding number for a sign.
fn brute_force(model: &Model, state: &State, a: usize, b: usize) -> Vec<(u32, f64)> {
    let (points, nodes) = boundary(model, state, a);
    let solid = MeshDistance::new(&boundary(model, state, b).0).unwrap();
    let internal = &model.bodies()[a].internal;
    nodes.iter().zip(&points.vertices).map(|(i, p)| (internal[*i as usize], solid.distance(*p))).collect()
}

fn find(proximity: &mut Proximity, model: &Model, state: &State, reach: f32) -> Vec<Near> {
    let mut found = Vec::new();
    proximity.find(model, &state.bodies, |_, _| reach, &mut found);
    found
}

/// What `near` says of the two places, in double precision: foot and vertex, world.
fn places(model: &Model, state: &State, near: &Near) -> (DVec3, DVec3) {
    let at =
        |body: u32, i: u32| model.bodies()[body as usize].origin + state.bodies[body as usize].x[i as usize].as_dvec3();
    let foot = (0..3).map(|k| f64::from(near.weights[k]) * at(near.other, near.triangle[k])).sum();
    (foot, at(near.body, near.vertex))
}

#[test]
fn finds_what_every_triangle_says() {
    let (mut outside, mut inside) = (0, 0);
    for seed in 0..6 {
        let centres = [DVec3::ZERO, DVec3::new(0.1, 0.0, 0.0), DVec3::new(0.0, 0.1, 0.0)];
        let meshes: Vec<TetMesh> = (0..3).map(|k| organ(10 * seed + k as u64, centres[k])).collect();
        let model = model(&meshes);
        let mut state = State::new(&model);
        // Apart at rest, then pushed into each other, each turned and stretched a little.
        for k in 1..3 {
            shift(&model, &mut state, k, -centres[k] * (0.72 - 0.04 * noise(seed)));
        }
        let reach = 3e-3;
        let limits = Limits::default();
        let found = find(&mut Proximity::new(&model, limits), &model, &state, reach);
        assert!(found.is_sorted_by_key(|n| (n.body, n.vertex, n.other)));
        let mut expected = Vec::new();
        for (a, b) in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)] {
            for (vertex, distance) in brute_force(&model, &state, a, b) {
                expected.push((a as u32, vertex, b as u32, distance));
            }
        }
        let at = |n: &Near| expected.iter().find(|e| (e.0, e.1, e.2) == (n.body, n.vertex, n.other)).unwrap().3;
        for near in &found {
            let distance = at(near);
            assert!((f64::from(near.distance) - distance).abs() < 1e-7, "{near:?}, and it is {distance}");
            let (foot, p) = places(&model, &state, near);
            let normal = near.normal.as_dvec3();
            assert!((normal.length() - 1.0).abs() < 1e-5);
            assert!((foot + f64::from(near.distance) * normal).distance(p) < 2e-7, "{near:?}");
            assert_eq!(near.free, 1.5e-3);
            if distance < 0.0 { inside += 1 } else { outside += 1 }
        }
        let due = |e: &&(u32, u32, u32, f64)| e.3 < f64::from(reach) - 1e-7 && e.3 > -f64::from(limits.depth) + 1e-7;
        assert!(found.len() >= expected.iter().filter(due).count());
    }
    println!("{outside} outside, {inside} inside");
    assert!(outside > 300 && inside > 200, "{outside} outside, {inside} inside");
}

#[test]
fn signs_near_sharp_edges_and_corners_are_those_of_the_convex_shape() {
    // A thin wedge and a spike: where the nearest face alone would often give the wrong sign.
    let spike = [DVec3::ZERO, DVec3::new(6e-3, 0.0, 0.0), DVec3::new(2e-3, 5e-3, 0.0), DVec3::new(30e-3, 4e-3, 9e-3)];
    let wedge =
        [DVec3::ZERO, DVec3::new(0.0, 20e-3, 0.0), DVec3::new(40e-3, 10e-3, 2e-3), DVec3::new(40e-3, 9e-3, -1e-3)];
    for (which, corners) in [spike, wedge].into_iter().enumerate() {
        let mut one = TetMesh { vertices: corners.to_vec(), tets: vec![[0, 1, 2, 3]] };
        if one.inverted() > 0 {
            one.tets[0].swap(0, 1);
        }
        let hull = Hull::of(&corners).unwrap();
        let probe = block([12, 12, 12], |p| 0.2 + 1e-3 * p);
        let model = model(&[probe, one]);
        let mut state = State::new(&model);
        let mut near_edges = 0;
        let mut proximity = Proximity::new(&model, Limits { depth: 2e-3, ..Limits::default() });
        for round in 0..20u64 {
            for node in 0..model.bodies()[0].len() {
                let k = round * 100_000 + node as u64;
                let [a, b] = [k as usize % 4, k as usize / 4 % 4];
                let share = if k.is_multiple_of(3) { 0.0 } else { noise(k) };
                let p = corners[a].lerp(corners[b], share) + 2e-3 * noise(k + 5).powi(2) * random(k + which as u64);
                state.set_position(&model, 0, node, p);
            }
            let found = find(&mut proximity, &model, &state, 3e-3);
            for near in found.iter().filter(|n| n.body == 0) {
                let (_, p) = places(&model, &state, near);
                let exact = hull.nearest(p);
                assert!((f64::from(near.distance) - exact.distance).abs() < 3e-7, "{near:?}, and it is {exact:?}");
                if exact.distance > 1e-5 {
                    assert!(near.normal.as_dvec3().dot(exact.normal) > 0.999, "{near:?}, and it is {exact:?}");
                }
                near_edges += usize::from(near.weights.contains(&0.0));
            }
        }
        assert!(near_edges > 5000, "{near_edges}");
    }
}

#[test]
fn organs_that_overlap_or_touch_at_rest_are_free_there() {
    let meshes = [organ(1, DVec3::ZERO), organ(2, DVec3::new(24e-3, 0.0, 0.0)), organ(3, DVec3::new(0.0, 29e-3, 1e-3))];
    let model = model(&meshes);
    let mut state = State::new(&model);
    let mut proximity = Proximity::new(&model, Limits::default());
    let found = find(&mut proximity, &model, &state, 2e-3);
    assert!(found.iter().any(|n| n.distance < -1e-3) && found.iter().any(|n| n.distance > 0.0 && n.distance < 1.5e-3));
    for near in &found {
        assert!(near.distance >= near.free && near.free <= 1.5e-3, "{near:?}");
    }
    // Pushed together by 2 mm they press, by no more than that; pulled apart they do not.
    shift(&model, &mut state, 1, DVec3::new(-2e-3, 0.0, 0.0));
    let pressing = find(&mut proximity, &model, &state, 2e-3).iter().filter(|n| n.distance < n.free - 1e-6).count();
    assert!(pressing > 20, "{pressing}");
    shift(&model, &mut state, 1, DVec3::new(40e-3, 0.0, 0.0));
    let found = find(&mut proximity, &model, &state, 2e-3);
    assert!(found.iter().all(|n| n.body != 1 && n.other != 1));
}

#[test]
fn surfaces_face_outwards_and_have_their_area() {
    let mesh = organ(4, DVec3::new(0.3, -0.2, 0.1));
    let model = model(std::slice::from_ref(&mesh));
    let (boundary, _) = mesh.boundary();
    let body = &model.bodies()[0];
    let x = &State::new(&model).bodies[0].x;
    assert!((body.areas.iter().sum::<f64>() - boundary.area()).abs() < 1e-9);
    let volume: f32 =
        body.surface.triangles.iter().map(|t| t.map(|i| x[i as usize])).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
    assert!((f64::from(volume) - mesh.volume()).abs() < 1e-4 * mesh.volume());
    let owned: usize = body.surface.tree.nodes.iter().map(|n| body.surface.tree.owned(n).len()).sum();
    assert_eq!(owned, boundary.vertices.len());
    assert_eq!(body.areas.iter().filter(|a| **a > 0.0).count(), owned);
}

#[test]
fn pairs_that_are_filtered_are_not_found_and_nothing_is_allocated_anew() {
    let mut model = model(&[organ(1, DVec3::ZERO), organ(2, DVec3::new(26e-3, 0.0, 0.0))]);
    let state = State::new(&model);
    let mut proximity = Proximity::new(&model, Limits::default());
    let mut found = Vec::new();
    proximity.find(&model, &state.bodies, |_, _| 2e-3, &mut found);
    let (first, at) = (found.clone(), found.as_ptr());
    proximity.find(&model, &state.bodies, |_, _| 2e-3, &mut found);
    assert!(!found.is_empty() && found == first && found.as_ptr() == at);
    model.filtered = vec![[0, 1]];
    proximity.find(&model, &state.bodies, |_, _| 2e-3, &mut found);
    assert!(found.is_empty());
}

#[test]
fn a_strip_bent_to_a_ring_meets_its_own_end_and_a_squeezed_one_nothing() {
    let edge = 2e-3;
    let strip = block([60, 3, 3], |p| edge * p);
    let model = model(&[strip]);
    let length = 60.0 * edge;
    let mut proximity = Proximity::new(&model, Limits { folds: true, ..Limits::default() });
    let mut state = State::new(&model);
    assert!(find(&mut proximity, &model, &state, 2e-3).is_empty());
    let squeeze = |state: &mut State, to: DVec3| {
        let rest = model.bodies()[0].rest_positions().to_vec();
        rest.iter().enumerate().for_each(|(i, p)| state.set_position(&model, 0, i, *p * to));
    };
    for to in [DVec3::new(0.6, 1.0, 1.0), DVec3::new(1.0, 1.0, 0.3), DVec3::new(1.3, 0.4, 1.0)] {
        squeeze(&mut state, to);
        let found = find(&mut proximity, &model, &state, 2e-3);
        assert!(found.is_empty(), "{to}: {:?}", found.first());
    }
    // A ring whose ends overlap side by side by 10 mm, 1 mm apart.
    let radius = (length - 10e-3) / std::f64::consts::TAU;
    for (i, p) in model.bodies()[0].rest_positions().to_vec().into_iter().enumerate() {
        let (sin, cos) = (p.x / radius).sin_cos();
        let r = radius + p.y;
        let aside = p.z + 7e-3 * p.x / (length - 10e-3);
        state.set_position(&model, 0, i, DVec3::new(r * cos, -r * sin, aside));
    }
    let found = find(&mut proximity, &model, &state, 2e-3);
    assert!(found.len() > 20, "{}", found.len());
    for near in &found {
        assert!(near.distance > 0.5e-3 && near.distance <= 2e-3, "{near:?}");
        let x = |i: u32| {
            let node = model.bodies()[0].internal.iter().position(|k| *k == i).unwrap();
            model.bodies()[0].rest_positions()[node].x
        };
        assert!((x(near.vertex) - x(near.triangle[0])).abs() > 0.8 * (length - 20e-3));
    }
}

#[test]
fn numbers_that_are_none_find_nothing_and_end() {
    let model = model(&[organ(1, DVec3::ZERO), organ(2, DVec3::new(26e-3, 0.0, 0.0))]);
    let mut state = State::new(&model);
    let mut proximity = Proximity::new(&model, Limits::default());
    for bad in [DVec3::NAN, DVec3::INFINITY, DVec3::splat(1e30)] {
        for node in (0..model.bodies()[0].len()).step_by(3) {
            state.set_position(&model, 0, node, bad);
        }
        let found = find(&mut proximity, &model, &state, 2e-3);
        assert!(found.iter().all(|n| n.distance.is_finite() && n.normal.is_finite()), "{bad}");
    }
}

/// The connected parts of a mesh.
fn parts(mesh: &TetMesh) -> Vec<TetMesh> {
    let mut part: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    let mut changed = true;
    while changed {
        changed = false;
        for tet in &mesh.tets {
            let least = tet.iter().map(|i| part[*i as usize]).min().unwrap();
            changed |= tet.iter().any(|i| part[*i as usize] != least);
            tet.iter().for_each(|i| part[*i as usize] = least);
        }
    }
    let mut names = part.clone();
    names.sort_unstable();
    names.dedup();
    let one = |name: &u32| {
        let nodes: Vec<u32> = (0..part.len() as u32).filter(|i| part[*i as usize] == *name).collect();
        let number = |i: u32| nodes.binary_search(&i).unwrap() as u32;
        let tets = mesh.tets.iter().filter(|t| part[t[0] as usize] == *name).map(|t| t.map(number)).collect();
        TetMesh { vertices: nodes.iter().map(|i| mesh.vertices[*i as usize]).collect(), tets }
    };
    names.iter().map(one).collect()
}

/// `cargo test --release -p trocar-tissue time_of_specimen -- --ignored --nocapture`
#[test]
#[ignore = "a timing; holds to nothing"]
fn time_of_specimen_a() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/peers/meshes/specimen_a.msh");
    if !path.exists() {
        println!("skipped: there is no {}", path.display());
        return;
    }
    let meshes = parts(&read_msh(&path).unwrap());
    let model = model(&meshes);
    let triangles: usize = model.bodies().iter().map(|b| b.surface.triangles.len()).sum();
    println!(
        "{} bodies, {} nodes, {triangles} triangles",
        meshes.len(),
        meshes.iter().map(|m| m.vertices.len()).sum::<usize>()
    );
    // They lie apart in the file: each goes towards the middle until it has others within reach.
    let middle =
        |state: &State, k: usize| state.positions(&model, k).iter().sum::<DVec3>() / model.bodies()[k].len() as f64;
    let gathered = |want: usize| {
        let mut state = State::new(&model);
        let whole = (0..meshes.len()).map(|k| middle(&state, k)).sum::<DVec3>() / meshes.len() as f64;
        let mut proximity = Proximity::new(&model, Limits::default());
        for _ in 0..200 {
            for k in 0..meshes.len() {
                let found = find(&mut proximity, &model, &state, 1e-3);
                if found.iter().filter(|n| n.body == k as u32).count() < want {
                    let by = 1e-3 * (whole - middle(&state, k)).normalize_or_zero();
                    shift(&model, &mut state, k, by);
                }
            }
        }
        state
    };
    for (want, folds) in [(60, false), (200, false), (60, true)] {
        let mut state = gathered(want);
        let begun = Instant::now();
        drop(Proximity::new(&model, Limits { folds, ..Limits::default() }));
        println!("{want} wanted, folds {folds}: made in {:.1} ms", begun.elapsed().as_secs_f64() * 1e3);
        for depth in [2e-3, 5e-3] {
            let mut proximity = Proximity::new(&model, Limits { folds, depth, ..Limits::default() });
            for reach in [1.5e-3, 2.5e-3] {
                let mut found = Vec::new();
                let mut times: Vec<f64> = (0..100)
                    .map(|k| {
                        let by = 1e-4 * DVec3::new((f64::from(k) * 0.1).sin(), 0.0, 0.0);
                        shift(&model, &mut state, 0, by);
                        let begun = Instant::now();
                        proximity.find(&model, &state.bodies, |_, _| reach, &mut found);
                        begun.elapsed().as_secs_f64() * 1e3
                    })
                    .collect();
                times.sort_by(f64::total_cmp);
                let inside = found.iter().filter(|n| n.distance < 0.0).count();
                println!(
                    "depth {depth}, reach {reach}: {} found, {inside} inside; {:.3} ms least, {:.3} ms median",
                    found.len(),
                    times[0],
                    times[50]
                );
            }
        }
    }
}
