//! The analytic tube of the cell's tests, and a task for it.

#![allow(dead_code, reason = "not every test uses all of it")]

#[path = "../../../cell/tests/common/mod.rs"]
mod tube;

use trocar_scene::{Scene, Variation};
pub use tube::*;

/// A resection of the tube: pinned at its base, no start varied but by the scene's variation.
pub fn resection() -> Scene {
    let mut scene = scene();
    scene.task.organ = "tube".to_owned();
    scene.task.episode_s = 20.0;
    scene.variation = Variation::starts();
    scene
}
