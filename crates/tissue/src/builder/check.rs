//! Checks of one body before it is laid out.

use super::BodyDescription;
use glam::DVec3;
use trocar_geometry::TetMesh;

/// Extent of a body that can be an organ or a test piece (m); anything else is a mistaken unit.
const EXTENT_RANGE: std::ops::RangeInclusive<f64> = 1e-3..=2.0;

/// Least volume of an element over that of a regular element with edges of the same root mean
/// square length: `f32` kernels know the volume ratio to a thousandth at this share.
const MIN_SHAPE_QUALITY: f64 = 1e-4;

/// Checks a body.
pub(super) fn check(body: &BodyDescription<'_>) -> Result<(), String> {
    let m = body.material;
    let within = |name: &str, value: f64, least: f64, most: f64, unit: &str| {
        if (least..=most).contains(&value) {
            Ok(())
        } else {
            Err(format!("{name} is {value} {unit}; must be in [{least}, {most}] {unit} (is the unit right?)"))
        }
    };
    within("Young's modulus", m.young_modulus, 1.0, 1e9, "Pa")?;
    within("Poisson's ratio", m.poisson_ratio, 0.0, 0.4999, "")?;
    within("density", m.density, 1.0, 30e3, "kg/m3")?;
    within("viscosity", m.viscosity, 0.0, 1e9, "Pa s")?;
    check_nodes(body.mesh)?;
    check_elements(body.mesh)?;
    for support in &body.supports {
        support.check()?;
    }
    check_pins(&body.pinned, body.mesh.vertices.len())
}

fn check_nodes(mesh: &TetMesh) -> Result<(), String> {
    if mesh.tets.is_empty() {
        return Err("the mesh has no element".to_owned());
    }
    if let Some(i) = mesh.vertices.iter().position(|v| !v.is_finite()) {
        return Err(format!("node {i} is at {}; coordinates are finite numbers", mesh.vertices[i]));
    }
    let extent = mesh.bounds().map_or(0.0, |(low, high)| (high - low).max_element());
    if !EXTENT_RANGE.contains(&extent) {
        let (least, most) = (EXTENT_RANGE.start(), EXTENT_RANGE.end());
        return Err(format!(
            "it is {extent:.3e} m long; must be in [{least}, {most}] m: coordinates are metres, so a mesh in millimetres is scaled by 0.001 as it is read \
             (`trocar reconstruct --units mm`)"
        ));
    }
    Ok(())
}

fn check_elements(mesh: &TetMesh) -> Result<(), String> {
    let nodes = mesh.vertices.len();
    let mut used = vec![false; nodes];
    for (t, tet) in mesh.tets.iter().enumerate() {
        if tet.iter().any(|i| *i as usize >= nodes) {
            return Err(format!("element {t} names nodes {tet:?}; there are {nodes}"));
        }
        let volume = mesh.tet_volume(t);
        // Below the smallest volume whose reciprocal the f32 kernels can hold there is no element
        // either.
        if !(volume > 1e-24 && volume.is_finite()) {
            return Err(format!("element {t} has a volume of {volume:.3e} m3; it must be positive"));
        }
        let regular = regular_volume(mesh.corners(t));
        if volume < MIN_SHAPE_QUALITY * regular {
            return Err(format!(
                "element {t} is flat: its volume is {:.1e} of a regular element's of its size; {MIN_SHAPE_QUALITY:.0e} is the least",
                volume / regular
            ));
        }
        tet.iter().for_each(|i| used[*i as usize] = true);
    }
    match used.iter().position(|used| !used) {
        Some(i) => Err(format!("node {i} belongs to no element")),
        None => Ok(()),
    }
}

/// Volume (m3) of the regular tetrahedron whose edges are as long as the root mean square of these.
fn regular_volume(corners: [DVec3; 4]) -> f64 {
    let mut squares = 0.0;
    for i in 0..4 {
        for j in 0..i {
            squares += corners[i].distance_squared(corners[j]);
        }
    }
    libm::pow(squares / 6.0, 1.5) / (6.0 * std::f64::consts::SQRT_2)
}

fn check_pins(pinned: &[u32], nodes: usize) -> Result<(), String> {
    let mut seen = vec![false; nodes];
    for &i in pinned {
        match seen.get_mut(i as usize) {
            None => return Err(format!("node {i} is to be pinned; there are {nodes}")),
            Some(true) => return Err(format!("node {i} is to be pinned twice; name each node once")),
            Some(seen) => *seen = true,
        }
    }
    Ok(())
}
