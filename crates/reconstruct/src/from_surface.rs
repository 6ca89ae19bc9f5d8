//! A specimen from a ready surface: a real organ model in place of a recording.

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

/// Makes a one-organ specimen of a ready surface (a real organ model), repaired if need be; z is up. The organ is named
/// after the file, its base is its lowest end.
///
/// # Errors
/// When the file is no surface, its size is no organ's, or it encloses no volume.
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
    let (body, facts) = fill_with_tets(&name, &surface, settings)?;
    step()?;
    let lowest = |a: &&DVec3, b: &&DVec3| a.z.total_cmp(&b.z);
    let organ = Organ {
        base: surface.vertices.iter().min_by(lowest).copied().unwrap_or_default(),
        name: name.clone(),
        body,
        surface,
        material: Material::default(),
        pins: Pins::Band { share: 0.42 },
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

/// Refuses what is too large or too small for an organ: nearly always the wrong unit.
fn check_size(path: &Path, surface: &TriMesh, unit: Unit) -> Result<()> {
    let Some((low, high)) = surface.bounds() else {
        return Err(Error::Input { path: path.to_owned(), reason: "no vertices".into() });
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
    let units = [("mm", Unit::Millimetre), ("cm", Unit::Centimetre), ("m", Unit::Metre)];
    // Of the units that would do, the one that makes the most ordinary organ: about 10 cm.
    let oddness = |u: Unit| (extent / metres(unit) * metres(u) / 0.1).ln().abs();
    let better = units
        .into_iter()
        .filter(|(_, u)| organ.contains(&(extent / metres(unit) * metres(*u))))
        .min_by(|a, b| oddness(a.1).total_cmp(&oddness(b.1)));
    let advice = match better {
        Some((name, u)) => {
            format!("try --units {name}, which makes it {:.0} mm", 1e3 * extent / metres(unit) * metres(u))
        }
        None => "organs are 2 mm to 1 m long".into(),
    };
    let reason = format!("the surface is {extent:.3} m long, which is no organ; {advice}");
    Err(Error::Input { path: path.to_owned(), reason })
}

/// The file's stem in the letters an organ's name may have.
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
}
