//! What meshing costs: signed distances of a surface, an isosurface, and the lattice mesher.
//! `cargo bench -p trocar-geometry`.

#![allow(clippy::unwrap_used, reason = "a benchmark stops at the first error")]

use divan::Bencher;
use glam::DVec3;
use trocar_geometry::{Grid, LatticeMesher, MeshDistance, SignedDistance, TriMesh, isosurface, sample_distance};

fn main() {
    divan::main();
}

/// A bent tube of radius 5 mm, about 80 mm long.
struct Tube;

impl SignedDistance for Tube {
    fn distance(&self, p: DVec3) -> f64 {
        let angle = p.y.atan2(p.x).clamp(0.0, 2.0);
        p.distance(0.04 * DVec3::new(angle.cos(), angle.sin(), 0.0)) - 0.005
    }
}

const BOUNDS: (DVec3, DVec3) = (DVec3::new(-0.024, -0.006, -0.006), DVec3::new(0.046, 0.046, 0.006));

fn surface() -> TriMesh {
    let grid: Grid = sample_distance(&Tube, BOUNDS, 0.0015);
    isosurface(&grid, 0.0)
}

/// The surface of the tube from a grid of 1.5 mm.
#[divan::bench]
fn extract_isosurface(bencher: Bencher<'_, '_>) {
    let grid = sample_distance(&Tube, BOUNDS, 0.0015);
    bencher.bench_local(|| isosurface(divan::black_box(&grid), 0.0));
}

/// One signed distance to a surface of some thousand triangles.
#[divan::bench]
fn distance_to_surface(bencher: Bencher<'_, '_>) {
    let distance = MeshDistance::new(&surface()).unwrap();
    bencher.bench_local(|| distance.distance(divan::black_box(DVec3::new(0.03, 0.02, 0.004))));
}

/// The tetrahedral body of the tube, with cells of the given size (mm).
#[divan::bench(args = [4.0, 3.0, 2.2])]
fn mesh_tube(bencher: Bencher<'_, '_>, cell_mm: f64) {
    let mesher = LatticeMesher::uniform(1e-3 * cell_mm);
    bencher.bench_local(|| mesher.mesh_shape(&Tube, BOUNDS).unwrap());
}
