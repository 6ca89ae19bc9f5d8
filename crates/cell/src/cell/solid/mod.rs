//! Solids: instruments push each other, the bed and tissue that cannot move.
//!
//! An instrument is its shaft and two blades, all of capsules ([`rod`]). Where they touch a solid,
//! a one-sided spring without friction pushes ([`spring`]), in every physics step of the arms. Each
//! step begins with a new search for possible contacts ([`meeting`]). There is no memory of earlier
//! contacts. An arm with dynamics has the spring in its implicit step, so no stiffness is too high.
//! An ideal arm stops where the solids push it with the scene's force limit ([`step`]).
//!
//! Tissue that moves is not a solid: its own step finds its contacts. That step knows no contact of
//! vertices that are pinned, so triangles of three pinned vertices are solids ([`pinned`]), and so
//! are pinned vertices and edges of other triangles ([`rim`]).

mod bed;
mod jaws;
mod load;
mod meeting;
mod pair;
mod pinned;
mod rim;
mod rod;
mod spring;
mod step;
mod surface_vertex;

use trocar_tissue::Hole;

pub(super) use load::SolidLoad;
pub(super) use meeting::Meeting;
pub(super) use pinned::PinnedSurface;
pub(super) use rod::{Rod, clearance};

/// The solids other than the instruments.
#[derive(Clone)]
pub(super) struct Solids {
    /// Height of the bed's plane (m), if there is a bed.
    pub bed: Option<f64>,
    /// Tissue that cannot move. It only changes when organs are cut.
    pub pinned: PinnedSurface,
    /// The holes of the tissue's state in this frame, which let instruments through.
    pub holes: Vec<Hole>,
}
