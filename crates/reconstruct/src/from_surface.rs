//! Makes a specimen from a surface file instead of a recording.

use crate::body::fill_with_tets;
use crate::pipeline::program;
use crate::{Error, Result, Settings};
use glam::DVec3;
use std::path::Path;
use trocar_core::{Pose, Progress};
use trocar_geometry::io::{Unit, read_surface};
use trocar_geometry::{RepairReport, TriMesh, repair};
use trocar_specimen::{Material, Organ, Pins, Provenance, Specimen};
use xxhash_rust::xxh3::xxh3_64;

/// Makes a specimen of one organ from a surface file (a real organ model), repaired where needed; z
/// is up. The organ has the file's name; its base is its lowest end.
///
/// # Errors
/// When the file is not a surface, its size is not an organ's, or it encloses no volume.
pub fn from_surface(
    path: &Path,
    unit: Unit,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<(Specimen, RepairReport)> {
    settings.validate()?;
    progress.begin("organs", 3);
    let result = make(path, unit, settings, progress);
    progress.end();
    result
}

fn make(path: &Path, unit: Unit, settings: &Settings, progress: &dyn Progress) -> Result<(Specimen, RepairReport)> {
    let step = || {
        progress.advance(1);
        if progress.interrupted() { Err(Error::Interrupted) } else { Ok(()) }
    };
    let raw = read_surface(path, unit)?;
    let bytes = std::fs::read(path).map_err(|source| Error::Io { path: path.to_owned(), source })?;
    check_size(path, &raw, unit)?;
    step()?;
    let named = |e: trocar_geometry::Error| Error::Input { path: path.to_owned(), reason: e.to_string() };
    let (mut surface, report) = repair(&raw).map_err(named)?;
    if surface.colors.len() != surface.vertices.len() {
        surface.colors = vec![crate::TISSUE_COLOR; surface.vertices.len()];
    }
    step()?;
    let name = organ_name(path);
    let (body, facts) = fill_with_tets(&name, &surface, settings).map_err(|e| with_units(e, &surface, unit))?;
    step()?;
    let lowest = |a: &&DVec3, b: &&DVec3| a.z.total_cmp(&b.z);
    let organ = Organ {
        base: surface.vertices.iter().min_by(lowest).copied().unwrap_or_default(),
        name: name.clone(),
        body,
        surface,
        material: Material::default(),
        pins: Pins::Band { share: 0.42 },
        threads: None,
        posterior: None,
        facts,
    };
    let mut settings = settings.list();
    settings.push(format!("unit = {unit:?}"));
    let specimen = Specimen {
        name,
        up: DVec3::Z,
        placement: Pose::IDENTITY,
        camera: None,
        organs: vec![organ],
        background: None,
        provenance: Provenance {
            source: path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
            input_hash: format!("{:016x}", xxh3_64(&bytes)),
            program: program(),
            settings,
        },
    };
    Ok((specimen, report))
}

/// The values of `--units`.
const UNITS: [(&str, Unit); 3] = [("mm", Unit::Millimetre), ("cm", Unit::Centimetre), ("m", Unit::Metre)];

/// The error of a mesher with the surface's size: a surface that no element fits into often has the
/// wrong unit.
fn with_units(error: Error, surface: &TriMesh, unit: Unit) -> Error {
    match (error, surface.bounds()) {
        (Error::Organ { organ, reason }, Some((low, high))) => {
            let size = 1e3 * (high - low);
            let name = UNITS.iter().find(|(_, u)| *u == unit).map_or("mm", |(name, _)| name);
            let reason = format!(
                "{reason}; with --units {name} the surface is {:.1} x {:.1} x {:.1} mm: is the unit right?",
                size.x, size.y, size.z
            );
            Error::Organ { organ, reason }
        }
        (error, _) => error,
    }
}

/// Refuses a surface that is too large or too small for an organ, which is usually a wrong unit.
fn check_size(path: &Path, surface: &TriMesh, unit: Unit) -> Result<()> {
    let Some((low, high)) = surface.bounds() else {
        return Err(Error::Input { path: path.to_owned(), reason: "the surface has no vertices".into() });
    };
    let metres = |unit: Unit| match unit {
        Unit::Millimetre => 1e-3,
        Unit::Centimetre => 1e-2,
        Unit::Metre => 1.0,
    };
    let extent = (high - low).max_element();
    let organ = 2e-3..=1.0;
    if organ.contains(&extent) || !extent.is_finite() {
        return Ok(());
    }
    // Of the possible units, the one that makes the most typical organ: about 10 cm.
    let oddness = |u: Unit| libm::log(extent / metres(unit) * metres(u) / 0.1).abs();
    let better = UNITS
        .into_iter()
        .filter(|(_, u)| organ.contains(&(extent / metres(unit) * metres(*u))))
        .min_by(|a, b| oddness(a.1).total_cmp(&oddness(b.1)));
    let advice = match better {
        Some((name, u)) => {
            format!("try --units {name}, which makes it {:.0} mm", 1e3 * extent / metres(unit) * metres(u))
        }
        None => "organs must be in [2 mm, 1 m]".into(),
    };
    let reason = format!("the surface is {extent:.3} m long, which is not an organ's size; {advice}");
    Err(Error::Input { path: path.to_owned(), reason })
}

/// The file's stem in characters of organ names.
fn organ_name(path: &Path) -> String {
    let stem = path.file_stem().map(|s| s.to_string_lossy().to_lowercase()).unwrap_or_default();
    let legal = |c: char| if c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' { c } else { '-' };
    let name: String = stem.chars().map(legal).take(64).collect();
    match name.trim_matches(['-', '_']) {
        "" => "organ".into(),
        name => name.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_legal() {
        for (file, name) in
            [("Bladder_half.stl", "bladder_half"), ("My Liver (2).ply", "my-liver--2"), ("ü.obj", "organ")]
        {
            assert_eq!(organ_name(Path::new(file)), name);
            assert!(trocar_specimen::check_name(name).is_ok());
        }
    }

    #[test]
    fn the_wrong_unit_is_named() {
        let box_of = |extent: f64| TriMesh { vertices: vec![DVec3::ZERO, DVec3::splat(extent)], ..TriMesh::default() };
        let error = |extent, unit| check_size(Path::new("liver.stl"), &box_of(extent), unit).unwrap_err().to_string();
        assert!(error(180.0, Unit::Metre).contains("--units mm"));
        assert!(error(0.000_18, Unit::Millimetre).contains("--units m,"));
        assert!(check_size(Path::new("liver.stl"), &box_of(0.18), Unit::Millimetre).is_ok());
    }

    /// A liver in centimetres read as millimetres has an organ's length, but no element fits into
    /// it.
    #[test]
    fn a_mesher_that_fails_names_the_unit() {
        let corners = [[0.0, 0.0, 0.0], [3e-3, 0.0, 0.0], [0.0, 2e-3, 0.0], [0.0, 0.0, 1e-3]];
        let surface = TriMesh {
            vertices: corners.map(DVec3::from_array).to_vec(),
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
            ..TriMesh::default()
        };
        let failed = fill_with_tets("liver", &surface, &Settings::default()).unwrap_err();
        let text = with_units(failed, &surface, Unit::Millimetre).to_string();
        assert!(text.contains("with --units mm the surface is 3.0 x 2.0 x 1.0 mm"), "{text}");
    }
}
