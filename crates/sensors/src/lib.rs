//! Pictures from the cameras of a simulated cell.
//!
//! A [`CameraRig`] combines the cameras of a scene, a running cell and the renderer of
//! `trocar-render`. It shows the organs with their surfaces (in pieces after a cut), the field
//! below them, instruments with moving jaws, arms, ports and the room. [`CameraRig::render`]
//! returns colour, metric depth, labels and normals. The result depends on the state of the cell
//! only, not on the number of threads.

#![cfg_attr(not(test), warn(clippy::disallowed_methods, reason = "the same bits on every processor"))]

mod arm;
mod camera;
mod cell_stage;
mod drawn;
mod error;
mod field;
mod furniture;
mod instrument;
mod looks;
mod organ;
mod rig;
mod section;
mod skins;
mod solid;
mod surroundings;
mod visuals;

pub use camera::{OUTSIDE, image_circle};
pub use cell_stage::is_tool;
pub use drawn::{DrawnBody, DrawnCell, DrawnMesh, DrawnPart};
pub use error::{Error, Result};
pub use organ::BoundSurface;
pub use rig::{CameraNoise, CameraRig};
pub use skins::{ArmPosture, SkinnedOrgan, Skins};
pub use trocar_camera::DepthNoise;
