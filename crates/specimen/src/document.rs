//! The contents of `specimen.toml`.

use crate::organ::{Material, Organ, OrganFacts, Pins, check_name};
use crate::posterior::Posterior;
use crate::specimen::{Provenance, Specimen};
use crate::threads::Threads;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use trocar_camera::Camera;
use trocar_core::Pose;
use trocar_geometry::{TetMesh, TriMesh};

/// The whole file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Document {
    name: String,
    up: [f64; 3],
    placement: Placement,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    camera: Option<Camera>,
    provenance: Provenance,
    #[serde(rename = "organ")]
    pub organs: Vec<OrganEntry>,
}

/// From the recording frame to the cell frame.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Placement {
    /// Unit quaternion, scalar first.
    rotation_wxyz: [f64; 4],
    translation_m: [f64; 3],
}

/// One organ without its meshes.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OrganEntry {
    pub name: String,
    base_m: [f64; 3],
    material: Material,
    pins: Pins,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    threads: Option<Threads>,
    facts: OrganFacts,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    posterior: Option<Posterior>,
}

impl Document {
    /// The contents for `specimen`: everything but its meshes and images.
    pub fn of(specimen: &Specimen) -> Self {
        let Pose { rotation: q, translation } = specimen.placement;
        let entry = |o: &Organ| OrganEntry {
            name: o.name.clone(),
            base_m: o.base.into(),
            material: o.material,
            pins: o.pins,
            threads: o.threads,
            posterior: o.posterior.clone(),
            facts: o.facts,
        };
        Self {
            name: specimen.name.clone(),
            up: specimen.up.into(),
            placement: Placement { rotation_wxyz: [q.w, q.x, q.y, q.z], translation_m: translation.into() },
            camera: specimen.camera,
            provenance: specimen.provenance.clone(),
            organs: specimen.organs.iter().map(entry).collect(),
        }
    }

    /// Checks every field and normalises directions. The error names the field, its value, and what
    /// would be right.
    pub fn validate(&mut self) -> Result<(), String> {
        let up = DVec3::from(self.up).try_normalize();
        self.up = up.ok_or_else(|| format!("up is {:?}; it must be a direction", self.up))?.into();
        let [w, x, y, z] = self.placement.rotation_wxyz;
        let length = DQuat::from_xyzw(x, y, z, w).length();
        if !(1.0 - 1e-6..=1.0 + 1e-6).contains(&length) {
            return Err(format!(
                "placement.rotation_wxyz has length {length}; it must be a unit quaternion, scalar first"
            ));
        }
        if self.placement.translation_m.iter().any(|t| !t.is_finite()) {
            return Err("placement.translation_m is not finite; it must be metres".into());
        }
        if let Some(camera) = &self.camera {
            camera.validate().map_err(|e| e.to_string())?;
        }
        if self.organs.is_empty() {
            return Err("there is no [[organ]]; a specimen has at least one".into());
        }
        for (i, organ) in self.organs.iter().enumerate() {
            check_name(&organ.name).map_err(|r| format!("organ[{i}].name: {r}"))?;
            let field = |r: String| format!("organ '{}': {r}", organ.name);
            if self.organs[..i].iter().any(|o| o.name == organ.name) {
                return Err(field("its name is used twice; names must be unique".into()));
            }
            if organ.base_m.iter().any(|c| !c.is_finite()) {
                return Err(field("base_m is not finite; it must be metres".into()));
            }
            organ.material.validate().map_err(|r| field(format!("material.{r}")))?;
            organ.pins.validate().map_err(|r| field(format!("pins.{r}")))?;
            if let Some(threads) = &organ.threads {
                threads.validate().map_err(|r| field(format!("threads.{r}")))?;
            }
            if let Some(posterior) = &organ.posterior {
                posterior.validate().map_err(|r| field(format!("posterior.{r}")))?;
            }
        }
        Ok(())
    }

    pub fn into_specimen(self, organs: Vec<Organ>) -> Specimen {
        let [w, x, y, z] = self.placement.rotation_wxyz;
        Specimen {
            name: self.name,
            up: self.up.into(),
            placement: Pose {
                rotation: DQuat::from_xyzw(x, y, z, w),
                translation: self.placement.translation_m.into(),
            },
            camera: self.camera,
            organs,
            background: None,
            provenance: self.provenance,
        }
    }
}

impl OrganEntry {
    pub fn organ(&self, body: TetMesh, surface: TriMesh) -> Organ {
        Organ {
            name: self.name.clone(),
            body,
            surface,
            material: self.material,
            pins: self.pins,
            threads: self.threads,
            posterior: self.posterior.clone(),
            base: self.base_m.into(),
            facts: self.facts,
        }
    }
}
