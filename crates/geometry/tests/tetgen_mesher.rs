//! The TetGen mesher: with the program where it is installed, and with scripts that replace it and
//! fail.

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

mod common;

use common::check_conforming;
use glam::DVec3;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::{Duration, Instant};
use trocar_geometry::io::{Unit, read_surface};
use trocar_geometry::{Mesher, TetMesh, TetQuality, TetgenMesher, TriMesh, repair};

/// Runs one test at a time: a script that a child process of another thread has open for writing
/// cannot be executed.
static ONE: Mutex<()> = Mutex::new(());

/// Whether the program is installed; prints a message if not.
fn installed() -> bool {
    let found = std::process::Command::new("tetgen").arg("-h").output().is_ok();
    if !found {
        println!("skipped: tetgen is not installed");
    }
    found
}

/// A box of edges `size` (m), outward.
fn cuboid(centre: DVec3, size: DVec3) -> TriMesh {
    let corner = |c: u32| DVec3::new(f64::from(c & 1), f64::from(c >> 1 & 1), f64::from(c >> 2)) - 0.5;
    let quads = [[0u32, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    TriMesh {
        vertices: (0..8).map(|c| centre + size * corner(c)).collect(),
        triangles: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        colors: Vec::new(),
    }
}

fn join(mut a: TriMesh, b: &TriMesh) -> TriMesh {
    let n = a.vertices.len() as u32;
    a.vertices.extend(&b.vertices);
    a.triangles.extend(b.triangles.iter().map(|t| t.map(|v| v + n)));
    a
}

fn brick() -> TriMesh {
    cuboid(DVec3::ZERO, DVec3::new(0.03, 0.02, 0.01))
}

fn check(mesh: &TetMesh) -> TetQuality {
    check_conforming(mesh);
    let quality = TetQuality::of(mesh);
    assert_eq!(quality.inverted, 0);
    quality
}

fn rejection(mesher: &TetgenMesher, surface: &TriMesh) -> String {
    let message = mesher.mesh(surface).unwrap_err().to_string();
    assert!(!message.contains('\n') && message.len() < 600);
    message
}

#[test]
fn a_brick_is_filled() {
    let _one = ONE.lock();
    if !installed() {
        return;
    }
    let mesher = TetgenMesher::default();
    let mesh = mesher.mesh(&brick()).unwrap();
    let quality = check(&mesh);
    assert!((quality.volume / 6e-6 - 1.0).abs() < 1e-9);
    assert!(quality.min_dihedral_deg > 9.9);
    assert!(mesher.mesh(&brick()).unwrap() == mesh);
    // Stricter settings give a finer mesh.
    let finer = TetgenMesher { radius_edge: 1.2, ..mesher }.mesh(&brick()).unwrap();
    assert!(finer.tets.len() > mesh.tets.len());
}

#[test]
fn unusable_surfaces_are_rejected() {
    let _one = ONE.lock();
    let mesher = TetgenMesher::default();
    let mut open = brick();
    open.triangles.pop();
    assert!(rejection(&mesher, &open).contains("3 open edges"));
    assert!(rejection(&mesher, &TriMesh::default()).contains("no triangles"));
    assert!(rejection(&TetgenMesher { radius_edge: f64::NAN, ..mesher.clone() }, &brick()).contains("[1, 100]"));
    if !installed() {
        return;
    }
    let crossing = join(brick(), &cuboid(DVec3::splat(0.004), DVec3::splat(0.015)));
    assert!(rejection(&mesher, &crossing).contains("intersects itself"));
    let mut hollow = cuboid(DVec3::ZERO, DVec3::splat(0.005));
    hollow.flip();
    assert!(rejection(&mesher, &join(brick(), &hollow)).contains("without cavities"));
}

#[test]
fn organs_are_filled() {
    let _one = ONE.lock();
    if !installed() {
        return;
    }
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/openhelp/Kidney_left.stl"));
    if !path.exists() {
        println!("skipped: {} absent", path.display());
        return;
    }
    let (kidney, _) = repair(&read_surface(&path, Unit::Millimetre).unwrap()).unwrap();
    let mesh = TetgenMesher::default().mesh(&kidney).unwrap();
    let quality = check(&mesh);
    assert!((quality.volume / kidney.volume() - 1.0).abs() < 1e-6);
}

#[test]
fn a_program_that_fails_gives_one_line() {
    let _one = ONE.lock();
    let folder = tempfile::tempdir().unwrap();
    let script = |body: &str| {
        let program = folder.path().join("fake");
        std::fs::write(&program, format!("#!/bin/sh\n{body}\n")).unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
        TetgenMesher { program, ..TetgenMesher::default() }
    };
    let absent = TetgenMesher { program: "no-such-program-as-this".into(), ..TetgenMesher::default() };
    assert!(rejection(&absent, &brick()).contains("apt install tetgen"));
    assert!(rejection(&script("echo 'Error: out of luck'; echo more; exit 3"), &brick()).contains("out of luck"));
    assert!(
        rejection(&script("echo 'Facet #1 intersects facet #2'; kill -9 $$"), &brick()).contains("intersects itself")
    );
    assert!(rejection(&script("exit 1"), &brick()).contains("without a message"));
    assert!(rejection(&script("true"), &brick()).contains("without a message"));
    assert!(rejection(&script("yes 'error: 0123456789' | head -c 1000000; exit 1"), &brick()).contains("0123456789"));
    assert!(
        rejection(&script("echo 5 3 0 0 > body.1.node; echo 1 4 0 > body.1.ele"), &brick()).contains("ends before")
    );
    let nodes = "printf '5 3 0 0\\n1 0 0 0\\n2 1 0 0\\n3 0 1 0\\n4 0 0 1\\n5 1 1 0\\n' > body.1.node";
    let with = |elements: &str| script(&format!("{nodes}; printf '{elements}' > body.1.ele"));
    assert!(rejection(&with("1 4 0\\n1 1 2 3 4\\n"), &brick()).contains("filled 166666.667 cm3"));
    assert!(rejection(&with("1 4 0\\n1 1 2 3 5\\n"), &brick()).contains("without volume"));
    assert!(rejection(&with("0 4 0\\n"), &brick()).contains("no elements"));

    // A correct result with an inverted element and an unused node is corrected. Switches and input
    // are as documented.
    let tet = TriMesh {
        vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
        colors: Vec::new(),
    };
    let good =
        format!("[ \"$1 $2\" = '-pq1.6/10QF body.smesh' ] || exit 1; grep -q '^4 3 0 0' body.smesh || exit 1; {nodes}");
    let mesh = script(&format!("{good}; printf '1 4 0\\n1 2 1 3 4\\n' > body.1.ele")).mesh(&tet).unwrap();
    assert_eq!((mesh.vertices.len(), mesh.inverted()), (4, 0));
    assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-12);

    let started = Instant::now();
    let slow = TetgenMesher { time_limit: Duration::from_millis(300), ..script("exec sleep 30") };
    assert!(rejection(&slow, &brick()).contains("was stopped after"));
    assert!(started.elapsed() < Duration::from_secs(5));
}
