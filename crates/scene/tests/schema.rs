//! The schema accepts the scenes, refuses what the reader refuses by form, and says units, defaults
//! and all keys; so does the users' page.
#![allow(clippy::unwrap_used, reason = "tests")]

use serde_json::Value;
use trocar_scene::{BUILTINS, Scene};

fn instance(text: &str) -> Value {
    serde_json::to_value(toml::from_str::<toml::Value>(text).unwrap()).unwrap()
}

#[test]
fn scenes_validate() {
    let validator = jsonschema::validator_for(&Scene::json_schema()).unwrap();
    for builtin in BUILTINS {
        let canonical = Scene::builtin(builtin.name).unwrap().to_toml().unwrap();
        for text in [builtin.text, &canonical] {
            let errors: Vec<String> = validator.iter_errors(&instance(text)).map(|e| e.to_string()).collect();
            assert!(errors.is_empty(), "{}: {errors:?}", builtin.name);
        }
    }
    assert!(validator.is_valid(&instance("name = 'a'\n[specimen]\nphantom = 'phantom-a'")));
    for bad in [
        "name = 'a'",
        "name = 'a'\nnam = 1\n[specimen]\nphantom = 'phantom-a'",
        "name = 'a'\n[specimen]\nphantom = 'phantom-a'\n[task]\nname = 'Appendectomy'",
        "name = 'a'\n[specimen]\nphantom = 'phantom-a'\n[rates]\ncontrol_hz = 'fast'",
        "name = 'a'\n[specimen]\nphantom = 'phantom-a'\n[organ.cecum.material]\nmodel = 'rubber'",
        "name = 'a'\n[specimen]\nphantom = 'phantom-a'\n[organ.cecum.pins]\nrule = 'band'",
        "name = 'a'\n[specimen]\nphantom = 'phantom-a'\n[organ.cecum.surfaces]\ncollision = 'skin'",
        "name = 'a'\n[specimen]\nphantom = 'phantom-a'\n[organ.cecum.surfaces]\ncollision = { edge_mm = 99 }",
        "name = 'a'\n[specimen]\nphantom = 'phantom-a'\n[organ.cecum.surfaces]\nrender = { edge_mm = 3 }",
    ] {
        assert!(!validator.is_valid(&instance(bad)), "{bad}");
        assert!(Scene::parse(bad, "bad", "".as_ref()).is_err(), "{bad}");
    }
}

/// Every key with its description, wherever it is in the schema.
fn keys(schema: &Value, found: &mut Vec<(String, String)>) {
    match schema {
        Value::Object(map) => {
            if let Some(Value::Object(properties)) = map.get("properties") {
                for (key, value) in properties {
                    let said = value.get("description").and_then(Value::as_str).unwrap_or_default();
                    found.push((key.clone(), said.to_owned()));
                }
            }
            map.values().for_each(|v| keys(v, found));
        }
        Value::Array(list) => list.iter().for_each(|v| keys(v, found)),
        _ => {}
    }
}

#[test]
fn every_key_is_explained_with_its_unit() {
    let mut found = Vec::new();
    keys(&Scene::json_schema(), &mut found);
    assert!(found.len() > 80, "{}", found.len());
    let page = include_str!("../../../docs/guides/scenes.md");
    let units = [
        ("_mm", "(mm)"),
        ("_m", "(m)"),
        ("_deg", "(degrees)"),
        ("_pa", "(Pa)"),
        ("_kg", "(kg)"),
        ("_n", "(N)"),
        ("_nm", "(N m)"),
        ("_hz", "(Hz)"),
        ("_s", "(s)"),
        ("_px", "(px)"),
    ];
    for (key, said) in &found {
        // Tags of enums have no words of their own.
        let tag = key == "rule" || (key == "kind" && said.is_empty());
        assert!(tag || !said.is_empty(), "{key} is not explained");
        for (ending, unit) in units {
            assert!(!key.ends_with(ending) || said.contains(unit), "{key} lacks {unit}: {said}");
        }
        assert!(page.contains(&format!("`{key}`")), "docs/guides/scenes.md lacks `{key}`");
    }
    let said = |key: &str| found.iter().find(|(k, _)| k == key).unwrap().1.clone();
    assert!(said("hole_diameter_mm").ends_with("Default: 6.0."), "{}", said("hole_diameter_mm"));
    assert!(said("control_hz").ends_with("Default: 30."), "{}", said("control_hz"));
}
