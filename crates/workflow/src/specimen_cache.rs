//! The specimens of a scene's episodes: read from their folders, or made of phantoms and kept.

use crate::phantoms::{is_made, source_specimen};
use crate::{Result, check_interrupted};
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use trocar_core::{Progress, Quiet, Silent};
use trocar_scene::{Scene, SpecimenSource};
use trocar_specimen::Specimen;
use trocar_task::SpecimenSupply;

/// Number of specimens that are kept in memory.
const KEPT: usize = 16;

type Kept = (SpecimenSource, Arc<Specimen>);

/// The specimens of the episodes of a scene. Clones share what is in memory.
#[derive(Clone)]
pub struct SpecimenCache {
    /// The scene's folder, from which paths of specimens start.
    folder: PathBuf,
    phantoms: PathBuf,
    /// Used ones first.
    kept: Arc<Mutex<VecDeque<Kept>>>,
}

impl SpecimenCache {
    /// For `scene`; its phantoms are made once in the folder `phantoms`.
    pub fn new(scene: &Scene, phantoms: &Path) -> Self {
        Self { folder: scene.folder.clone(), phantoms: phantoms.to_owned(), kept: Arc::default() }
    }

    /// The specimen that `source` names.
    ///
    /// # Errors
    /// A specimen that cannot be read or made.
    pub fn read(&self, source: &SpecimenSource, progress: &dyn Progress) -> Result<Arc<Specimen>> {
        if let Some(kept) = self.kept(source) {
            return Ok(kept);
        }
        let made = Arc::new(source_specimen(source, &self.folder, &self.phantoms, progress)?);
        if let Ok(mut kept) = self.kept.lock() {
            kept.push_front((source.clone(), Arc::clone(&made)));
            kept.truncate(KEPT);
        }
        Ok(made)
    }

    /// Makes the missing specimens one after another, before an episode needs them.
    ///
    /// # Errors
    /// As [`read`](Self::read); an interruption.
    pub fn make_all(&self, sources: &[SpecimenSource], progress: &dyn Progress) -> Result<()> {
        match sources {
            [] => return Ok(()),
            [one] => return self.read(one, progress).map(drop),
            _ => {}
        }
        // Progress names the steps that take minutes, not those that take moments.
        let missing = sources.iter().filter(|source| !self.is_made(source)).count();
        let stage = match missing {
            0 => "specimens".to_owned(),
            n => format!("specimens ({n} new, about a minute each)"),
        };
        progress.begin(&stage, sources.len() as u64);
        for source in sources {
            check_interrupted(progress)?;
            self.read(source, &Quiet(progress))?;
            progress.advance(1);
        }
        progress.end();
        Ok(())
    }

    /// Whether the specimen that `source` names need not be made: it is a folder, or its phantom
    /// has been made.
    pub fn is_made(&self, source: &SpecimenSource) -> bool {
        is_made(source, &self.phantoms)
    }

    fn kept(&self, source: &SpecimenSource) -> Option<Arc<Specimen>> {
        let mut kept = self.kept.lock().ok()?;
        let at = kept.iter().position(|(own, _)| own == source)?;
        let found = kept.remove(at)?;
        let specimen = Arc::clone(&found.1);
        kept.push_front(found);
        Some(specimen)
    }
}

impl SpecimenSupply for SpecimenCache {
    fn get(&mut self, source: &SpecimenSource) -> trocar_task::Result<Arc<Specimen>> {
        self.read(source, &Silent).map_err(|why| trocar_task::Error::Option(why.to_string()))
    }
}

/// The specimens that are drawn for `seeds`, each once, in the order of their first use.
pub fn drawn_specimens(scene: &Scene, seeds: impl Iterator<Item = u64>) -> Vec<SpecimenSource> {
    let all = scene.specimens().len();
    let mut drawn: Vec<SpecimenSource> = Vec::new();
    for seed in seeds {
        let source = scene.draw(seed).specimen;
        if !drawn.contains(&source) {
            drawn.push(source);
        }
        if drawn.len() == all && scene.variation.swapped.is_empty() {
            break;
        }
    }
    drawn
}
