//! Tasks in the two-arm cell: stages, channels, episodes, their files, and policies.
//!
//! An [`Episode`] steps a scene's cell from a seeded start to its [`End`]. Each step gives a row of
//! [`Channels`]; stages, sweeps and summaries are functions of rows alone. An episode file holds
//! the actions and one state hash per step. Anyone can replay it and compare.

#![cfg_attr(not(test), warn(clippy::disallowed_methods, reason = "the same bits on every processor"))]

mod bodies;
mod bounds;
mod channels;
mod end;
mod episode;
mod error;
mod facts;
mod judge;
mod measure;
mod measures;
mod observation;
pub mod policy;
mod prompt;
mod replay;
mod run;
mod specimen;
pub mod stages;
mod start;
mod storage;
mod summary;
mod supply;
mod sweep;
mod visible;
mod warnings;
mod why;

pub use bounds::Bounds;
pub use channels::{ArmChannels, Channels, TaskChannels};
pub use end::End;
pub use episode::{Episode, EpisodeState, SETTLE_S, Step};
pub use error::{Error, Result};
pub use facts::{Details, Severed};
pub use observation::{ArmState, Observation, STATE_NAMES, STATE_SIZE};
pub use policy::Policy;
pub use prompt::prompt;
pub use replay::{EpisodeFile, Header, Verdict, scene_hash};
pub use run::{CHANNELS_FILE, EPISODE_FILE, EpisodeResult, Kept, RESULT_FILE, Recording, TimedEvent, run, run_watched};
pub use specimen::specimen_hash;
pub use stages::{Progress, StageProgress, Tracker};
pub use storage::{ChannelsInfo, Column, read_channels, write_channels};
pub use summary::{ArmSummary, LOADED_N, Summary};
pub use supply::{OneSpecimen, SpecimenSupply};
pub use sweep::{GateRange, Sweep, SweepRow, sweep};
pub use warnings::Warnings;
