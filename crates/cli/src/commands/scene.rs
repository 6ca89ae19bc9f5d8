//! `trocar scene`.

use crate::cli::{Scene as Arguments, SceneAction};
use crate::output;
use serde::Serialize;
use std::path::Path;
use trocar_cell::{ToolReach, check_starts, tool_reach};
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

/// The parts of a valid scene.
#[derive(Serialize)]
struct Checked {
    name: String,
    task: String,
    organs: Vec<String>,
    arms: Vec<&'static str>,
    cameras: Vec<String>,
    /// Reach of each tool; empty if the specimen must be made first.
    reach: Vec<ToolReach>,
}

#[derive(Serialize)]
struct NewScene {
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
            return Err(Error::Mismatch(format!("{}: the file exists; choose another name", path.display())));
        }
        if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty() && !f.is_dir()) {
            return Err(Error::Mismatch(format!("{}: the folder {} does not exist", path.display(), folder.display())));
        }
        std::fs::write(path, &text).map_err(|source| Error::Io { path: path.to_owned(), source })?;
    }
    let said = reach_lines(&reach, organ);
    output::print(json, &NewScene { scene, reach }, |_| match output {
        Some(path) => format!("{}: a scene with {}\n{}", path.display(), folder.display(), said.join("\n")),
        None => text.trim_end().to_owned(),
    });
    Ok(())
}

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

/// Prints a note if a tool does not reach the organ of the scene's task, because every episode
/// would time out. Prints nothing if the specimen must be made first.
pub fn note_reach(name: &str) {
    let Ok(scene) = Scene::read(name) else { return };
    let own = |_: &Source<'_>| scene.needs_organ() && scene.specimen.swapped.is_empty();
    let Some(Source::Folder(path)) = scene.specimen.source().filter(own) else { return };
    let Ok(specimen) = Specimen::read(&scene.resolve(path)) else { return };
    for missed in tool_reach(&scene, &specimen).unwrap_or_default().iter().filter(|r| !r.reaches()) {
        let (arm, organ, mm) = (missed.arm.name(), &scene.task.organ, missed.missed_mm);
        eprintln!("note: the {arm} arm misses the {organ} by {mm:.0} mm; see `trocar scene check {name}`");
    }
}

fn check(file: &str, json: bool) -> Result<()> {
    let scene = Scene::read(file)?;
    let specimen = match scene.specimen.source() {
        // Where organs of others come to lie is known when the specimen is made.
        Some(Source::Folder(path)) if scene.specimen.swapped.is_empty() => Some(Specimen::read(&scene.resolve(path))?),
        _ => None,
    };
    let reach = match &specimen {
        Some(specimen) if scene.needs_organ() => tool_reach(&scene, specimen)?,
        _ => Vec::new(),
    };
    // An organ out of reach is the reason why an arm cannot start, so it is reported first.
    if let Some(specimen) = specimen.filter(|_| reach.iter().all(ToolReach::reaches)) {
        check_starts(&scene, &specimen)?;
    }
    let organ = scene.task.organ.clone();
    let checked = Checked {
        task: scene.task.name.name().to_owned(),
        organs: scene.organ_names()?,
        arms: scene.tools().iter().map(|tool| tool.arm.name.name()).collect(),
        cameras: scene.cameras.iter().map(|c| c.name.clone()).collect(),
        name: scene.name,
        reach,
    };
    output::print(json, &checked, |c| {
        let mut rows = vec![
            match c.reach.iter().all(ToolReach::reaches) {
                true => format!("{file} is valid: scene '{}', task {}", c.name, c.task),
                false => format!("{file}: scene '{}', task {}", c.name, c.task),
            },
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
        let right = "change the placement, or make the scene by `trocar scene new SPECIMEN`";
        Err(Error::Mismatch(format!("{file}: placement: the {arm} arm misses the {organ} by {mm:.0} mm; {right}")))
    })
}
