//! Phantoms as specimens: recorded, unless an earlier run left the recording, and reconstructed.

use crate::reconstruct::reconstruct_recording;
use crate::specimen_scene::source;
use crate::{Error, Result};
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_reconstruct::Settings;
use trocar_recording::Recording;
use trocar_scene::{Scene, Source, SpecimenSource};
use trocar_specimen::Specimen;

/// Frames of a phantom's recording: the composite's window.
const FRAMES: usize = 181;

/// Records `phantom` into `dir` unless `dir` has a recording with the same options.
///
/// # Errors
/// A phantom that is not known, a folder that cannot be written.
pub fn recorded(phantom: &str, options: &RecordOptions, dir: &Path, progress: &dyn Progress) -> Result<()> {
    let described = trocar_phantom::describe(phantom, options)?;
    if let Ok(earlier) = Recording::open(dir) {
        let mut info = earlier.info.clone();
        let lifts = std::mem::take(&mut info.lifts);
        let frames = lifts.last().map_or(options.frames, |lift| lift.last + 1);
        if info == described && lifts.len() == options.lifts.count && earlier.len() == frames {
            return Ok(());
        }
    }
    Ok(trocar_phantom::record(phantom, options, dir, progress)?)
}

/// What becomes of a phantom's recording once its specimen is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AfterUse {
    /// It stays beside the specimen.
    Keep,
    /// It is removed: it takes thirty times as much room.
    Remove,
}

/// The file with the program and options that made a kept specimen; it is reused only for the same.
const STAMP: &str = "made-by";

/// The folder of a specimen beside its phantom's recording, and its stamp.
fn specimen_and_stamp(folder: &Path, max_elements: Option<u32>) -> (PathBuf, PathBuf) {
    let ending = max_elements.map_or_else(String::new, |most| format!("-{most}"));
    (folder.join(format!("specimen{ending}")), folder.join(format!("{STAMP}{ending}.txt")))
}

/// `phantom`, recorded into `folder/recording`, where the recording stays or not, and reconstructed
/// with the default settings into `folder/specimen`, or with about `max_elements` an organ at most
/// into `folder/specimen-NUMBER`. A specimen of an earlier run is reused if the same program would
/// make the same. If several processes need it at once, one makes it and the others wait.
///
/// # Errors
/// A phantom that is not known, a folder that cannot be written.
pub fn specimen(
    phantom: &str,
    options: &RecordOptions,
    max_elements: Option<u32>,
    folder: &Path,
    after: AfterUse,
    progress: &dyn Progress,
) -> Result<Specimen> {
    let mut settings = Settings::default();
    settings.max_tets = max_elements.map_or(settings.max_tets, |most| most as usize);
    let (recording, (specimen, path)) = (folder.join("recording"), specimen_and_stamp(folder, max_elements));
    let stamp = format!("{phantom}\n{options:?}\n{settings:?}\n{}\n", env!("TROCAR_SPECIMEN_SOURCE_HASH"));
    let io = |source| Error::Io { path: path.clone(), source };
    std::fs::create_dir_all(folder).map_err(io)?;
    let lock = File::create(folder.join(".lock")).map_err(io)?;
    lock.lock().map_err(io)?;
    let tidy = || match (after == AfterUse::Remove).then(|| std::fs::remove_dir_all(&recording)) {
        Some(Err(source)) if source.kind() != ErrorKind::NotFound => Err(Error::Io { path: recording.clone(), source }),
        _ => Ok(()),
    };
    if std::fs::read_to_string(&path).is_ok_and(|kept| kept == stamp)
        && let Ok(kept) = Specimen::read(&specimen)
    {
        tidy()?;
        return Ok(kept);
    }
    // Without the stamp, nobody reuses the folder while it is made.
    match std::fs::remove_file(&path) {
        Err(e) if e.kind() != ErrorKind::NotFound => return Err(io(e)),
        _ => {}
    }
    recorded(phantom, options, &recording, progress)?;
    reconstruct_recording(&recording, &settings, &specimen, progress)?;
    std::fs::write(&path, &stamp).map_err(io)?;
    tidy()?;
    // Reads the specimen back: its bits must not depend on who made it.
    Ok(Specimen::read(&specimen)?)
}

/// The specimen of a scene: from its folder, or of its phantom, which is made once in the folder
/// `phantoms` and kept.
///
/// # Errors
/// A specimen that cannot be read or made.
pub fn scene_specimen(scene: &Scene, phantoms: &Path, progress: &dyn Progress) -> Result<Specimen> {
    source_specimen(&scene.specimen, &scene.folder, phantoms, progress)
}

/// The specimen of the scene of a recorded episode: the scene's, or the one in `folder`, which was
/// moved, with the same organs of others.
///
/// # Errors
/// As [`scene_specimen`].
pub(crate) fn recorded_specimen(
    scene: &Scene,
    folder: Option<&Path>,
    phantoms: &Path,
    progress: &dyn Progress,
) -> Result<Specimen> {
    let Some(folder) = folder else { return scene_specimen(scene, phantoms, progress) };
    let source = SpecimenSource { swapped: scene.specimen.swapped.clone(), ..source(folder) };
    source_specimen(&source, &scene.folder, phantoms, progress)
}

fn kept_in(phantoms: &Path, name: &str, seed: u32) -> PathBuf {
    phantoms.join(format!("{name}-{seed}"))
}

/// Whether the specimen that `source` names is there, and those that organs of it are of: a folder,
/// or a phantom that some program has made in the folder `phantoms`.
pub fn is_made(source: &SpecimenSource, phantoms: &Path) -> bool {
    let own = match source.source() {
        Some(Source::Phantom(name, seed)) => {
            specimen_and_stamp(&kept_in(phantoms, name, seed), source.max_elements).1.is_file()
        }
        Some(Source::Folder(_)) | None => true,
    };
    own && source.organs_of_others().all(|(_, other)| is_made(&SpecimenSource::labelled(other), phantoms))
}

/// The specimen that `source` names: from its folder, whose path starts from `folder`, or of its
/// phantom, which is made once in the folder `phantoms` and kept. Organs of other specimens are in
/// the place of its own.
///
/// # Errors
/// As [`scene_specimen`]; an organ of another specimen that does not fit.
pub fn source_specimen(
    source: &SpecimenSource,
    folder: &Path,
    phantoms: &Path,
    progress: &dyn Progress,
) -> Result<Specimen> {
    let mut made = match source.source() {
        Some(Source::Folder(path)) => Specimen::read(&folder.join(path))?,
        Some(Source::Phantom(name, seed)) => {
            let options = RecordOptions { frames: FRAMES, seed: u64::from(seed), ..RecordOptions::default() };
            specimen(name, &options, source.max_elements, &kept_in(phantoms, name, seed), AfterUse::Remove, progress)?
        }
        None => return Err(Error::Mismatch("the scene names neither a specimen folder nor a phantom".to_owned())),
    };
    for (organ, other) in source.organs_of_others() {
        let given = source_specimen(&SpecimenSource::labelled(other), folder, phantoms, progress)?;
        let why = |e: trocar_specimen::Error| Error::Mismatch(format!("{}: {e}", source.label()));
        made = made.with_organ_of(&given, organ).map_err(why)?;
    }
    Ok(made)
}
