//! The film of a measured lift as a file.

use crate::lift_film::ShownLift;
use crate::{Error, Result};
use std::path::PathBuf;
use trocar_core::Progress;
use trocar_measure::{Film, MeasuredLift};

/// A film of a measured lift to write.
#[derive(Clone, Debug)]
pub struct FilmFile {
    /// The file, an animated WebP.
    pub path: PathBuf,
    /// Number of the lift.
    pub lift: usize,
}

impl FilmFile {
    /// Refuses another ending, a folder that does not exist, and a lift beyond the `lifts` ones.
    pub(super) fn check(&self, lifts: usize) -> Result<()> {
        let wrong = |reason: String| Err(Error::Mismatch(reason));
        let path = self.path.display();
        if self.path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("webp")) {
            return wrong(format!("--film is {path}; it must end in .webp"));
        }
        let folder = self.path.parent().filter(|f| !f.as_os_str().is_empty());
        if let Some(missing) = folder.filter(|f| !f.is_dir()) {
            return wrong(format!("--film is {path}; the folder {} does not exist", missing.display()));
        }
        if self.lift >= lifts {
            let last = lifts.saturating_sub(1);
            return wrong(format!("--lift is {}; the lifts are 0 to {last}", self.lift));
        }
        Ok(())
    }

    /// Writes the film of a lift.
    pub(super) fn write(
        &self,
        source: &mut dyn Film,
        rate_hz: Option<f64>,
        measured: &std::result::Result<MeasuredLift, String>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let number = self.lift;
        let lift = measured
            .as_ref()
            .map_err(|why| Error::Mismatch(format!("lift {number} has no film; it cannot be measured: {why}")))?;
        let film = ShownLift { number, rate_hz, lift }.film(source, None, progress)?;
        crate::video::write_whole(&self.path, &film.bytes)
    }
}
