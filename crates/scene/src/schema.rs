//! The JSON schema of scene files, for editors.

use crate::Scene;
use schemars::transform::{RecursiveTransform, Transform};
use schemars::{Schema, generate::SchemaSettings};
use serde_json::Value;

impl Scene {
    /// JSON schema (draft 7, which editors of TOML read) of a scene file. Descriptions have units,
    /// and defaults where there are any.
    pub fn json_schema() -> Value {
        let settings = SchemaSettings::draft07().with_transform(RecursiveTransform(Defaults));
        settings.into_generator().into_root_schema_for::<Self>().to_value()
    }
}

/// Says a default in the description, too: editors show descriptions and not all of them show
/// defaults.
#[derive(Clone, Debug)]
struct Defaults;

impl Transform for Defaults {
    fn transform(&mut self, schema: &mut Schema) {
        let Some(properties) = schema.get_mut("properties").and_then(Value::as_object_mut) else { return };
        for property in properties.values_mut().filter_map(Value::as_object_mut) {
            let Some(default) = property.get("default").filter(|d| !d.is_object() && !is_long(d)) else { continue };
            let said = format!("Default: {default}.");
            if let Some(Value::String(description)) = property.get_mut("description") {
                *description = format!("{description} {said}");
            }
        }
    }
}

/// Lists of tables say nothing in a line.
fn is_long(value: &Value) -> bool {
    value.as_array().is_some_and(|a| a.iter().any(Value::is_object)) || value.is_null()
}
