//! `trocar scene`.

use crate::cli::{Scene as Arguments, SceneAction};
use crate::output;
use serde::Serialize;
use std::path::Path;
use trocar_cell::{ToolReach, tool_reach};
use trocar_scene::{BUILTINS, Builtin, InstrumentKind, Scene, Source};
use trocar_specimen::Specimen;
use trocar_workflow::specimen_scene::{cell_scene, task_organ};
use trocar_workflow::{Error, Result};

pub fn run(arguments: &Arguments, json: bool) -> Result<()> {
    match &arguments.action {
        SceneAction::List => list(json),
        SceneAction::Show { name, canonical } => show(name, *canonical, json)?,
        SceneAction::New { specimen, organ, output } => new(specimen, organ.as_deref(), output.as_deref(), json)?,
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
    /// How near each tool comes to the task's organ; empty where the specimen has to be made first.
    reach: Vec<ToolReach>,
}

/// A scene that was made.
#[derive(Serialize)]
struct Made {
    scene: Scene,
    reach: Vec<ToolReach>,
}

fn new(folder: &Path, organ: Option<&str>, output: Option<&Path>, json: bool) -> Result<()> {
    let specimen = Specimen::read(folder)?;
    let organ = task_organ(&specimen, organ)?;
    let name = output.and_then(Path::file_stem).map_or("mine".to_owned(), |s| s.to_string_lossy().to_lowercase());
    let legal = |c: char| if c.is_ascii_alphanumeric() || c == '-' || c == '_' { c } else { '-' };
    let name: String = name.chars().map(legal).take(64).collect();
    let (scene, reach) = cell_scene(&specimen, folder, organ, &name)?;
    let text = scene.to_toml()?;
    if let Some(path) = output {
        if path.exists() {
            return Err(Error::Mismatch(format!("{}: is there already; name another file", path.display())));
        }
        std::fs::write(path, &text).map_err(|source| Error::Io { path: path.to_owned(), source })?;
    }
    let said = reach_lines(&reach, organ);
    output::print(json, &Made { scene, reach }, |_| match output {
        Some(path) => format!("{}: a scene around {}\n{}", path.display(), folder.display(), said.join("\n")),
        None => text.trim_end().to_owned(),
    });
    Ok(())
}

/// One line a tool.
fn reach_lines(reach: &[ToolReach], organ: &str) -> Vec<String> {
    let line = |r: &ToolReach| {
        let (arm, kind) = (r.arm.name(), if r.kind == InstrumentKind::Grasper { "grasper" } else { "cutter" });
        match r.reaches() {
            true => format!("reach    the {arm} arm's {kind} reaches the {organ} (within {:.1} mm)", r.missed_mm),
            false => format!("reach    the {arm} arm's {kind} misses the {organ} by {:.0} mm", r.missed_mm),
        }
    };
    reach.iter().map(line).collect()
}

fn check(file: &str, json: bool) -> Result<()> {
    let scene = Scene::read(file)?;
    let reach = match scene.specimen.source() {
        Some(Source::Folder(path)) if scene.task.needs_organ() => {
            tool_reach(&scene, &Specimen::read(&scene.resolve(path))?)?
        }
        _ => Vec::new(),
    };
    let organ = scene.task.organ.clone();
    let checked = Checked {
        task: scene.task.name.name(),
        organs: scene.organ_names()?,
        arms: scene.tools().iter().map(|tool| tool.arm.name.name()).collect(),
        cameras: scene.cameras.iter().map(|c| c.name.clone()).collect(),
        name: scene.name,
        reach,
    };
    output::print(json, &checked, |c| {
        let mut rows = vec![
            format!("{file} is in order: scene '{}', task {}", c.name, c.task),
            format!("organs   {}", c.organs.join(", ")),
            format!("arms     {}", c.arms.join(", ")),
            format!("cameras  {}", c.cameras.join(", ")),
        ];
        rows.extend(reach_lines(&c.reach, &organ));
        rows.join("\n")
    });
    let missed = checked.reach.iter().find(|r| !r.reaches());
    missed.map_or(Ok(()), |r| {
        let (arm, mm) = (r.arm.name(), r.missed_mm);
        let right = "move the placement, or let `trocar scene new SPECIMEN` place it";
        Err(Error::Mismatch(format!("{file}: placement: the {arm} arm misses the {organ} by {mm:.0} mm; {right}")))
    })
}
