//! Videos of some failures and successes: the episodes are replayed from their files and rendered
//! through the endoscope.

use crate::manifest::Manifest;
use crate::store::{EpisodeRecord, Store, video_name};
use std::path::PathBuf;
use trocar_core::Progress;
use trocar_render::RenderSettings;
use trocar_scene::Scene;
use trocar_task::{EPISODE_FILE, Episode, EpisodeFile};
use trocar_workflow::episode_replay::EpisodeReplay;
use trocar_workflow::video::webp;
use trocar_workflow::{Result, SpecimenCache, check_interrupted};

/// Maximum numbers of failures and of successes with a video. The policies take turns.
const MAX_FAILURES: usize = 4;
const MAX_SUCCESSES: usize = 2;
/// Size of a video (px).
pub(crate) const SIZE: [usize; 2] = [320, 180];
/// Maximum number of frames of a video.
const MAX_FRAMES: usize = 80;

/// Path of an episode's video.
pub(crate) fn path(store: &Store, record: &EpisodeRecord) -> PathBuf {
    store.folder().join(video_name(&record.name, record.index))
}

/// The failures in the order of the report: policies in turn, lowest scores first.
pub(crate) fn failures<'a>(manifest: &Manifest, records: &'a [EpisodeRecord]) -> Vec<&'a EpisodeRecord> {
    in_turn(manifest, records, false)
}

/// The successes with a video: policies in turn, first seeds first.
pub(crate) fn successes<'a>(manifest: &Manifest, records: &'a [EpisodeRecord]) -> Vec<&'a EpisodeRecord> {
    in_turn(manifest, records, true).into_iter().take(MAX_SUCCESSES).collect()
}

/// The episodes that passed, or those that did not: policies in turn, by score and then by seed.
fn in_turn<'a>(manifest: &Manifest, records: &'a [EpisodeRecord], passed: bool) -> Vec<&'a EpisodeRecord> {
    let by_policy: Vec<Vec<&EpisodeRecord>> = manifest
        .policies
        .iter()
        .map(|p| {
            let mut own: Vec<&EpisodeRecord> =
                records.iter().filter(|k| k.name == p.name && k.summary.passed == passed).collect();
            own.sort_by(|a, b| a.summary.score.total_cmp(&b.summary.score).then(a.index.cmp(&b.index)));
            own
        })
        .collect();
    let longest = by_policy.iter().map(Vec::len).max().unwrap_or(0);
    (0..longest).flat_map(|k| by_policy.iter().filter_map(|own| own.get(k).copied()).collect::<Vec<_>>()).collect()
}

/// Renders videos of the first failures and successes that have none yet. Skips an episode whose
/// replay differs from its file, as on another machine.
pub(super) fn write(
    store: &Store,
    manifest: &Manifest,
    records: &[EpisodeRecord],
    scene: &Scene,
    specimens: &SpecimenCache,
    progress: &dyn Progress,
) -> Result<()> {
    let failed = failures(manifest, records).into_iter().take(MAX_FAILURES);
    let chosen: Vec<&EpisodeRecord> =
        failed.chain(successes(manifest, records)).filter(|k| !path(store, k).exists()).collect();
    if chosen.is_empty() || !scene.cameras.iter().any(|c| c.name == "endoscope") {
        return Ok(());
    }
    let seed = manifest.first_seed();
    let mut episode = Episode::begun(scene, Box::new(specimens.clone()), 0, seed, scene.draw(seed))?;
    progress.begin("pictures", chosen.len() as u64);
    for record in chosen {
        let path = store.episode(&record.name, record.index).join(EPISODE_FILE);
        let file = EpisodeFile::read(&path).map_err(|why| store.read_error(record, why))?;
        if file.header.seed != record.seed {
            let why = format!("{EPISODE_FILE}: its seed is {}, not {}", file.header.seed, record.seed);
            return Err(store.damaged(&record.name, record.index, &why));
        }
        let mut replay = EpisodeReplay::begin(&mut episode, &file)?;
        let mut rig = replay.camera_rig()?;
        let every = file.steps.len().div_ceil(MAX_FRAMES).max(1);
        let mut frames = Vec::new();
        let mut add_frame = |replay: &EpisodeReplay<'_>, time_ms: i32| -> Result<()> {
            let settings = RenderSettings::Preview { shadows: false };
            let picture = rig.render(replay.episode().cell(), "endoscope", SIZE, &settings)?;
            frames.push((picture.color.clone(), time_ms));
            Ok(())
        };
        while replay.advance() {
            check_interrupted(progress)?;
            if replay.difference().is_some() {
                break;
            }
            let k = replay.steps_done() - 1;
            if k % every == 0 || k + 1 == file.steps.len() {
                add_frame(&replay, (1e3 * replay.episode().time()).round() as i32)?;
            }
        }
        progress.advance(1);
        if replay.difference().is_some() {
            continue;
        }
        if replay.steps_done() == 0 {
            add_frame(&replay, 0)?;
        }
        store.write(&video_name(&record.name, record.index), &webp(&frames)?)?;
    }
    progress.end();
    Ok(())
}
