//! The appearance of an episode, kept beside its actions: the organs' surfaces, the poses of arms,
//! instruments and cameras, and a policy's observation, at the start and after every control
//! period. Pictures are made of it without simulation, and do not depend on later changes of the
//! physics.

mod format;
mod playback;
mod quantise;
mod recorder;

pub use format::{ActionLimits, RecordedArm, RecordedCamera, SurfaceFrame, SurfacesHeader};
pub use playback::RecordedEpisode;
pub use recorder::{SurfaceRecorder, SurfaceWatch};

/// Name of the file in an episode's folder.
pub const SURFACES_FILE: &str = "surfaces.trocar";
