//! What an episode looked like, kept beside its actions: the organs' surfaces, the poses of arms,
//! instruments and cameras, and what a policy observed, at the start and after every control
//! period. Pictures are made of it without simulation, so that they do not depend on physics that
//! may have changed since.

mod format;
mod playback;
mod quantise;
mod recorder;

pub use format::{ActionLimits, RecordedArm, RecordedCamera, SurfaceFrame, SurfacesHeader};
pub use playback::RecordedEpisode;
pub use recorder::{SurfaceRecorder, SurfaceWatch};

/// Name of the file in an episode's folder.
pub const SURFACES_FILE: &str = "surfaces.trocar";
