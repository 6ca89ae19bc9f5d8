//! Features against all points of a surface and of an axis.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and print figures")]

use super::tool_features::{Feature, find};
use crate::body::surface::Surface;
use glam::{DVec3, Vec3A};
use trocar_testing::blocks::{block, noise};

/// Steps of a grid over an edge of a triangle, and over the axis.
const STEPS: u32 = 40;

/// A block with a rough surface, its vertices (mm).
fn rough() -> (Surface, Vec<Vec3A>) {
    let mesh = block([4, 4, 2], 1.0);
    let internal: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    let rough = |(i, p): (usize, &DVec3)| {
        let by = [0, 1, 2].map(|c| noise(3 * i as u64 + c) - 0.5);
        (*p + 0.35 * DVec3::from_array(by)).as_vec3a()
    };
    (Surface::of(&mesh, &internal).0, mesh.vertices.iter().enumerate().map(rough).collect())
}

fn distance(p: Vec3A, [a, b]: [Vec3A; 2]) -> f32 {
    let along = b - a;
    let share = ((p - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    (a + share * along - p).length()
}

/// The least distance of points of a grid from the axis, with each triangle at most so far.
fn sampled(x: &[Vec3A], triangle: [u32; 3], axis: [Vec3A; 2]) -> f32 {
    let [p, q, r] = triangle.map(|i| x[i as usize]);
    let places = (0..=STEPS).flat_map(|u| (0..=STEPS - u).map(move |v| (u, v)));
    let at = |(u, v): (u32, u32)| p + (u as f32 * (q - p) + v as f32 * (r - p)) / STEPS as f32;
    places.map(|place| distance(at(place), axis)).fold(f32::INFINITY, f32::min)
}

/// Axes above the surface, at random, that do not go through it.
fn axes(surface: &Surface, x: &[Vec3A]) -> Vec<[Vec3A; 2]> {
    let place = |k: u64, low: f32, high: f32| {
        let [u, v, w] = [0, 1, 2].map(|c| noise(1000 + 3 * k + c) as f32);
        Vec3A::new(0.3 + 3.4 * u, 0.3 + 3.4 * v, low + w * (high - low))
    };
    let all = (0..120u64).map(|k| [place(2 * k, 2.2, 3.0), place(2 * k + 1, 2.2, 4.0)]);
    let clear = |axis: &[Vec3A; 2]| surface.triangles.iter().all(|t| sampled(x, *t, *axis) > 0.1);
    all.filter(clear).collect()
}

#[test]
fn the_nearest_point_of_a_surface_is_a_vertex_or_a_feature() {
    let (surface, x) = rough();
    let all: Vec<u32> = (0..surface.triangles.len() as u32).collect();
    let (mut found, mut nearest_is_feature) = (Vec::new(), 0);
    let axes = axes(&surface, &x);
    for axis in &axes {
        find(&surface, &x, &all, *axis, 1e3, &mut found);
        let of = |feature: &Feature| distance(feature.site.at(|i| x[i as usize]), *axis);
        let features = found.iter().map(of).fold(f32::INFINITY, f32::min);
        let vertices = x.iter().map(|p| distance(*p, *axis)).fold(f32::INFINITY, f32::min);
        let sampled = surface.triangles.iter().map(|t| sampled(&x, *t, *axis)).fold(f32::INFINITY, f32::min);
        let known = features.min(vertices);
        // A grid misses the minimum by a little, never the other way.
        assert!(known <= sampled + 1e-5 && known > sampled - 2e-2, "{axis:?}: {known}, {sampled} on a grid");
        nearest_is_feature += usize::from(features < vertices - 1e-3);
    }
    println!("{} axes, {nearest_is_feature} nearest to an edge or a triangle", axes.len());
    assert!(axes.len() > 40 && 2 * nearest_is_feature > axes.len());
}

#[test]
fn every_feature_is_a_minimum_and_counts_once() {
    let (surface, x) = rough();
    let all: Vec<u32> = (0..surface.triangles.len() as u32).collect();
    let (mut found, mut count) = (Vec::new(), 0);
    for axis in axes(&surface, &x) {
        find(&surface, &x, &all, axis, 1.0, &mut found);
        count += found.len();
        assert!(found.windows(2).all(|pair| pair[0].key < pair[1].key), "each once");
        for Feature { site, .. } in &found {
            let here = distance(site.at(|i| x[i as usize]), axis);
            let total: f32 = site.weights.iter().sum();
            assert!((total - 1.0).abs() < 1e-5 && here <= 1.0);
            // Along the edge, or in the triangle, no point beside it is nearer to the same part of
            // the axis.
            let on: Vec<(u32, f32)> = site.shares().collect();
            for (from, to) in on.iter().flat_map(|a| on.iter().map(move |b| (a.0, b.0))).filter(|(a, b)| a != b) {
                let beside = site.at(|i| x[i as usize]) + 0.02 * (x[to as usize] - x[from as usize]);
                let near = if on.len() == 2 { distance(beside, axis) } else { f32::INFINITY };
                assert!(near > here - 1e-4, "{near} beside {here}");
            }
        }
    }
    println!("{count} features");
    assert!(count > 200);
}
