//! Moving pictures of some failures and successes: the episodes are replayed from their files and
//! filmed through the endoscope.

use crate::plan::Plan;
use crate::store::{Kept, Store, film_name};
use std::path::PathBuf;
use trocar_core::Progress;
use trocar_render::RenderSettings;
use trocar_scene::Scene;
use trocar_specimen::Specimen;
use trocar_task::{EPISODE_FILE, Episode, EpisodeFile};
use trocar_workflow::moving::webp;
use trocar_workflow::replayed::Replayed;
use trocar_workflow::{Error, Result};

/// Maximum numbers of failures and of successes that are filmed. The policies take turns.
const FILMED_FAILURES: usize = 4;
const FILMED_SUCCESSES: usize = 2;
/// Size of a picture [px].
pub(crate) const SIZE: [usize; 2] = [320, 180];
/// Pictures of an episode, at most.
const FRAMES: usize = 80;

/// Where the moving picture of an episode is kept.
pub(crate) fn path(store: &Store, kept: &Kept) -> PathBuf {
    store.folder().join(film_name(&kept.name, kept.index))
}

/// The failures in the order of the report: of each policy in turn, those that came least far first.
pub(crate) fn failures<'a>(plan: &Plan, kept: &'a [Kept]) -> Vec<&'a Kept> {
    in_turn(plan, kept, false)
}

/// The successes that are filmed: of each policy in turn, the first seeds.
pub(crate) fn successes<'a>(plan: &Plan, kept: &'a [Kept]) -> Vec<&'a Kept> {
    in_turn(plan, kept, true).into_iter().take(FILMED_SUCCESSES).collect()
}

/// The episodes that passed or did not, of each policy in turn, by score and then by seed.
fn in_turn<'a>(plan: &Plan, kept: &'a [Kept], passed: bool) -> Vec<&'a Kept> {
    let by_policy: Vec<Vec<&Kept>> = plan
        .policies
        .iter()
        .map(|p| {
            let mut own: Vec<&Kept> = kept.iter().filter(|k| k.name == p.name && k.summary.passed == passed).collect();
            own.sort_by(|a, b| a.summary.score.total_cmp(&b.summary.score).then(a.index.cmp(&b.index)));
            own
        })
        .collect();
    let longest = by_policy.iter().map(Vec::len).max().unwrap_or(0);
    (0..longest).flat_map(|k| by_policy.iter().filter_map(|own| own.get(k).copied()).collect::<Vec<_>>()).collect()
}

/// Films the first failures and successes that have no moving picture yet. An episode whose replay differs
/// from its file, as on another machine, is left out.
///
/// # Errors
/// A kept episode that is damaged, a picture that cannot be written, an interruption.
pub(super) fn film(
    store: &Store,
    plan: &Plan,
    kept: &[Kept],
    scene: &Scene,
    specimen: &Specimen,
    progress: &dyn Progress,
) -> Result<()> {
    let failed = failures(plan, kept).into_iter().take(FILMED_FAILURES);
    let chosen: Vec<&Kept> = failed.chain(successes(plan, kept)).filter(|k| !path(store, k).exists()).collect();
    if chosen.is_empty() || !scene.cameras.iter().any(|c| c.name == "endoscope") {
        return Ok(());
    }
    let mut episode = Episode::new(scene, specimen, 0)?;
    progress.begin("pictures", chosen.len() as u64);
    for kept in chosen {
        let path = store.episode(&kept.name, kept.index).join(EPISODE_FILE);
        let file = EpisodeFile::read(&path).map_err(|why| store.unread(kept, why))?;
        if file.header.seed != kept.seed {
            let why = format!("{EPISODE_FILE}: its seed is {}, not {}", file.header.seed, kept.seed);
            return Err(store.damaged(&kept.name, kept.index, &why));
        }
        let mut again = Replayed::begin(&mut episode, &file)?;
        let mut sight = again.sight(specimen)?;
        let every = file.steps.len().div_ceil(FRAMES).max(1);
        let mut frames = Vec::new();
        let mut see = |again: &Replayed<'_>, time_ms: i32| -> Result<()> {
            let settings = RenderSettings::Preview { shadows: false };
            let picture = sight.render(again.episode().cell(), "endoscope", SIZE, &settings)?;
            frames.push((picture.color.clone(), time_ms));
            Ok(())
        };
        while again.advance() {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
            if again.differs().is_some() {
                break;
            }
            let k = again.done() - 1;
            if k % every == 0 || k + 1 == file.steps.len() {
                see(&again, (1e3 * again.episode().time()).round() as i32)?;
            }
        }
        progress.advance(1);
        // What became another episode is no picture of this one: better none.
        if again.differs().is_some() {
            continue;
        }
        if again.done() == 0 {
            see(&again, 0)?;
        }
        store.write(&film_name(&kept.name, kept.index), &webp(&frames)?)?;
    }
    progress.end();
    Ok(())
}
