//! How episodes differ: factors, each with the distribution that its value is drawn from by the
//! episode's seed, and the specimens that are drawn from.

mod apply;
mod distribution;
mod draw;
mod drawn_tissue;
mod factor;
mod sets;
mod split;
mod tissue;

pub use distribution::Distribution;
pub use draw::{Drawn, DrawnValue};
pub use drawn_tissue::DrawnTissue;
pub use factor::{Factor, Per};
pub use split::Split;
pub use tissue::TissueSource;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Error as _, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

/// Sets of factors by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum VariationSet {
    /// Nothing but what the scene itself names.
    #[default]
    None,
    /// A little of everything, one specimen.
    Easy,
    /// Another anatomy each episode; tissue, poses, friction, cameras and light within what a
    /// clinic sees.
    Standard,
    /// Wider, and ports, arms, jaws, pins and sensors besides.
    Hard,
}

impl VariationSet {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::None, Self::Easy, Self::Standard, Self::Hard];

    /// Its name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Easy => "easy",
            Self::Standard => "standard",
            Self::Hard => "hard",
        }
    }

    /// The set of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|set| set.name() == name)
    }
}

/// The specimens that an episode's one is drawn from, each as likely.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Specimens {
    /// Specimen folders, relative to the scene file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub paths: Vec<String>,
    /// Built-in phantoms.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub phantoms: Vec<String>,
    /// First and last seed of each phantom's anatomy.
    #[serde(default = "first_seeds")]
    pub seeds: [u32; 2],
}

/// Anatomies that sets draw from.
const SEEDS: [u32; 2] = [1, 8];

fn first_seeds() -> [u32; 2] {
    SEEDS
}

/// How episodes of a scene differ by their seeds.
///
/// A factor that the scene names is drawn from its distribution. All others are those of the set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Variation {
    /// The set.
    pub set: VariationSet,
    /// The specimens that are drawn from; those of the set if `None`.
    pub specimens: Option<Specimens>,
    /// Organs that come from another of the specimens.
    pub swapped: Vec<String>,
    /// Where support and tissue of organs come from.
    pub tissue: TissueSource,
    /// Distributions of single factors.
    pub factors: BTreeMap<Factor, Distribution>,
}

const SET: &str = "set";
const SPECIMEN: &str = "specimen";
const SPECIMENS: &str = "specimens";
const SWAPPED: &str = "swapped";
const TISSUE: &str = "tissue";

impl Variation {
    /// The distributions of all factors that are drawn: those of the set, and the scene's own
    /// instead where it names a factor.
    pub fn all_factors(&self) -> BTreeMap<Factor, Distribution> {
        let mut all = sets::factors(self.set);
        all.extend(self.factors.iter().map(|(factor, d)| (*factor, d.clone())));
        all
    }

    /// The starts of the instruments alone, as in the paper's cell.
    pub fn starts() -> Self {
        Self { factors: sets::starts(), ..Self::default() }
    }

    /// The same with the set `given`. Without one, a scene that has no set varies by `default`.
    pub fn chosen(&self, given: Option<VariationSet>, default: VariationSet) -> Self {
        let own = if self.set == VariationSet::None { default } else { self.set };
        Self { set: given.unwrap_or(own), ..self.clone() }
    }

    /// The largest number that is drawn for a factor; 0 where it is not drawn or never positive.
    pub(crate) fn most(&self, factor: Factor) -> f64 {
        self.all_factors().get(&factor).map_or(0.0, |d| d.range()[1].max(0.0))
    }

    /// The largest distance from 0 that is drawn for a factor; 0 where it is not drawn.
    pub(crate) fn reach(&self, factor: Factor) -> f64 {
        self.all_factors().get(&factor).map_or(0.0, |d| d.range()[0].abs().max(d.range()[1].abs()))
    }

    /// Whether episodes depend on their seed.
    pub fn varies(&self) -> bool {
        self.specimens.is_some()
            || self.tissue != TissueSource::Specimen
            || !self.swapped.is_empty()
            || self.set >= VariationSet::Standard
            || self.all_factors().values().any(Distribution::varies)
    }
}

impl Serialize for Variation {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry(SET, &self.set)?;
        if !self.swapped.is_empty() {
            map.serialize_entry(SWAPPED, &self.swapped)?;
        }
        if self.tissue != TissueSource::Specimen {
            map.serialize_entry(TISSUE, &self.tissue)?;
        }
        for (factor, distribution) in &self.factors {
            map.serialize_entry(factor.name(), distribution)?;
        }
        if let Some(specimens) = &self.specimens {
            map.serialize_entry(SPECIMENS, specimens)?;
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for Variation {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Fields;
        impl<'de> Visitor<'de> for Fields {
            type Value = Variation;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table of `set`, `specimens`, `swapped`, `tissue` and factors")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Variation, A::Error> {
                let mut variation = Variation::default();
                while let Some(key) = map.next_key::<Cow<'_, str>>()? {
                    match (key.as_ref(), Factor::named(&key)) {
                        (SET, _) => variation.set = map.next_value()?,
                        (SPECIMENS, _) => variation.specimens = Some(map.next_value()?),
                        (SWAPPED, _) => variation.swapped = map.next_value()?,
                        (TISSUE, _) => variation.tissue = map.next_value()?,
                        (_, Some(factor)) => _ = variation.factors.insert(factor, map.next_value()?),
                        (unknown, None) => return Err(A::Error::unknown_field(unknown, known())),
                    }
                }
                Ok(variation)
            }
        }
        deserializer.deserialize_map(Fields)
    }
}

/// The keys of the table.
fn known() -> &'static [&'static str] {
    static KEYS: std::sync::OnceLock<Vec<&'static str>> = std::sync::OnceLock::new();
    KEYS.get_or_init(|| [SET, SPECIMENS, SWAPPED, TISSUE].into_iter().chain(Factor::NAMES.iter().copied()).collect())
}

impl JsonSchema for Variation {
    fn schema_name() -> Cow<'static, str> {
        "Variation".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let distribution = generator.subschema_for::<Distribution>();
        let mut properties = serde_json::Map::new();
        let set = generator.subschema_for::<VariationSet>();
        let said = "Set of factors: none, easy, standard or hard.";
        properties.insert(SET.to_owned(), serde_json::json!({ "description": said, "allOf": [set] }));
        let specimens = generator.subschema_for::<Specimens>();
        let said = "The specimens that an episode's one is drawn from.";
        properties.insert(SPECIMENS.to_owned(), serde_json::json!({ "description": said, "allOf": [specimens] }));
        let said = "Organs that come from another of the specimens than the rest, each as likely.";
        let organs = generator.subschema_for::<Vec<String>>();
        properties.insert(SWAPPED.to_owned(), serde_json::json!({ "description": said, "allOf": [organs] }));
        let source = generator.subschema_for::<TissueSource>();
        let said = "Support and tissue of organs: specimen, or posterior to draw them from what lifts tell.";
        properties.insert(TISSUE.to_owned(), serde_json::json!({ "description": said, "allOf": [source] }));
        for factor in Factor::ALL {
            let one = serde_json::json!({ "description": factor.about(), "allOf": [distribution] });
            properties.insert(factor.name().to_owned(), one);
        }
        json_schema!({ "type": "object", "properties": properties, "additionalProperties": false })
    }
}
