//! The phantoms as specimens: recorded, unless an earlier run left the recording, and reconstructed.

use crate::Result;
use crate::workflow::reconstruct_recording;
use std::path::Path;
use trocar_phantom::RecordOptions;
use trocar_progress::Progress;
use trocar_reconstruct::Settings;
use trocar_recording::Recording;
use trocar_specimen::Specimen;

/// Records `phantom` into `dir` unless a recording of the same options lies there.
pub(super) fn recorded(phantom: &str, options: &RecordOptions, dir: &Path, progress: &dyn Progress) -> Result<()> {
    let described = trocar_phantom::describe(phantom, options)?;
    if let Ok(earlier) = Recording::open(dir)
        && earlier.info == described
        && earlier.len() == options.frames
    {
        return Ok(());
    }
    Ok(trocar_phantom::record(phantom, options, dir, progress)?)
}

/// `phantom` recorded into `folder/recording` and reconstructed with the default settings into `folder/specimen`.
pub(crate) fn specimen(
    phantom: &str,
    options: &RecordOptions,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<Specimen> {
    let [recording, specimen] = ["recording", "specimen"].map(|name| folder.join(name));
    recorded(phantom, options, &recording, progress)?;
    Ok(reconstruct_recording(&recording, &Settings::default(), &specimen, progress)?.1.specimen)
}
