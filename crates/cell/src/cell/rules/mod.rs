//! Safety: rules that stop the arms, and rules that warn of tissue beyond its limits.
//!
//! | module | when | what it does |
//! |---|---|---|
//! | [`force_guard`] | tissue pushes with nearly the scene's limit, or is strained or hit fast | shortens the command, stops the arm |
//! | [`pierce`] | the axis of an instrument is inside an organ that it has not punctured | counts, reports an event |
//! | [`overstretch`] | tissue near an instrument is strained beyond what tissue withstands | the same |
//! | [`fold`] | an organ stays strained with no instrument at it | the same |
//!
//! The guard acts on arms. Nothing here changes the physics of tissue. A scene turns the guard off
//! in `[safety.rules]`.

mod approach;
mod fold;
mod force_guard;
mod organ_watch;
mod overstretch;
mod pierce;
mod strain;
mod tissue_at_arm;
mod watch;

pub(super) use approach::hit_ahead;
pub(super) use force_guard::{ForceGuard, load, place, tip_and_roll};
pub(super) use organ_watch::OrganWatch;
pub(super) use strain::Edges;
pub(super) use tissue_at_arm::TissueAtArm;
