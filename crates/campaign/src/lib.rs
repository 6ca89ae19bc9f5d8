//! Campaigns: many episodes of one scene by several policies, in parallel. A campaign can be killed
//! at any time and resumed.
//!
//! A [`Manifest`] lists the episodes. A [`Store`] holds each finished episode in its own folder. A
//! [`Worker`] runs one episode after the other. [`Campaign::run`] combines them on this machine;
//! the Python package distributes them over several. The bits of an episode depend only on scene,
//! specimen, policy and seed, and not on the worker or the order.

mod agreement;
mod backends;
mod bars;
mod by;
mod campaign;
mod csv_table;
mod curves;
mod drawn_result;
mod episode;
mod interval;
mod manifest;
mod outcomes;
mod page;
mod plots;
mod policy_server;
mod policy_spec;
mod remote;
mod store;
mod table;
mod variation_page;
mod videos;
mod worker;

pub use agreement::Agreement;
pub use backends::{BackendsResult, OfBackend};
pub use by::{By, Value};
pub use campaign::{Campaign, DEFAULT_VARIATION};
pub use curves::{Bin, Curve, Share, significant};
pub use drawn_result::{DrawnEpisode, VariationResult};
pub use episode::{make_policy, run_episode};
pub use interval::Interval;
pub use manifest::{Job, Manifest, named_specimen};
pub use outcomes::{distinct_outcomes, repeats};
pub use plots::{lift_and_rcm, lifts, success_by_name, success_over};
pub use policy_server::interpreter;
pub use policy_spec::PolicySpec;
pub use remote::check_servers;
pub use store::{EpisodeFiles, EpisodeRecord, Store};
pub use table::{CampaignResult, Comparison, EndCounts, PolicyRow, StageCount};
pub use trocar_workflow::{Error, Result};
pub use worker::Worker;
