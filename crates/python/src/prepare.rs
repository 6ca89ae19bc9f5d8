//! From the name of a scene to an episode: the scene with what the caller changes, its specimen
//! from disk or made once and kept.

use crate::error::{evaluate, wrong};
use crate::progress::Signals;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use trocar_campaign::DEFAULT_VARIATION;
use trocar_scene::{BUILTIN_TASKS, BUILTINS, BackendName, Scene, Split, VariationSet};
use trocar_specimen::Specimen;
use trocar_workflow::{SpecimenCache, read_varied};

/// Names of the built-in scenes.
#[pyfunction]
pub fn scenes() -> Vec<&'static str> {
    BUILTINS.iter().map(|b| b.name).collect()
}

/// The split of that name.
pub fn split(name: &str) -> PyResult<Split> {
    let known = Split::ALL.map(Split::name).join(", ");
    Split::named(name).ok_or_else(|| wrong(format!("split: '{name}' is unknown; it must be one of {known}")))
}

/// The scene `name` (or file) with the set `variation`, on the tissue backend `backend`. Without a
/// set, a scene that has none varies as campaigns do. Without a backend it is the scene's.
pub fn varied(name: &str, variation: Option<&str>, backend: Option<&str>) -> PyResult<Scene> {
    let set = variation.map(|set| {
        let known = VariationSet::ALL.map(VariationSet::name).join(", ");
        let unknown = || wrong(format!("variation: '{set}' is unknown; it must be one of {known}"));
        VariationSet::named(set).ok_or_else(unknown)
    });
    let backend = backend.map(|backend| {
        let known = BackendName::ALL.map(BackendName::name).join(", ");
        let unknown = || wrong(format!("backend: '{backend}' is unknown; it must be one of {known}"));
        BackendName::named(backend).ok_or_else(unknown)
    });
    let backend = backend.transpose()?;
    let mut scene = read_varied(name, set.transpose()?, DEFAULT_VARIATION).map_err(|e| evaluate(&e))?;
    if let Some(backend) = backend {
        scene.tissue = scene.tissue.on(backend);
    }
    Ok(scene)
}

/// The same, asking for `task` where that is given and for `episode_s` seconds.
pub fn scene(
    name: &str,
    variation: Option<&str>,
    backend: Option<&str>,
    task: Option<&str>,
    episode_s: Option<f64>,
) -> PyResult<Scene> {
    let mut scene = varied(name, variation, backend)?;
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

/// The number of anatomies that the episodes of a scene in `split` draw from and that are not in
/// the folder `phantoms` yet. Each takes about a minute to make.
#[pyfunction]
#[pyo3(signature = (scene, variation, split, phantoms))]
pub fn missing_specimens(scene: &str, variation: Option<&str>, split: &str, phantoms: PathBuf) -> PyResult<usize> {
    let (scene, split) = (varied(scene, variation, None)?, self::split(split)?);
    let specimens = SpecimenCache::new(&scene, &phantoms);
    let all = scene.specimens();
    Ok(split.of_specimens(&all).iter().filter(|source| !specimens.is_made(source)).count())
}

/// The specimens of the episodes of `scene` in `split`. They are made now in the folder `phantoms`,
/// before the first episode needs one.
pub fn specimens(scene: &Scene, split: Split, phantoms: &Path) -> PyResult<SpecimenCache> {
    let specimens = SpecimenCache::new(scene, phantoms);
    let all = scene.specimens();
    specimens.make_all(split.of_specimens(&all), &Signals::new()).map_err(|e| evaluate(&e))?;
    Ok(specimens)
}

/// The same, and the specimen by which a campaign of `scene` is known.
pub fn named_specimens(scene: &Scene, split: Split, phantoms: &Path) -> PyResult<(SpecimenCache, Arc<Specimen>)> {
    let specimens = SpecimenCache::new(scene, phantoms);
    let named = trocar_campaign::named_specimen(scene, split);
    let named = specimens.read(&named, &Signals::new()).map_err(|e| evaluate(&e))?;
    Ok((specimens, named))
}
