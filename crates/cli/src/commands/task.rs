//! `trocar task`.

use crate::cli::{TaskAction, Tasks as Arguments};
use crate::output;
use serde::Serialize;
use std::path::{Path, PathBuf};
use trocar_report::document::Table;
use trocar_scene::{BUILTIN_TASKS, Builtin, Definition, Scene, TaskName};
use trocar_workflow::{Error, Result};

/// The task of a new file, and a policy for it.
const TASK: &str = include_str!("../../templates/task.toml");
const POLICY: &str = include_str!("../../templates/policy.py");

/// The scene that a new file is made of.
const SCENE: &str = "cell-a";

pub fn run(arguments: &Arguments, json: bool) -> Result<()> {
    match &arguments.action {
        TaskAction::List => list(json),
        TaskAction::Show { name } => show(name, json),
        TaskAction::New { name, output } => new(name, output, json),
    }
}

#[derive(Serialize)]
struct Listed {
    name: String,
    summary: String,
    stages: Vec<String>,
}

fn list(json: bool) -> Result<()> {
    let listed = |b: &trocar_scene::BuiltinTask| -> Result<Listed> {
        let definition = b.definition()?;
        let stages = definition.stages.into_iter().map(|s| s.name).collect();
        Ok(Listed { name: b.name.name().to_owned(), summary: definition.summary, stages })
    };
    let all = BUILTIN_TASKS.iter().map(listed).collect::<Result<Vec<_>>>()?;
    output::print(json, &all, |all| {
        let line = |t: &Listed| format!("{}: {}\n    {}", t.name, t.summary, t.stages.join(", "));
        all.iter().map(line).collect::<Vec<_>>().join("\n")
    });
    Ok(())
}

fn show(name: &str, json: bool) -> Result<()> {
    if let Some(builtin) = BUILTIN_TASKS.iter().find(|b| b.name.name() == name) {
        output::print(json, &builtin.definition()?, |_| builtin.text.trim_end().to_owned());
        return Ok(());
    }
    if Builtin::named(name).is_none() && !Path::new(name).exists() {
        let known: Vec<&str> = BUILTIN_TASKS.iter().map(|b| b.name.name()).collect();
        let right = format!("name a built-in task ({}), a built-in scene or a scene file", known.join(", "));
        return Err(Error::Mismatch(format!("no task '{name}'; {right}")));
    }
    let scene = Scene::read(name)?;
    let definition = scene.task.definition()?;
    output::print(json, &definition, |d| table(&scene, d));
    Ok(())
}

/// The stages of a scene's task for people.
fn table(scene: &Scene, definition: &Definition) -> String {
    let mut lines =
        vec![format!("{} in scene '{}', for at most {} s", scene.task.name.name(), scene.name, scene.task.episode_s)];
    let rows = definition.stages.iter().map(|s| vec![s.name.clone(), s.share.to_string(), s.when.clone()]).collect();
    lines.push(Table::new(["stage", "share", "passes when"], rows).text().trim_end().to_owned());
    lines.extend(definition.aborts.iter().map(|a| format!("aborted: {} when {}", a.name, a.when)));
    lines.join("\n")
}

/// What was written.
#[derive(Serialize)]
struct New {
    scene: String,
    policy: String,
}

fn new(name: &str, folder: &Path, json: bool) -> Result<()> {
    let task = TaskName::new(name).map_err(|reason| Error::Mismatch(format!("NAME {reason}")))?;
    if !matches!(task, TaskName::Own(_)) {
        return Err(Error::Mismatch(format!("NAME is '{name}', a built-in task; choose another name")));
    }
    let text = scene_text(name);
    Scene::parse(&text, name, folder)?;
    let here = folder == Path::new(".");
    let [scene, policy] = ["toml", "py"].map(|end| -> PathBuf {
        let file = format!("{name}.{end}");
        if here { file.into() } else { folder.join(file) }
    });
    if let Some(taken) = [&scene, &policy].into_iter().find(|p| p.exists()) {
        return Err(Error::Mismatch(format!("{}: the file exists; choose another name", taken.display())));
    }
    for (path, text) in [(&scene, &text), (&policy, &POLICY.replace("TASK_NAME", name))] {
        std::fs::write(path, text).map_err(|source| Error::Io { path: path.clone(), source })?;
    }
    let new = New { scene: scene.display().to_string(), policy: policy.display().to_string() };
    output::print(json, &new, |new| {
        format!(
            "{}: a scene with your task\n{}: a policy for it\ntry: trocar episode {} --policy scripted -o {name}-run",
            new.scene, new.policy, new.scene
        )
    });
    Ok(())
}

/// The built-in scene with the template's task in the place of its own.
fn scene_text(name: &str) -> String {
    let text = Builtin::named(SCENE).map_or("", |b| b.text);
    let (head, rest) = text.split_once("\n[task]\n").unwrap_or((text, ""));
    let tail = rest.split_once("\n[safety]\n").map_or("", |(_, tail)| tail);
    let head = head.replace(&format!("name = \"{SCENE}\""), &format!("name = \"{name}\""));
    format!("{head}\n{}\n[safety]\n{tail}", TASK.replace("TASK_NAME", name))
}
