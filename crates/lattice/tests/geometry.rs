//! Lattices cut from bodies: volumes, embedding, ramification, determinism, errors.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helpers of tests may panic and tell their figures")]

use glam::{DMat3, DQuat, DVec3};
use trocar_geometry::{TetMesh, TriMesh};
use trocar_lattice::{Lattice, LatticeOptions};
use trocar_testing::blocks::{appendix, block, noise};

/// A U of two fingers, each 2 mm wide and 20 mm long, with a gap of 0.1 mm. The palm is 4 mm high.
fn fingers() -> TetMesh {
    let mut mesh = block([3, 12, 2], 2e-3);
    let middle = |mesh: &TetMesh, t: usize| mesh.corners(t).iter().sum::<DVec3>() / 4.0;
    let gap: Vec<bool> =
        (0..mesh.tets.len()).map(|t| middle(&mesh, t).y > 4e-3 && (2e-3..4e-3).contains(&middle(&mesh, t).x)).collect();
    let mut gap = gap.iter();
    mesh.tets.retain(|_| !gap.next().unwrap());
    // The middle column is squeezed to the gap.
    for p in &mut mesh.vertices {
        p.x = if p.x > 3e-3 { p.x - 1.9e-3 } else { p.x };
    }
    // Nodes that no element has left are dropped.
    let mut used: Vec<u32> = mesh.tets.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let number = |node: u32| used.binary_search(&node).unwrap() as u32;
    TetMesh {
        vertices: used.iter().map(|node| mesh.vertices[*node as usize]).collect(),
        tets: mesh.tets.iter().map(|tet| tet.map(number)).collect(),
    }
}

#[test]
fn fractions_sum_to_the_volume() {
    let organ = appendix(2.5e-3);
    for cell in [1.0e-3, 2.3e-3, 3e-3, 4e-3, 30e-3] {
        let lattice = Lattice::of_mesh(&organ, &LatticeOptions::new(cell)).unwrap();
        let error = lattice.volume() / organ.volume() - 1.0;
        let shares = lattice.shares().iter().sum::<f64>() / organ.volume() - 1.0;
        println!("{} mm: {} nodes, volume off by {error:.1e}", 1e3 * cell, lattice.nodes().len());
        assert!(error.abs() < 1e-9 && shares.abs() < 1e-9, "{error}, {shares}");
        assert!(lattice.shares().iter().all(|share| *share > 0.0));
        assert!(lattice.hexahedra().iter().all(|hex| hex.fraction > 0.0 && hex.fraction <= 1.0));
    }
}

/// The first moments of the material are those of the mesh.
#[test]
fn shares_keep_the_centroid() {
    let organ = appendix(2.5e-3);
    let volume = organ.volume();
    let centroid: DVec3 = (0..organ.tets.len())
        .map(|t| organ.tet_volume(t) / volume * organ.corners(t).iter().sum::<DVec3>() / 4.0)
        .sum();
    let lattice = Lattice::of_mesh(&organ, &LatticeOptions::new(3e-3)).unwrap();
    let shared: DVec3 = lattice.nodes().iter().zip(lattice.shares()).map(|(p, share)| *share / volume * *p).sum();
    assert!((shared - centroid).length() < 1e-9 * centroid.length());
}

/// A block that the grid fits has only full cells, one node a corner.
#[test]
fn an_aligned_block_has_full_cells() {
    let mesh = block([4, 3, 2], 3e-3);
    for (cell, cells) in [(3e-3, [4, 3, 2]), (1.5e-3, [8, 6, 4]), (1e-3, [12, 9, 6])] {
        let lattice = Lattice::of_mesh(&mesh, &LatticeOptions::new(cell)).unwrap();
        assert_eq!(lattice.hexahedra().len(), cells.iter().product::<usize>());
        assert_eq!(lattice.nodes().len(), cells.iter().map(|n| n + 1).product::<usize>());
        assert!(lattice.hexahedra().iter().all(|hex| hex.fraction == 1.0));
    }
}

/// So has one that the grid does not fit: nothing is split, and every corner is one node.
#[test]
fn a_block_across_the_grid_has_one_node_a_corner() {
    let mesh = block([12, 4, 3], 2e-3);
    let (_, size) = mesh.bounds().unwrap();
    for k in 0..60 {
        let cell = 1e-3 * (1.1 + 0.05 * k as f64);
        let below = DVec3::new(noise(k), noise(100 + k), noise(200 + k)) * cell;
        let options = LatticeOptions { origin: Some(-below), ..LatticeOptions::new(cell) };
        let lattice = Lattice::of_mesh(&mesh, &options).unwrap();
        let cells = ((size + below) / cell).ceil();
        assert_eq!(lattice.hexahedra().len() as f64, cells.element_product(), "{cell}");
        assert_eq!(lattice.nodes().len() as f64, (cells + 1.0).element_product(), "{cell}");
    }
}

#[test]
fn embedded_points_follow_affine_fields_exactly() {
    let organ = appendix(2.5e-3);
    let lattice = Lattice::of_mesh(&organ, &LatticeOptions::new(3e-3)).unwrap();
    let affine = DMat3::from_cols(DVec3::new(1.1, 0.2, -0.1), DVec3::new(-0.3, 0.8, 0.25), DVec3::new(0.05, -0.2, 1.3));
    let field: Vec<DVec3> = lattice.nodes().iter().map(|p| affine * *p + DVec3::ONE).collect();
    // Beside the organ's own nodes, points anywhere around it.
    let (low, high) = organ.bounds().unwrap();
    let number = |k: usize| noise(k as u64);
    let around =
        |k: usize| low + (high - low) * (DVec3::new(number(3 * k), number(3 * k + 1), number(3 * k + 2)) * 1.4 - 0.2);
    let points: Vec<DVec3> = (0..500).map(around).collect();
    for (points, embedded) in
        [(&organ.vertices, lattice.embed_nodes().unwrap()), (&points, lattice.embed(&points).unwrap())]
    {
        for (p, point) in points.iter().zip(&embedded) {
            assert!((point.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            assert!((point.interpolate(&field) - (affine * *p + DVec3::ONE)).length() < 1e-12);
        }
    }
    // The organ's own nodes lie inside their cells.
    let own = lattice.embed_nodes().unwrap();
    assert!(own.iter().flat_map(|point| point.weights).all(|w| (-1e-6..=1.0 + 1e-6).contains(&w)));
}

#[test]
fn fingers_that_nearly_touch_share_no_nodes() {
    let mesh = fingers();
    for cell in [1.3e-3, 2e-3, 3e-3, 5e-3] {
        // The gap lies inside a row of cells.
        let origin = Some(DVec3::splat(2.05e-3 - 0.4 * cell));
        let lattice = Lattice::of_mesh(&mesh, &LatticeOptions { origin, ..LatticeOptions::new(cell) }).unwrap();
        assert!((lattice.volume() / mesh.volume() - 1.0).abs() < 1e-9);
        let points = lattice.embed_nodes().unwrap();
        // Nodes of hexahedra of the two fingers, a cell above the palm.
        let of = |chosen: &dyn Fn(DVec3) -> bool| {
            let above = mesh.vertices.iter().zip(&points).filter(|(p, _)| p.y > 4e-3 + 2.0 * cell && chosen(**p));
            let mut nodes: Vec<u32> = above.flat_map(|(_, point)| point.nodes).collect();
            nodes.sort_unstable();
            nodes.dedup();
            nodes
        };
        let (left, right) = (of(&|p| p.x < 2.05e-3), of(&|p| p.x > 2.05e-3));
        assert!(!left.is_empty() && !right.is_empty());
        assert!(left.iter().all(|node| right.binary_search(node).is_err()), "cells of {cell} m");
        assert!(lattice.doubled_cells() > 0, "cells of {cell} m");
        // Points beside the gap follow the finger that they are nearer to.
        let beside = [DVec3::new(2.04e-3, 0.02, 2e-3), DVec3::new(2.06e-3, 0.02, 2e-3)];
        let embedded = lattice.embed(&beside).unwrap();
        assert!(embedded[0].nodes.iter().all(|node| right.binary_search(node).is_err()));
        assert!(embedded[1].nodes.iter().all(|node| left.binary_search(node).is_err()));
    }
    // One finger alone has no doubled cells.
    let whole = Lattice::of_mesh(&block([1, 12, 2], 2e-3), &LatticeOptions::new(3e-3)).unwrap();
    assert_eq!(whole.doubled_cells(), 0);
}

/// Held nodes hold what lies between them: of a whole block points fill it evenly.
#[test]
fn held_nodes_fill_their_elements() {
    let mesh = block([2, 2, 2], 3e-3);
    let lattice = Lattice::of_mesh(&mesh, &LatticeOptions::new(1.7e-3)).unwrap();
    let rest = |points: &[trocar_lattice::EmbeddedPoint]| -> Vec<DVec3> {
        points.iter().map(|point| point.interpolate(lattice.nodes())).collect()
    };
    let side: Vec<u32> = (0..27).filter(|i| mesh.vertices[*i as usize].z < 1e-9).collect();
    let points = rest(&lattice.embed_held(&side).unwrap());
    assert!(points.len() > 80 && points.iter().all(|p| p.z.abs() < 1e-12));
    let all: Vec<u32> = (0..27).collect();
    let points = rest(&lattice.embed_held(&all).unwrap());
    for k in 0..200 {
        let at = 6e-3 * DVec3::new(noise(k), noise(300 + k), noise(600 + k));
        let nearest = points.iter().map(|p| p.distance(at)).fold(f64::INFINITY, f64::min);
        assert!(nearest < 1.7e-3 / 2.0, "{at}: {nearest}");
    }
    assert!(lattice.embed_held(&[3]).unwrap().len() == 1);
    assert!(lattice.embed_held(&[27]).unwrap_err().to_string().contains("node 27"));
}

/// The body's pieces are connected as the body is: no cell is doubled where nothing is split.
#[test]
fn the_lattice_of_a_connected_body_is_connected() {
    let organ = appendix(2.5e-3);
    for cell in [1e-3, 2.3e-3, 4e-3] {
        let lattice = Lattice::of_mesh(&organ, &LatticeOptions::new(cell)).unwrap();
        let mut part: Vec<usize> = (0..lattice.nodes().len()).collect();
        for _ in 0..part.len() {
            let before = part.clone();
            for hex in lattice.hexahedra() {
                let least = hex.nodes.iter().map(|node| part[*node as usize]).min().unwrap();
                hex.nodes.iter().for_each(|node| part[*node as usize] = least);
            }
            if part == before {
                break;
            }
        }
        assert!(part.iter().all(|p| *p == 0));
        println!("{} mm: {} nodes at {} corners", 1e3 * cell, lattice.nodes().len(), corners(&lattice));
        assert_eq!(lattice.doubled_cells(), 0);
    }
}

/// Number of grid corners that have a node.
fn corners(lattice: &Lattice) -> usize {
    let mut corners: Vec<_> = lattice.nodes().iter().map(|p| p.to_array().map(f64::to_bits)).collect();
    corners.sort_unstable();
    corners.dedup();
    corners.len()
}

/// Nothing of a convex body is split at any rotation: each corner of the grid is one node.
#[test]
fn a_turned_block_has_one_node_a_corner() {
    for k in 0..40 {
        let number = |i: u64| 6.0 * noise(10 * k + i);
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, number(0), number(1), number(2));
        let mut mesh = block([6, 4, 3], 2e-3);
        mesh.vertices.iter_mut().for_each(|p| *p = turn * *p);
        let lattice = Lattice::of_mesh(&mesh, &LatticeOptions::new(1e-3 * (0.8 + number(3)))).unwrap();
        assert_eq!((lattice.doubled_cells(), corners(&lattice)), (0, lattice.nodes().len()), "{k}");
        assert!((lattice.volume() / mesh.volume() - 1.0).abs() < 1e-9);
    }
}

#[test]
fn builds_repeat_to_the_bit() {
    let organ = appendix(2.5e-3);
    let build = || {
        let lattice = Lattice::of_mesh(&organ, &LatticeOptions::new(2.3e-3)).unwrap();
        let points = lattice.embed_nodes().unwrap();
        (format!("{:?}", lattice.hexahedra()), format!("{:?}", lattice.shares()), format!("{points:?}"))
    };
    assert_eq!(build(), build());
}

/// The filling of a surface keeps its volume within 2%.
#[test]
fn a_surface_is_filled() {
    let surface = appendix(1e-3).boundary().0;
    let lattice = Lattice::of_surface(&surface, &LatticeOptions::new(2.3e-3)).unwrap();
    let error = lattice.volume() / surface.volume() - 1.0;
    println!("the volume is off by {error:.2e}");
    assert!(error.abs() < 0.02, "{error}");
}

#[test]
fn unusable_input_is_refused() {
    let mesh = block([2, 2, 2], 3e-3);
    let refused = |mesh: &TetMesh, options: LatticeOptions, words: &[&str]| {
        let message = Lattice::of_mesh(mesh, &options).unwrap_err().to_string();
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    };
    let good = LatticeOptions::new(2e-3);
    refused(&TetMesh::default(), good, &["mesh is empty"]);
    refused(&mesh, LatticeOptions::new(f64::NAN), &["NaN mm", "[0.1, 100] mm"]);
    refused(&mesh, LatticeOptions::new(0.2), &["200 mm", "[0.1, 100] mm"]);
    refused(&mesh, LatticeOptions { fill: -1.0, ..good }, &["fill is -1"]);
    refused(&mesh, LatticeOptions { origin: Some(DVec3::NAN), ..good }, &["origin is"]);
    let large = block([1, 1, 1], 0.1);
    refused(&large, LatticeOptions::new(1e-3), &["1000000 in number", "at most 200000", "1.80 mm"]);
    let mut damaged = mesh.clone();
    damaged.vertices[3].y = f64::INFINITY;
    refused(&damaged, good, &["node 3", "finite"]);
    let mut damaged = mesh.clone();
    damaged.tets[5][2] = 99;
    refused(&damaged, good, &["element 5", "only 27"]);
    let mut damaged = mesh.clone();
    damaged.tets[4].swap(0, 1);
    refused(&damaged, good, &["element 4", "must be positive"]);

    let refused = |surface: &TriMesh, words: &str| {
        let message = Lattice::of_surface(surface, &good).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    };
    refused(&TriMesh::default(), "surface is empty");
    let mut open = mesh.boundary().0;
    open.triangles.pop();
    refused(&open, "not watertight (3 open edges)");
    let mut inward = mesh.boundary().0;
    inward.flip();
    refused(&inward, "must face outward");
}
