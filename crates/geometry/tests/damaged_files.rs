//! Damaged files of every format give a mesh or an error, never a panic.

#![allow(clippy::unwrap_used)]

use std::path::Path;
use trocar_geometry::io::{Unit, read_msh, read_msh_groups, read_surface, write_msh, write_ply};
use trocar_geometry::{TetMesh, TriMesh, repair};
use trocar_testing::{Allowance, PEAK, Peak, fuzz_reader};

#[global_allocator]
static ALLOCATOR: &Peak = &PEAK;

/// The file, its text and its mesh, some of them twice while vectors grow.
const ALLOWANCE: Allowance = Allowance { fixed: 1 << 20, per_byte: 200 };

const CORNERS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
const FACES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

/// A small valid file of each kind: extension and content.
fn valid_files() -> Vec<(&'static str, Vec<u8>)> {
    let folder = tempfile::tempdir().unwrap();
    let vertices: Vec<glam::DVec3> = CORNERS.map(glam::DVec3::from_array).to_vec();
    let surface = TriMesh { vertices: vertices.clone(), triangles: FACES.to_vec(), colors: vec![[200, 100, 50]; 4] };
    let ply = folder.path().join("a.ply");
    write_ply(&ply, &surface).unwrap();
    let msh = folder.path().join("a.msh");
    write_msh(&msh, &TetMesh { vertices, tets: vec![[0, 1, 2, 3]] }).unwrap();

    let mut binary_stl = vec![0; 80];
    binary_stl.extend(4u32.to_le_bytes());
    let (mut text_stl, mut obj) = (String::from("solid organ\n"), String::new());
    let mut text_ply = String::from(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         element face 4\nproperty list uchar int vertex_indices\nend_header\n",
    );
    for c in CORNERS {
        obj += &format!("v {} {} {}\n", c[0], c[1], c[2]);
        text_ply += &format!("{} {} {}\n", c[0], c[1], c[2]);
    }
    for face in FACES {
        binary_stl.extend([0; 12]);
        text_stl += "facet normal 0 0 0\nouter loop\n";
        for c in face.map(|v| CORNERS[v as usize]) {
            binary_stl.extend(c.iter().flat_map(|&x| (x as f32).to_le_bytes()));
            text_stl += &format!("vertex {} {} {}\n", c[0], c[1], c[2]);
        }
        binary_stl.extend([0; 2]);
        text_stl += "endloop\nendfacet\n";
        obj += &format!("f {} {} {}\n", face[0] + 1, face[1] + 1, face[2] + 1);
        text_ply += &format!("3 {} {} {}\n", face[0], face[1], face[2]);
    }
    text_stl += "endsolid organ\n";
    let text_msh = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n\
        $Elements\n1\n1 4 2 0 1 1 2 3 4\n$EndElements\n";
    let grouped_msh = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 9 \"appendix\"\n$EndPhysicalNames\n\
        $Entities\n1 0 1 1\n1 0 0 0 0\n5 0 0 0 1 1 1 1 7 0\n1 0 0 0 1 1 1 1 9 1 5\n$EndEntities\n\
        $Nodes\n1 4 1 4\n3 1 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n$EndNodes\n\
        $Elements\n1 1 1 1\n3 1 4 1\n1 1 2 3 4\n$EndElements\n";
    vec![
        ("stl", binary_stl),
        ("stl", text_stl.into_bytes()),
        ("obj", obj.into_bytes()),
        ("ply", text_ply.into_bytes()),
        ("ply", std::fs::read(ply).unwrap()),
        ("msh", std::fs::read(msh).unwrap()),
        ("msh", text_msh.as_bytes().to_vec()),
        ("msh", grouped_msh.as_bytes().to_vec()),
    ]
}

fn read(path: &Path) -> Result<(), String> {
    if path.extension().is_some_and(|e| e == "msh") {
        let (whole, groups) = (read_msh(path), read_msh_groups(path));
        assert_eq!(whole.is_ok(), groups.is_ok());
        return whole.map(|_| ()).map_err(|e| e.to_string());
    }
    let mesh = read_surface(path, Unit::Metre).map_err(|e| e.to_string())?;
    assert!(mesh.vertices.iter().all(|v| v.is_finite()));
    assert!(mesh.triangles.iter().flatten().all(|&v| (v as usize) < mesh.vertices.len()));
    Ok(())
}

#[test]
fn valid_files_are_read() {
    let folder = tempfile::tempdir().unwrap();
    for (extension, bytes) in valid_files() {
        let path = folder.path().join(format!("a.{extension}"));
        std::fs::write(&path, bytes).unwrap();
        read(&path).unwrap();
        if extension != "msh" {
            let (mesh, report) = repair(&read_surface(&path, Unit::Metre).unwrap()).unwrap();
            assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-9 && !report.rebuilt);
        }
    }
}

#[test]
fn coordinates_that_are_not_finite_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let files = valid_files();
    let (mut stl, mut ply) = (files[0].1.clone(), files[4].1.clone());
    stl[84 + 50 + 12..84 + 50 + 16].copy_from_slice(&f32::NAN.to_le_bytes());
    // A vertex has three doubles and a colour.
    let body = ply.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    ply[body + 2 * 27..body + 2 * 27 + 8].copy_from_slice(&f64::INFINITY.to_le_bytes());
    for (name, bytes, vertex) in [("a.stl", stl, "vertex 3"), ("a.ply", ply, "vertex 2")] {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let message = read(&path).unwrap_err();
        assert!(message.contains(vertex) && message.contains(name), "{message}");
    }
}

#[test]
fn damage_never_panics() {
    let seeds: Vec<(String, Vec<u8>)> =
        valid_files().into_iter().enumerate().map(|(i, (ext, bytes))| (format!("{i}.{ext}"), bytes)).collect();
    let folder = tempfile::tempdir().unwrap();
    fuzz_reader(&seeds, ALLOWANCE, |name, bytes| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        if let Err(message) = read(&path) {
            assert!(message.contains(name), "the file is not in the message: {message}");
            assert!(!message.contains('\n'), "more than one line: {message}");
        }
    });
}
