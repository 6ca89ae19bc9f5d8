//! Published surfaces of real organs: each must become watertight and keep its volume.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::path::PathBuf;
use trocar_geometry::io::{Unit, read_msh, read_surface, write_ply};
use trocar_geometry::{MeshDistance, SignedDistance, isosurface, repair, sample_distance};

fn shared(path: &str) -> Option<PathBuf> {
    let full = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared")).join(path);
    if !full.exists() {
        println!("skipped: {} absent", full.display());
        return None;
    }
    Some(full)
}

/// File, volume by another library (cm3), relative tolerance, and whether the surface must be
/// rebuilt.
const ORGANS: [(&str, f64, f64, bool); 9] = [
    ("openhelp/Liver.stl", 1817.66, 1e-4, false),
    ("openhelp/Stomach.stl", 289.35, 1e-4, false),
    ("openhelp/Spleen.stl", 343.70, 1e-4, false),
    ("openhelp/Kidney_left.stl", 191.65, 1e-4, false),
    ("openhelp/Duodenum.stl", 92.12, 1e-4, false),
    ("openhelp/Bladder_half.stl", 179.86, 1e-4, false),
    ("lapgym_organs/grasp_lift_touch__gallbladder_visual.stl", 36.28, 0.02, false),
    ("lapgym_organs/grasp_lift_touch__liver_visual.stl", 1762.2, 0.03, true),
    ("lapgym_organs/grasp_lift_touch__liver_collision.stl", 1752.1, 0.03, true),
];

#[test]
fn every_organ_becomes_watertight_and_keeps_its_volume() {
    for (file, volume, tolerance, rebuilt) in ORGANS {
        let Some(path) = shared(&format!("data/{file}")) else { return };
        let mesh = read_surface(&path, Unit::Millimetre).unwrap();
        let (repaired, report) = repair(&mesh).unwrap_or_else(|e| panic!("{file}: {e}"));
        let got = repaired.volume() * 1e6;
        assert!(repaired.is_watertight(), "{file}");
        assert_eq!(repaired.components().1, 1, "{file}");
        assert!((got / volume - 1.0).abs() < tolerance, "{file}: {got} cm3, not {volume}");
        assert_eq!(report.rebuilt, rebuilt, "{file}");
    }
}

#[test]
fn a_liver_keeps_its_shape_through_a_grid() {
    let Some(path) = shared("data/openhelp/Liver.stl") else { return };
    let (liver, _) = repair(&read_surface(&path, Unit::Millimetre).unwrap()).unwrap();
    let field = MeshDistance::new(&liver).unwrap();
    let grid = sample_distance(&field, liver.bounds().unwrap(), 1.5e-3);
    let surface = isosurface(&grid, 0.0);
    assert!(surface.is_watertight());
    assert!((surface.largest_component().volume() / liver.volume() - 1.0).abs() < 0.005);
    let worst = surface.vertices.iter().map(|&v| field.distance(v).abs()).fold(0.0, f64::max);
    assert!(worst < 1.0e-3, "{worst}");
    // The skipped blocks are correct too.
    for n in (0..grid.values.len()).step_by(997) {
        let [nx, ny, _] = grid.dims;
        let truth = field.distance(grid.point([n % nx, n / nx % ny, n / (nx * ny)]));
        assert!(truth * f64::from(grid.values[n]) > 0.0 || truth == 0.0);
        assert!(f64::from(grid.values[n].abs()) <= truth.abs() + 1e-6);
    }
}

#[test]
fn meshes_written_by_meshio_are_read() {
    for organ in ["appendix", "bowel1", "bowel2", "bowel3", "cecum", "stomach", "specimen_a"] {
        let Some(path) = shared(&format!("peers/meshes/{organ}.msh")) else { return };
        let mesh = read_msh(&path).unwrap();
        assert!(mesh.tets.len() > 1000, "{organ}");
        assert!(mesh.vertices.iter().all(|v| v.length() < 1.0), "{organ} in metres");
    }
}

#[test]
fn a_repaired_organ_is_read_back_from_its_file() {
    let Some(path) = shared("data/openhelp/Kidney_left.stl") else { return };
    let (kidney, _) = repair(&read_surface(&path, Unit::Millimetre).unwrap()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("kidney.ply");
    write_ply(&copy, &kidney).unwrap();
    assert_eq!(read_surface(&copy, Unit::Metre).unwrap(), kidney);
}
