//! `trocar scene`.

use crate::cli::{Scene as Arguments, SceneAction};
use crate::output;
use serde::Serialize;
use trocar_scene::{BUILTINS, Builtin, Scene};
use trocar_workflow::Result;

pub fn run(arguments: &Arguments, json: bool) -> Result<()> {
    match &arguments.action {
        SceneAction::List => list(json),
        SceneAction::Show { name, canonical } => show(name, *canonical, json)?,
        SceneAction::Check { file } => check(file, json)?,
        SceneAction::Schema => output::print(json, &Scene::json_schema(), |schema| format!("{schema:#}")),
    }
    Ok(())
}

#[derive(Serialize)]
struct Listed {
    name: &'static str,
    summary: &'static str,
}

fn list(json: bool) {
    let scenes = BUILTINS.map(|b| Listed { name: b.name, summary: b.summary });
    output::print(json, &scenes.as_slice(), |scenes| {
        scenes.iter().map(|s| format!("{}: {}", s.name, s.summary)).collect::<Vec<_>>().join("\n")
    });
}

fn show(name: &str, canonical: bool, json: bool) -> Result<()> {
    let scene = Scene::read(name)?;
    let text = match Builtin::named(name) {
        Some(builtin) if !canonical => builtin.text.to_owned(),
        _ => scene.to_toml()?,
    };
    output::print(json, &scene, |_| text.trim_end().to_owned());
    Ok(())
}

/// What a scene in order holds.
#[derive(Serialize)]
struct Checked {
    name: String,
    task: &'static str,
    organs: Vec<String>,
    arms: Vec<&'static str>,
    cameras: Vec<String>,
}

fn check(file: &str, json: bool) -> Result<()> {
    let scene = Scene::read(file)?;
    let checked = Checked {
        task: scene.task.name.name(),
        organs: scene.organ_names()?,
        arms: scene.stations().iter().map(|(arm, ..)| arm.name.name()).collect(),
        cameras: scene.cameras.iter().map(|c| c.name.clone()).collect(),
        name: scene.name,
    };
    output::print(json, &checked, |c| {
        let rows = [
            format!("{file} is in order: scene '{}', task {}", c.name, c.task),
            format!("organs   {}", c.organs.join(", ")),
            format!("arms     {}", c.arms.join(", ")),
            format!("cameras  {}", c.cameras.join(", ")),
        ];
        rows.join("\n")
    });
    Ok(())
}
