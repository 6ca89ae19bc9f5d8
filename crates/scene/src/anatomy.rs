//! The organs of a scene: where they come from, and what is said otherwise than in the specimen.

use crate::Phantom;
use crate::surfaces::Surfaces;
use crate::tissue_preset::TissuePreset;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use trocar_specimen::{End, Material, MaterialModel, Pins, Threads};

/// Name of the ground under the organs in a filtered pair. No organ may have it.
pub const FIELD: &str = "field";

/// Energy that a cut takes for the area that it opens (J/m2), of organs for which the scene says
/// nothing: that of pig aorta and lamina propria, more than of liver. Of bowel and appendix none is
/// known (`docs/tissue-values.md`).
pub const TOUGHNESS: f64 = 300.0;

/// The specimen: a folder, or a built-in phantom. One of `path` and `phantom`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpecimenSource {
    /// Specimen folder, relative to the scene file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path: Option<String>,
    /// Built-in phantom: phantom-a, phantom-b (rabbits), phantom-c (a pig's liver and gallbladder)
    /// or phantom-d (a small liver with a folded gallbladder).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phantom: Option<String>,
    /// Seed of the phantom's anatomy.
    #[serde(default = "first_seed")]
    pub seed: u32,
    /// Approximate largest number of elements of each organ of a phantom; the reconstruction's
    /// default, 50,000, if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_elements: Option<u32>,
    /// Organs of other specimens in the place of its own: by the organ's name, a specimen folder or
    /// a phantom with its seed, as phantom-a:7.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub swapped: BTreeMap<String, String>,
}

fn first_seed() -> u32 {
    1
}

/// What a [`SpecimenSource`] names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source<'a> {
    /// A folder as the scene file names it; see [`Scene::resolve`](crate::Scene::resolve).
    Folder(&'a str),
    /// A phantom and its seed.
    Phantom(&'a str, u32),
}

impl SpecimenSource {
    /// Range of [`max_elements`](Self::max_elements).
    pub const MAX_ELEMENTS: std::ops::RangeInclusive<u32> = 1000..=1_000_000;

    /// A phantom.
    pub fn phantom(name: &str, seed: u32) -> Self {
        Self { path: None, phantom: Some(name.to_owned()), seed, max_elements: None, swapped: BTreeMap::new() }
    }

    /// A specimen folder.
    pub fn folder(path: &str) -> Self {
        let swapped = BTreeMap::new();
        Self { path: Some(path.to_owned()), phantom: None, seed: first_seed(), max_elements: None, swapped }
    }

    /// The same with at most so many elements an organ.
    #[must_use]
    pub fn with_max_elements(self, max_elements: Option<u32>) -> Self {
        Self { max_elements, ..self }
    }

    /// What it is called in results: a folder's path, or a phantom with its seed, as
    /// `phantom-a:1`, and with its largest number of elements where that is not the default, as
    /// `phantom-c:1:14000`; then the organs of others, as `phantom-a:1 with appendix of
    /// phantom-a:7`.
    pub fn label(&self) -> String {
        let organs: Vec<String> = self.organs_of_others().map(|(organ, other)| format!("{organ} of {other}")).collect();
        match organs.as_slice() {
            [] => self.own_label(),
            _ => format!("{} with {}", self.own_label(), organs.join(" and ")),
        }
    }

    /// The same without organs of others.
    pub fn own_label(&self) -> String {
        match self.source() {
            Some(Source::Folder(path)) => path.to_owned(),
            Some(Source::Phantom(name, seed)) => {
                let elements = self.max_elements.map_or_else(String::new, |most| format!(":{most}"));
                format!("{name}:{seed}{elements}")
            }
            None => String::new(),
        }
    }

    /// The specimen without organs of others.
    #[must_use]
    pub fn own(&self) -> Self {
        Self { swapped: BTreeMap::new(), ..self.clone() }
    }

    /// Organs with the labels of the specimens that they are of. One of the specimen itself is its
    /// own.
    pub fn organs_of_others(&self) -> impl Iterator<Item = (&str, &str)> {
        let own = self.own_label();
        self.swapped.iter().map(|(organ, other)| (organ.as_str(), other.as_str())).filter(move |(_, o)| *o != own)
    }

    /// What [`own_label`](Self::own_label) calls so.
    pub fn labelled(label: &str) -> Self {
        let parts: Vec<&str> = label.split(':').collect();
        let phantom = |name: &str, seed: &str| Some(Self::phantom(Phantom::named(name)?.name, seed.parse().ok()?));
        let found = match parts[..] {
            [name, seed] => phantom(name, seed),
            [name, seed, most] => {
                most.parse().ok().and_then(|most| Some(phantom(name, seed)?.with_max_elements(Some(most))))
            }
            _ => None,
        };
        found.unwrap_or_else(|| Self::folder(label))
    }

    /// What it names; the folder where both are given, `None` where neither is. A checked scene has
    /// exactly one.
    pub fn source(&self) -> Option<Source<'_>> {
        match (&self.path, &self.phantom) {
            (Some(path), _) => Some(Source::Folder(path)),
            (None, Some(name)) => Some(Source::Phantom(name, self.seed)),
            (None, None) => None,
        }
    }
}

/// Changes of the scene to an organ of the specimen.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OrganOverride {
    /// Material; other properties stay those of the specimen.
    pub material: MaterialOverride,
    /// Which nodes are held where they were recorded; the specimen's rule if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pins: Option<PinRule>,
    /// Threads that hold it besides; the specimen's if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threads: Option<ThreadRule>,
    /// What of it touches, and what of it pictures show.
    #[serde(skip_serializing_if = "Surfaces::is_default")]
    pub surfaces: Surfaces,
}

/// Parts of a material that differ from the specimen's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MaterialOverride {
    /// Measured values of a tissue, for what is left out here: appendix, liver, gallbladder,
    /// bile-duct or small-bowel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<TissuePreset>,
    /// Constitutive model.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "material_models")]
    pub model: Option<MaterialModel>,
    /// Young's modulus (Pa); soft tissue has about 12000.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub young_modulus_pa: Option<f64>,
    /// Poisson's ratio, 0 to 0.4999.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub poisson_ratio: Option<f64>,
    /// Density (kg/m3); the paper's cell has 1200.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub density_kg_m3: Option<f64>,
    /// Toughness: the energy that a cut takes for the area that it opens (J/m2); 300 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub toughness_j_m2: Option<f64>,
}

/// The models by the names that the specimen's own format gives them.
fn material_models(_: &mut SchemaGenerator) -> Schema {
    let all = [MaterialModel::StableNeoHookean, MaterialModel::StVenantKirchhoff, MaterialModel::Corotated];
    json_schema!({ "enum": all })
}

impl MaterialOverride {
    /// The specimen's `material` with the scene's changes. Toughness is no part of it.
    pub fn applied_to(&self, material: Material) -> Material {
        let preset = self.preset.map(TissuePreset::young_modulus_pa);
        Material {
            model: self.model.unwrap_or(material.model),
            young_modulus_pa: self.young_modulus_pa.or(preset).unwrap_or(material.young_modulus_pa),
            poisson_ratio: self.poisson_ratio.unwrap_or(material.poisson_ratio),
            density_kg_m3: self.density_kg_m3.unwrap_or(material.density_kg_m3),
        }
    }

    /// The toughness that the scene gives (J/m2).
    pub fn toughness(&self) -> Option<f64> {
        self.toughness_j_m2.or_else(|| self.preset?.toughness_j_m2())
    }
}

/// One end of a tubular organ, possibly one that only the cell knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PinEnd {
    /// s = 0.
    Base,
    /// s = 1.
    Tip,
    /// The end farther from the port of the arm that grasps.
    Far,
}

/// Which nodes of an organ are held where they were recorded.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "rule", rename_all = "kebab-case", deny_unknown_fields)]
pub enum PinRule {
    /// None.
    None {},
    /// The lowest share of the nodes by height.
    Band {
        /// Share of all nodes, 0 to 1; the paper's cell has 0.42.
        share: f64,
    },
    /// One end, and a band along the part next to it.
    End {
        /// Which end.
        end: PinEnd,
        /// Organ coordinate distance from that end within which every node is held, 0 to 1.
        length: f64,
        /// Organ coordinate length of the part next to the end in which the lowest nodes are held
        /// too.
        #[serde(default)]
        band_length: f64,
        /// Share of that part's nodes, lowest first.
        #[serde(default)]
        band_share: f64,
    },
}

/// Threads from the lowest nodes along a part of an organ to where these were recorded: slack up to
/// a length, and elastic beyond it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThreadRule {
    /// First organ coordinate that they hold, 0 to 1.
    pub from: f64,
    /// Last organ coordinate that they hold, above `from` and at most 1.
    pub to: f64,
    /// Length up to which they are slack (m), 0 to 0.2.
    pub slack_m: f64,
    /// Their stiffness per length of the organ (N/m2), 0 to 1e6.
    pub stiffness_n_m2: f64,
}

impl ThreadRule {
    /// Those of a specimen.
    pub fn of(threads: Threads) -> Self {
        let Threads { from, to, slack_m, stiffness_n_m2 } = threads;
        Self { from, to, slack_m, stiffness_n_m2 }
    }

    /// The specimen's threads for it.
    pub fn threads(&self) -> Threads {
        let Self { from, to, slack_m, stiffness_n_m2 } = *self;
        Threads { from, to, slack_m, stiffness_n_m2 }
    }
}

impl PinRule {
    /// The specimen's rule for it; `far` is the end farther from the port of the arm that grasps.
    pub fn pins(&self, far: End) -> Pins {
        match *self {
            Self::None {} => Pins::None,
            Self::Band { share } => Pins::Band { share },
            Self::End { end, length, band_length, band_share } => {
                let end = match end {
                    PinEnd::Base => End::Base,
                    PinEnd::Tip => End::Tip,
                    PinEnd::Far => far,
                };
                Pins::End { end, length, band_length, band_share }
            }
        }
    }
}
