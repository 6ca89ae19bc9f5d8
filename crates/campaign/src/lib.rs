//! Campaigns: many episodes of one scene by several policies, in parallel, killed at any moment and gone on with.
//!
//! A [`Plan`] says which episodes there are, a [`Store`] keeps each finished one in a folder of its own, a [`Worker`] runs one after the other. [`Campaign::run`] puts them together on this
//! machine; the Python package does the same over many. An episode's bits depend on scene, specimen, policy and seed alone, so who ran it where does not matter.

mod campaign;
mod funnel;
mod page;
mod pictures;
mod plan;
mod remote;
mod served;
mod single;
mod source;
mod store;
mod table;
mod worker;

pub use campaign::Campaign;
pub use page::{lift_and_rcm, lifts};
pub use plan::{Job, Plan};
pub use single::run_episode;
pub use source::PolicySpec;
pub use store::{Files, Kept, Store};
pub use table::{CampaignResult, Comparison, EndCounts, Interval, PolicyRow, StageCount, median};
pub use trocar_workflow::{Error, Result};
pub use worker::Worker;
