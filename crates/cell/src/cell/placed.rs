//! The specimen of a scene: placed in the cell frame, with the scene's materials and pins.

use super::surfaces;
use crate::{Error, Result, Surroundings};
use glam::DVec3;
use trocar_core::Pose;
use trocar_geometry::OrganAxis;
use trocar_scene::{
    BackendName, FIELD, LatticeLaw, PinEnd, PinRule, Scene, SupportKind, TOUGHNESS, Tissue, ToolContactKind,
};
use trocar_specimen::{End, Organ, Specimen};
use trocar_tissue::{Backend, BodyContact, LatticeSettings, Law, ToolContact};

/// A specimen in the cell frame, and the surroundings of its organs.
#[derive(Clone, Debug)]
pub struct Placed {
    /// All points in the cell frame, up along z; materials and pins are the scene's.
    pub specimen: Specimen,
    /// Contact, filtered pairs and the bed.
    pub surroundings: Surroundings,
    /// Height of the lowest node (m).
    pub floor: f64,
}

impl Placed {
    /// Places `specimen` as `scene` says.
    ///
    /// # Errors
    /// Names the organ of the scene that the specimen does not have, or the invalid field.
    pub fn new(scene: &Scene, specimen: &Specimen) -> Result<Self> {
        let pose = scene.placement.pose();
        let mut placed = specimen.clone();
        placed.placement = pose;
        placed.up = DVec3::Z;
        let mut collision = Vec::with_capacity(placed.organs.len());
        for organ in &mut placed.organs {
            // In the specimen's frame: where it is placed does not change its meshes.
            let mut surface = match scene.organs.get(&organ.name) {
                Some(said) => surfaces::choose(scene, organ, &said.surfaces)?,
                None => None,
            };
            surface.iter_mut().flat_map(|mesh| &mut mesh.vertices).for_each(|p| *p = pose.transform(*p));
            collision.push(surface);
            move_organ(organ, &pose);
        }
        let wrong = |field: String, reason: String| Error::Scene { scene: scene.label(), field, reason };
        let find = |field: &dyn Fn() -> String, name: &str| {
            placed.organs.iter().position(|o| o.name == name).ok_or_else(|| {
                let known: Vec<&str> = placed.organs.iter().map(|o| o.name.as_str()).collect();
                wrong(field(), format!("names organ '{name}'; the specimen has {}", known.join(", ")))
            })
        };
        let mut filtered = Vec::new();
        let mut floating = Vec::new();
        for (k, [a, b]) in scene.tissue.filtered_pairs.iter().enumerate() {
            let field = || format!("tissue.filtered_pairs[{k}]");
            match (a.as_str(), b.as_str()) {
                (FIELD, organ) | (organ, FIELD) => floating.push(find(&field, organ)?),
                (a, b) => filtered.push([find(&field, a)?, find(&field, b)?]),
            }
        }
        let mut changes = Vec::new();
        for (name, change) in &scene.organs {
            changes.push((find(&|| format!("organ.{name}"), name)?, change));
        }
        let mut toughness = vec![TOUGHNESS; placed.organs.len()];
        for (k, change) in changes {
            let far = far_end(scene, &placed.organs[k], change.pins.as_ref())?;
            let organ = &mut placed.organs[k];
            organ.material = change.material.applied_to(organ.material);
            toughness[k] = change.material.toughness().unwrap_or(TOUGHNESS);
            if let Some(rule) = &change.pins {
                organ.pins = rule.pins(far);
            }
            organ.threads = change.threads.map(|rule| rule.threads()).or(organ.threads);
        }
        let contact = BodyContact {
            offset: 1e-3 * scene.tissue.contact_offset_mm,
            friction: scene.tissue.friction,
            ..BodyContact::default()
        };
        let support = &scene.tissue.support;
        let surroundings = Surroundings {
            backend: backend(&scene.tissue),
            body_contact: Some(contact),
            tool_contact: match scene.tissue.tool_contact {
                ToolContactKind::Vertices => ToolContact::Vertices,
                ToolContactKind::Surface => ToolContact::Surface,
            },
            filtered,
            bed_friction: (support.kind == SupportKind::Imprint).then_some(support.friction),
            floating,
            mesh_correction: scene.tissue.mesh_correction,
            toughness,
            collision,
        };
        let heights = placed.organs.iter().flat_map(|o| &o.body.vertices).map(|p| p.z);
        let floor = heights.fold(f64::INFINITY, f64::min);
        Ok(Self { specimen: placed, surroundings, floor })
    }
}

fn move_organ(organ: &mut Organ, pose: &Pose) {
    let points = organ.body.vertices.iter_mut().chain(&mut organ.surface.vertices).chain([&mut organ.base]);
    for p in points {
        *p = pose.transform(*p);
    }
}

/// The solver backend of the tissue of a scene.
fn backend(tissue: &Tissue) -> Backend {
    match tissue.backend {
        BackendName::Tetrahedra => Backend::Tetrahedra,
        BackendName::Lattice => {
            let default = LatticeSettings::default();
            Backend::Lattice(LatticeSettings {
                cell: tissue.cell_mm.map_or(default.cell, |cell| 1e-3 * cell),
                law: match tissue.law.unwrap_or_default() {
                    LatticeLaw::Corotated => Law::Corotated,
                    LatticeLaw::StableNeoHookean => Law::StableNeoHookean,
                },
            })
        }
    }
}

/// The end of `organ` that is farther from the port of the arm that grasps; computed only if the
/// rule needs it.
fn far_end(scene: &Scene, organ: &Organ, rule: Option<&PinRule>) -> Result<End> {
    // For an arm without a port, its start.
    let from_port = |port: &String| scene.port(port).map(|port| port.centre_m);
    let place = scene.grasping_arm().and_then(|arm| arm.port.as_ref().map_or(arm.start.position_m, from_port));
    let (Some(PinRule::End { end: PinEnd::Far, .. }), Some(place)) = (rule, place) else { return Ok(End::Tip) };
    let axis = OrganAxis::of(&organ.body, organ.base)?;
    let from = |s: f64| axis.point_at(s).distance(place.into());
    Ok(if from(0.0) > from(1.0) { End::Base } else { End::Tip })
}
