//! Checks of the specimen, the settings of its organs, and their tissue.

use super::{Checked, Problem, join, name, number, numbers, one_of, point, problem, quaternion};
use crate::{
    BackendName, CollisionMesh, FIELD, MaterialOverride, PHANTOMS, PinEnd, PinRule, RenderMesh, Scene, ScheduleName,
    Source, SpecimenSource, Surfaces,
};
use trocar_specimen::{End, Material};

pub(super) fn check(scene: &Scene) -> Checked {
    specimen(scene)?;
    point("placement.position_m", scene.placement.position_m)?;
    quaternion("placement.rotation_wxyz", scene.placement.rotation_wxyz)?;
    for (organ, said) in &scene.organs {
        let at = format!("organ.{organ}");
        name(&at, organ)?;
        if organ == FIELD {
            return Err(problem(at, format!(" is no organ; '{FIELD}' is the ground under the organs")));
        }
        material(&join(&at, "material"), &said.material)?;
        if let Some(rule) = &said.pins {
            pins(&join(&at, "pins"), rule)?;
        }
        if let Some(rule) = &said.threads {
            rule.threads().validate().map_err(|reason| field_of(&join(&at, "threads"), &reason))?;
        }
        surfaces(&join(&at, "surfaces"), &said.surfaces, scene)?;
    }
    let t = &scene.tissue;
    numbers(
        "tissue",
        &[
            ("contact_offset_mm", t.contact_offset_mm, 0.01..=20.0),
            ("tip_rest_offset_mm", t.tip_rest_offset_mm, 0.0..=20.0),
            ("friction", t.friction, 0.0..=5.0),
            ("tear_force_n", t.tear_force_n, 0.1..=100.0),
            ("support.friction", t.support.friction, 0.0..=5.0),
        ],
    )?;
    backend(scene)
}

/// The model of the tissue, and what it cannot do.
fn backend(scene: &Scene) -> Checked {
    let t = &scene.tissue;
    if let Some(cell) = t.cell_mm {
        number("tissue.cell_mm", cell, &(1.0..=20.0))?;
    }
    match t.backend {
        BackendName::Tetrahedra => {
            for (key, given) in [("cell_mm", t.cell_mm.is_some()), ("law", t.law.is_some())] {
                if given {
                    let reason = " is for tissue.backend = 'lattice'; remove it, or set the backend";
                    return Err(problem(format!("tissue.{key}"), reason.into()));
                }
            }
        }
        BackendName::Lattice if t.schedule != ScheduleName::Fast => {
            let reason = " is for tetrahedra; a lattice has one schedule: remove it";
            return Err(problem("tissue.schedule", reason.into()));
        }
        BackendName::Lattice => {}
    }
    Ok(())
}

fn specimen(scene: &Scene) -> Checked {
    let given = &scene.specimen;
    match (given.path.is_some(), given.phantom.is_some()) {
        (true, true) => return Err(problem("specimen", " has a path and a phantom; it must have one of them".into())),
        (false, false) => {
            return Err(problem("specimen", " has neither a path nor a phantom; it must have one of them".into()));
        }
        _ => {}
    }
    if let Some(most) = given.max_elements {
        if given.path.is_some() {
            let reason = " is for phantoms; the folder of specimen.path has its meshes";
            return Err(problem("specimen.max_elements", reason.into()));
        }
        let range = SpecimenSource::MAX_ELEMENTS;
        let range = f64::from(*range.start())..=f64::from(*range.end());
        number("specimen.max_elements", f64::from(most), &range)?;
    }
    for (organ, other) in &given.swapped {
        let at = format!("specimen.swapped.{organ}");
        match SpecimenSource::labelled(other).source() {
            Some(Source::Folder(path)) if !scene.resolve(path).join("specimen.toml").is_file() => {
                let shown: String = other.chars().take(200).flat_map(char::escape_default).collect();
                let reason =
                    format!(" is '{shown}'; it must be a specimen folder, or a phantom with its seed, as phantom-a:7");
                return Err(problem(at, reason));
            }
            _ => {}
        }
    }
    match given.source() {
        Some(Source::Phantom(name, _)) => {
            one_of("specimen.phantom", name, "the phantoms are", &PHANTOMS.map(|p| p.name))
        }
        Some(Source::Folder(path)) if !scene.resolve(path).join("specimen.toml").is_file() => {
            let folder = scene.resolve(path);
            let reason =
                format!(" is {}, which is no specimen; it must be a folder with a specimen.toml", folder.display());
            Err(problem("specimen.path", reason.replace(['\n', '\r'], " ")))
        }
        _ => Ok(()),
    }
}

fn material(at: &str, said: &MaterialOverride) -> Checked {
    let fields = [
        // No tissue is softer than 100 Pa; a smaller number is most likely in kPa.
        ("young_modulus_pa", said.young_modulus_pa, 100.0..=1e9),
        ("poisson_ratio", said.poisson_ratio, 0.0..=0.4999),
        ("density_kg_m3", said.density_kg_m3, 100.0..=30_000.0),
        ("toughness_j_m2", said.toughness_j_m2, 1.0..=20_000.0),
    ];
    for (key, value, range) in fields {
        if let Some(value) = value {
            number(&join(at, key), value, &range)?;
        }
    }
    // The ranges of the specimen crate apply, too.
    said.applied_to(Material::default()).validate().map_err(|reason| field_of(at, &reason))
}

fn surfaces(at: &str, said: &Surfaces, scene: &Scene) -> Checked {
    match &said.collision {
        CollisionMesh::Elements => {}
        CollisionMesh::EdgeMm(edge) => number(&join(at, "collision.edge_mm"), *edge, &CollisionMesh::EDGE_MM)?,
        CollisionMesh::File(file) => mesh_file(&join(at, "collision.file"), file, scene)?,
    }
    match &said.render {
        RenderMesh::Skin | RenderMesh::Elements | RenderMesh::Collision => Ok(()),
        RenderMesh::File(file) => mesh_file(&join(at, "render.file"), file, scene),
    }
}

/// Checks that a mesh file is there and of a format that is read.
fn mesh_file(field: &str, file: &str, scene: &Scene) -> Checked {
    let end = file.to_ascii_lowercase();
    if ![".ply", ".stl", ".obj"].iter().any(|e| end.ends_with(e)) {
        let shown: String = file.chars().take(200).flat_map(char::escape_default).collect();
        return Err(problem(field, format!(" is '{shown}'; it must be a file that ends in .ply, .stl or .obj")));
    }
    if scene.resolve(file).is_file() {
        return Ok(());
    }
    let path = scene.resolve(file).display().to_string().replace(['\n', '\r'], " ");
    Err(problem(field, format!(" is {path}, which is no file; it must be a path from the scene file's folder")))
}

/// Converts a message of the specimen crate, "field is value; it must be ...".
fn field_of(at: &str, reason: &str) -> Problem {
    let (key, rest) = reason.split_once(' ').unwrap_or((reason, ""));
    problem(join(at, key), format!(" {rest}"))
}

fn pins(at: &str, rule: &PinRule) -> Checked {
    rule.pins(End::Base).validate().map_err(|reason| field_of(at, &reason))?;
    match *rule {
        PinRule::End { length, band_length, .. } if length + band_length > 1.0 => {
            let reason =
                format!(" has a length and a band_length of {} together; it must be at most 1", length + band_length);
            Err(problem(at, reason))
        }
        _ => Ok(()),
    }
}

/// Checks that all named organs are among `organs`, those of the specimen.
pub(crate) fn check_organs(scene: &Scene, organs: &[String]) -> Checked {
    let known: Vec<&str> = organs.iter().map(String::as_str).collect();
    for organ in scene.organs.keys() {
        one_of(&format!("organ.{organ}"), organ, "the specimen's organs are", &known)
            .map_err(|p| problem(p.field, p.reason.replacen(" is ", " names ", 1)))?;
    }
    for organ in scene.specimen.swapped.keys() {
        one_of(&format!("specimen.swapped.{organ}"), organ, "the specimen's organs are", &known)
            .map_err(|p| problem(p.field, p.reason.replacen(" is ", " names ", 1)))?;
    }
    for (k, organ) in scene.variation.swapped.iter().enumerate() {
        one_of(&format!("variation.swapped[{k}]"), organ, "the specimen's organs are", &known)?;
    }
    let mut touching = known.clone();
    touching.push(FIELD);
    for (i, pair) in scene.tissue.filtered_pairs.iter().enumerate() {
        let at = format!("tissue.filtered_pairs[{i}]");
        for (k, member) in pair.iter().enumerate() {
            one_of(&format!("{at}[{k}]"), member, "it must be one of the specimen's organs or the field", &touching)?;
        }
        if pair[0] == pair[1] && pair[0] == FIELD {
            return Err(problem(at, format!(" is '{FIELD}' twice; it must be two organs, or an organ and the field")));
        }
        let same = |other: &[String; 2]| {
            (&other[0], &other[1]) == (&pair[0], &pair[1]) || (&other[0], &other[1]) == (&pair[1], &pair[0])
        };
        if let Some(first) = scene.tissue.filtered_pairs[..i].iter().position(same) {
            return Err(problem(
                at,
                format!(" is the pair of tissue.filtered_pairs[{first}] again; remove one of them"),
            ));
        }
    }
    let far = |rule: &PinRule| matches!(rule, PinRule::End { end: PinEnd::Far, .. });
    for (organ, said) in &scene.organs {
        if said.pins.as_ref().is_some_and(far) && scene.grasping_arm().is_none() {
            let reason =
                " is 'far' (from the grasping arm), but no arm has a grasper; it must be base or tip".to_owned();
            return Err(problem(format!("organ.{organ}.pins.end"), reason));
        }
    }
    if let Ok(context) = scene.task_context() {
        let made = context.program_with(&scene.task.gates, Some(&known));
        made.map_err(|m| problem(format!("task.{}", m.field), m.reason))?;
    }
    if scene.needs_organ() {
        one_of("task.organ", &scene.task.organ, "the specimen's organs are", &known)?;
    }
    Ok(())
}
