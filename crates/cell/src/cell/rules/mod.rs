//! Safety rules: the cell departs from plain physics so that no command breaks tissue or solver.
//! Each rule has its own file, reports an event, and is counted.
//!
//! | rule | when | what it does |
//! |---|---|---|
//! | [`force_guard`] | tissue pushes with nearly the scene's limit | shortens the command |
//! | [`pierce`] | an instrument is inside an organ that it has not punctured | disables its contact |
//! | [`overstretch`] | tissue near an instrument is strained beyond what tissue bears | disables contact |
//! | [`reconnect`] | the instrument is out, and tissue has come back | enables contact again |
//! | [`relax`] | an organ stays folded with no instrument at it | relaxes it outside of time |
//!
//! A scene turns rules off in `[safety.rules]`. [`reconnect`] undoes the effects of the other rules
//! and has no switch.
//!
//! Contact of latched jaws is disabled in two steps: first that of the blades, which keep their
//! grasp, then that of the whole instrument, which releases it.

mod approach;
mod enforce;
mod force_guard;
mod overstretch;
mod pierce;
mod reconnect;
mod relax;
mod scope;
mod strain;
mod tissue_at_arm;

pub(super) use approach::hit_ahead;
pub(super) use force_guard::ForceGuard;
pub(super) use strain::Edges;
pub(super) use tissue_at_arm::TissueAtArm;
