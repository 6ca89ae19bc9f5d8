//! From the name of a scene to an episode: the scene with what the caller changes, its specimen
//! from disk or made once and kept.

use crate::error::{evaluate, wrong};
use crate::progress::Signals;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use trocar_scene::{BUILTIN_TASKS, BUILTINS, Scene};
use trocar_specimen::Specimen;
use trocar_workflow::SpecimenCache;

/// Names of the built-in scenes.
#[pyfunction]
pub fn scenes() -> Vec<&'static str> {
    BUILTINS.iter().map(|b| b.name).collect()
}

/// The scene `name` (or file), asking for `task` where that is given and for `episode_s` seconds.
pub fn scene(name: &str, task: Option<&str>, episode_s: Option<f64>) -> PyResult<Scene> {
    let mut scene = Scene::read(name).map_err(wrong)?;
    if let Some(task) = task {
        // A scene with stages of its own has one task.
        if scene.task.name.name() != task || scene.task.stages.is_empty() {
            let all = BUILTIN_TASKS.map(|b| b.name);
            scene.task.name = all.into_iter().find(|t| t.name() == task).ok_or_else(|| {
                let known: Vec<&str> = all.iter().map(|t| t.name()).collect();
                wrong(format!("task: '{task}' is unknown; {} are known", known.join(", ")))
            })?;
            (scene.task.stages, scene.task.aborts, scene.task.prompt) = (Vec::new(), Vec::new(), None);
        }
    }
    if let Some(seconds) = episode_s {
        if !(seconds > 0.0 && seconds.is_finite()) {
            return Err(wrong(format!("episode_s: is {seconds}; it must be positive")));
        }
        scene.task.episode_s = seconds;
    }
    Ok(scene)
}

/// The folder in which phantoms are kept once they are made: `$TROCAR_PHANTOMS`, or
/// `trocar/phantoms` in the user's cache.
#[pyfunction]
pub fn phantoms_folder() -> PathBuf {
    trocar_phantom::phantoms_folder()
}

/// The specimens of the episodes of `scene`. The first one is made now in the folder `phantoms`,
/// which takes seconds the first time; others when an episode has them.
pub fn specimens(scene: &Scene, phantoms: &Path) -> PyResult<SpecimenCache> {
    let specimens = SpecimenCache::new(scene, phantoms);
    specimens.read(&scene.draw(0).specimen, &Signals::new()).map_err(|e| evaluate(&e))?;
    Ok(specimens)
}

/// The same, and the specimen by which a campaign of `scene` is known.
pub fn named_specimens(scene: &Scene, phantoms: &Path) -> PyResult<(SpecimenCache, Arc<Specimen>)> {
    let specimens = SpecimenCache::new(scene, phantoms);
    let named = trocar_campaign::named_specimen(scene);
    let named = specimens.read(&named, &Signals::new()).map_err(|e| evaluate(&e))?;
    Ok((specimens, named))
}
