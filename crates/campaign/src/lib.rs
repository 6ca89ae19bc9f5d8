//! Campaigns: many episodes of one scene by several policies, in parallel. A campaign can be killed
//! at any time and resumed.
//!
//! A [`Manifest`] lists the episodes. A [`Store`] holds each finished episode in its own folder. A
//! [`Worker`] runs one episode after the other. [`Campaign::run`] combines them on this machine;
//! the Python package distributes them over several. The bits of an episode depend only on scene,
//! specimen, policy and seed, and not on the worker or the order.

mod campaign;
mod csv_table;
mod episode;
mod funnel;
mod manifest;
mod page;
mod plots;
mod policy_server;
mod policy_spec;
mod remote;
mod store;
mod table;
mod videos;
mod worker;

pub use campaign::Campaign;
pub use episode::run_episode;
pub use manifest::{Job, Manifest, named_specimen};
pub use plots::{lift_and_rcm, lifts};
pub use policy_spec::PolicySpec;
pub use store::{EpisodeFiles, EpisodeRecord, Store};
pub use table::{CampaignResult, Comparison, EndCounts, Interval, PolicyRow, StageCount, median};
pub use trocar_workflow::{Error, Result};
pub use worker::Worker;
