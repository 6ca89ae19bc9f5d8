//! Tests of the tree: against a test of all triangles, after a refit, and with degenerate meshes.

use super::node::{LEAF_BIT, NO_CHILD, ROOT, STACK_SIZE, WIDTH};
use super::{Ray, TriangleTree, build};
use fearless_simd::{Level, dispatch};
use glam::{Vec3, Vec3A};

fn noise(seed: u32) -> impl FnMut() -> f32 {
    let mut n = seed;
    move || {
        n += 1;
        crate::random::numbers([n, seed, 0, 0])[0] * 2.0 - 1.0
    }
}

fn soup(count: u32, size: f32) -> (Vec<Vec3A>, Vec<[u32; 3]>) {
    let mut r = noise(5);
    let mut positions = Vec::new();
    for _ in 0..count {
        let middle = Vec3A::new(r(), r(), r());
        positions.extend((0..3).map(|_| middle + size * Vec3A::new(r(), r(), r())));
    }
    (positions, (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect())
}

/// Moeller and Trumbore in double precision over all triangles.
fn by_hand(positions: &[Vec3A], triangles: &[[u32; 3]], ray: &Ray) -> Option<(f64, u32)> {
    let (o, d) = (Vec3::from(ray.origin).as_dvec3(), Vec3::from(ray.direction).as_dvec3());
    let mut best: Option<(f64, u32)> = None;
    for (i, t) in triangles.iter().enumerate() {
        let [a, b, c] = t.map(|v| Vec3::from(positions[v as usize]).as_dvec3());
        let p = d.cross(c - a);
        let det = (b - a).dot(p);
        let u = (o - a).dot(p) / det;
        let q = (o - a).cross(b - a);
        let (v, t) = (d.dot(q) / det, (c - a).dot(q) / det);
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && best.is_none_or(|b| t < b.0) {
            best = Some((t, i as u32));
        }
    }
    best
}

#[test]
fn first_hit_matches_brute_force_on_every_instruction_set() {
    let (positions, triangles) = soup(3000, 0.1);
    let tree = TriangleTree::new(&positions, &triangles);
    let mut r = noise(9);
    let (mut hits, mut differ) = (0, 0);
    for _ in 0..2000 {
        let ray = Ray::new(2.0 * Vec3A::new(r(), r(), r()), Vec3A::new(r(), r(), r()));
        let ours = dispatch!(Level::new(), simd => tree.first(simd, &ray, ROOT, f32::INFINITY, &mut [0; STACK_SIZE]));
        assert_eq!(
            ours,
            dispatch!(Level::baseline(), simd => tree.first(simd, &ray, ROOT, f32::INFINITY, &mut [0; STACK_SIZE]))
        );
        let theirs = by_hand(&positions, &triangles, &ray);
        let any = dispatch!(Level::new(), simd => tree.any(simd, &ray, ROOT, f32::INFINITY, &mut [0; STACK_SIZE]));
        assert_eq!(any, ours.is_some());
        match (ours, theirs) {
            (Some(a), Some(b)) if (f64::from(a.t) - b.0).abs() < 1e-5 * (1.0 + b.0) => hits += 1,
            (None, None) => {}
            _ => differ += 1,
        }
    }
    assert!(hits > 300, "{hits} rays hit");
    assert!(differ <= 2, "{differ} rays differ; only rays that graze an edge may");
}

#[test]
fn refitted_tree_equals_rebuilt_tree() {
    let (mut positions, triangles) = soup(2000, 0.05);
    let mut tree = TriangleTree::new(&positions, &triangles);
    for p in &mut positions {
        *p += 0.2 * Vec3A::new((3.0 * p.y).sin(), (2.0 * p.z).cos(), p.x * p.y);
    }
    tree.refit(&positions, &triangles);
    let rebuilt = TriangleTree::new(&positions, &triangles);
    assert_eq!(tree.bounds(), rebuilt.bounds());
    let mut r = noise(3);
    let level = Level::new();
    for _ in 0..2000 {
        let ray = Ray::new(2.0 * Vec3A::new(r(), r(), r()), Vec3A::new(r(), r(), r()));
        let hits = [&tree, &rebuilt]
            .map(|t| dispatch!(level, simd => t.first(simd, &ray, ROOT, f32::INFINITY, &mut [0; STACK_SIZE])));
        assert_eq!(hits[0], hits[1]);
    }
}

#[test]
fn degenerate_meshes_are_handled() {
    // A thousand triangles at one place, and ever smaller ones towards a point: boxes cannot
    // separate them.
    let mut positions: Vec<Vec3A> = (0..3000).map(|i| [Vec3A::X, Vec3A::Y, Vec3A::Z][i % 3]).collect();
    for i in 0..200 {
        let scale = 0.5_f32.powi(i);
        positions.extend([Vec3A::X * scale, Vec3A::Y * scale, Vec3A::splat(scale)]);
    }
    positions.extend([Vec3A::NAN, Vec3A::INFINITY, Vec3A::splat(1e38)]);
    let mut triangles: Vec<[u32; 3]> = (0..1201).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    triangles.push([0, 1, 99_999]);
    let tree = TriangleTree::new(&positions, &triangles);
    let ray = Ray::new(Vec3A::splat(-1.0), Vec3A::ONE);
    assert!(
        dispatch!(Level::new(), simd => tree.first(simd, &ray, ROOT, f32::INFINITY, &mut [0; STACK_SIZE])).is_some()
    );
    for bad in [Vec3A::ZERO, Vec3A::NAN, Vec3A::INFINITY] {
        let ray = Ray::new(bad, bad);
        let _ = dispatch!(Level::new(), simd => tree.first(simd, &ray, ROOT, f32::INFINITY, &mut [0; STACK_SIZE]));
    }
    let order: Vec<u32> = (0..1000).collect();
    let mut leaves = Vec::new();
    let nodes = build::by_order(&order, WIDTH, &mut leaves);
    let held = nodes.iter().flat_map(|n| n.child).filter(|c| *c != NO_CHILD && c & LEAF_BIT != 0).count();
    assert_eq!((held, leaves.len()), (125, 125));
    assert!(TriangleTree::new(&[], &[]).bounds().low.x > 0.0);
}
