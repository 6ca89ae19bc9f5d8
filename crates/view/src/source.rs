//! The source of a view: a scene, a specimen, an episode, or a folder of episodes.

use crate::error::{Error, Result};
use crate::show::Show;
use crate::table::Folder;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use trocar_core::Progress;
use trocar_scene::{Scene, VariationSet};
use trocar_specimen::Specimen;
use trocar_task::{EPISODE_FILE, Episode, OneSpecimen};
use trocar_workflow::specimen_scene::{free_scene, task_organ};
use trocar_workflow::{Lift, SpecimenCache, drawn_specimens, read_episode, read_varied, scene_specimen};

/// What is shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// A scene file, or the name of a built-in scene.
    Scene(String),
    /// A specimen's folder, with ideal instruments.
    Specimen(PathBuf),
    /// An episode's file or folder.
    Episode(PathBuf),
    /// A campaign's folder.
    Campaign(PathBuf),
    /// A folder of demonstrations.
    Demonstrations(PathBuf),
}

impl Source {
    /// The source of the path or name `text`.
    pub fn of(text: &str) -> Self {
        let path = Path::new(text);
        let has = |name: &str| path.join(name).is_file();
        if has("campaign.json") {
            Self::Campaign(path.to_owned())
        } else if has(EPISODE_FILE) || path.extension().is_some_and(|e| e == "trocar") {
            Self::Episode(path.to_owned())
        } else if has("specimen.toml") {
            Self::Specimen(path.to_owned())
        } else if path.is_dir() && !crate::table::demonstrations(path).is_empty() {
            Self::Demonstrations(path.to_owned())
        } else {
            Self::Scene(text.to_owned())
        }
    }

    /// Checks without building anything that it can be shown.
    ///
    /// # Errors
    /// A path where nothing is, a folder of something else, a file that cannot be read.
    pub fn check(&self) -> Result<()> {
        match self {
            Self::Scene(name) if Path::new(name).is_dir() => Err(Error::Source(format!(
                "{name}: the folder has no specimen, episode, campaign or demonstrations; name one of those, a scene \
                 file or a built-in scene"
            ))),
            Self::Scene(name) => Ok(Scene::read(name).map(|_| ())?),
            Self::Specimen(folder) => {
                Ok(Specimen::organ_names(folder).map(|_| ()).map_err(trocar_workflow::Error::from)?)
            }
            Self::Episode(path) => Ok(read_episode(path).map(|_| ())?),
            Self::Campaign(_) | Self::Demonstrations(_) => match self.folder().and_then(|folder| folder.first()) {
                Some(_) => Ok(()),
                None => Err(Error::Source(format!("{}: has no episode", self.name()))),
            },
        }
    }

    /// Its episodes, if it is a folder of some.
    pub(crate) fn folder(&self) -> Option<Folder> {
        match self {
            Self::Campaign(path) => Some(Folder::Campaign(path.clone())),
            Self::Demonstrations(path) => Some(Folder::Demonstrations(path.clone())),
            _ => None,
        }
    }

    /// Its kind, in a word.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Scene(_) => "scene",
            Self::Specimen(_) => "specimen",
            Self::Episode(_) => "episode",
            Self::Campaign(_) => "campaign",
            Self::Demonstrations(_) => "demonstrations",
        }
    }

    /// Its path or name.
    pub fn name(&self) -> String {
        match self {
            Self::Scene(name) => name.clone(),
            Self::Specimen(path) | Self::Episode(path) | Self::Campaign(path) | Self::Demonstrations(path) => {
                path.display().to_string()
            }
        }
    }
}

/// How it is built.
#[derive(Clone, Debug)]
pub struct Building {
    /// Folder of made phantoms.
    pub phantoms: PathBuf,
    /// Worker threads, 0 for all.
    pub threads: usize,
    /// The set of factors that vary, instead of the scene's.
    pub variation: Option<VariationSet>,
}

impl Building {
    /// The live episode of a scene, at the start of `seed`.
    ///
    /// # Errors
    /// A scene that cannot be read or built; an interruption.
    pub(crate) fn scene(&self, name: &str, seed: u64, progress: &dyn Progress) -> Result<Show> {
        let scene = read_varied(name, self.variation, VariationSet::None)?;
        let specimens = SpecimenCache::new(&scene, &self.phantoms);
        specimens.make_all(&drawn_specimens(&scene, std::iter::once(seed)), progress)?;
        progress.begin("the organs settle", 0);
        let drawn = scene.draw(seed);
        let episode = Episode::begun(&scene, Box::new(specimens), self.threads, seed, drawn)?;
        progress.end();
        Show::new(episode, None, false)
    }

    /// A specimen with the instruments and the task of `trocar simulate`.
    ///
    /// # Errors
    /// A specimen that cannot be read or built.
    pub(crate) fn specimen(&self, folder: &Path, progress: &dyn Progress) -> Result<Show> {
        let specimen = Specimen::read(folder).map_err(trocar_workflow::Error::from)?;
        let organ = task_organ(&specimen, None)?;
        let scene = Lift::default().arrange(free_scene(&specimen, folder, organ, false)?)?;
        progress.begin("the organs settle", 0);
        let episode = Episode::new(&scene, &specimen, self.threads)?;
        progress.end();
        Show::new(episode, None, true)
    }

    /// An episode file.
    ///
    /// # Errors
    /// A file that is damaged, a scene or specimen that is not there.
    pub(crate) fn episode(&self, path: &Path, progress: &dyn Progress) -> Result<Show> {
        let file = read_episode(path)?;
        let scene: Scene = file.scene(None)?;
        let specimen = scene_specimen(&scene, &self.phantoms, progress)?;
        if let Some(other) = file.other(&scene, &specimen)? {
            return Err(Error::Source(format!("{}: {other}", path.display())));
        }
        progress.begin("the organs settle", 0);
        let supply = Box::new(OneSpecimen(Arc::new(specimen)));
        let episode = Episode::begun(&scene, supply, self.threads, file.header.seed, file.drawn()?)?;
        progress.end();
        Show::new(episode, Some(file), false)
    }
}
