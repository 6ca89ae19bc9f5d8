//! The surfaces of an organ that touch and that are drawn, where they are not those of every organ.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::borrow::Cow;

/// Surfaces of an organ.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Surfaces {
    /// What touches instruments and other organs.
    pub collision: CollisionMesh,
    /// What pictures show.
    pub render: RenderMesh,
}

impl Surfaces {
    /// Whether they are those of an organ for which a scene says nothing.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// What of an organ touches instruments and other organs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CollisionMesh {
    /// The boundary of its elements.
    #[default]
    Elements,
    /// Its skin in triangles whose median edge is about as long (mm).
    EdgeMm(f64),
    /// A closed mesh: a .ply, .stl or .obj file, relative to the scene file, in metres and in the
    /// specimen's frame.
    File(String),
}

/// What pictures show of an organ.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RenderMesh {
    /// The skin of the specimen.
    #[default]
    Skin,
    /// The boundary of its elements, with the skin's colours.
    Elements,
    /// What touches, with the skin's colours.
    Collision,
    /// A mesh: a .ply, .stl or .obj file, relative to the scene file, in metres and in the
    /// specimen's frame. Without vertex colours it has the skin's.
    File(String),
}

impl CollisionMesh {
    /// Range of its edge (mm).
    pub const EDGE_MM: std::ops::RangeInclusive<f64> = 0.2..=50.0;
}

/// One of the `words`, or a table with one of the `keys`.
fn words_or_keys(said: &str, words: &[&str], keys: &[(&str, Value)]) -> Schema {
    let table = |(key, value): &(&str, Value)| json!({ "type": "object", "properties": { *key: value }, "required": [key], "additionalProperties": false });
    let all: Vec<Value> = [json!({ "enum": words })].into_iter().chain(keys.iter().map(table)).collect();
    json_schema!({ "description": said, "anyOf": all })
}

impl JsonSchema for CollisionMesh {
    fn schema_name() -> Cow<'static, str> {
        "CollisionMesh".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let edge = json!({
            "description": "The organ's skin in triangles whose median edge is about as long (mm).",
            "type": "number", "minimum": Self::EDGE_MM.start(), "maximum": Self::EDGE_MM.end()
        });
        let file = json!({
            "description": "A closed mesh: a .ply, .stl or .obj file, relative to the scene file, in metres and in \
                            the specimen's frame.",
            "type": "string"
        });
        let said = "What touches instruments and other organs: elements (the boundary of the elements), or a table.";
        words_or_keys(said, &["elements"], &[("edge_mm", edge), ("file", file)])
    }
}

impl JsonSchema for RenderMesh {
    fn schema_name() -> Cow<'static, str> {
        "RenderMesh".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let file = json!({
            "description": "A mesh: a .ply, .stl or .obj file, relative to the scene file, in metres and in the \
                            specimen's frame. Without vertex colours it has the skin's.",
            "type": "string"
        });
        let said = "What pictures show: skin (the specimen's), elements (the boundary of the elements), collision \
                    (what touches), or a table.";
        words_or_keys(said, &["skin", "elements", "collision"], &[("file", file)])
    }
}
