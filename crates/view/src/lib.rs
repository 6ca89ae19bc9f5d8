//! The live view: a cell in a browser while it runs, and instruments in the operator's hands.
//!
//! A [`Server`] simulates in one thread, makes frames in another, and serves the page and the wire
//! (docs/guides/view-wire.md) on a port of this machine. Each client has a slot for one frame: a
//! slow one misses frames, and the simulation never waits. Clients change the episode only through
//! its actions: everything that an operator does is in the episode file. A [`Follower`] shows an
//! episode that another program steps, to clients that only watch.

mod arm_columns;
pub mod client;
mod encode;
mod error;
mod follow;
mod frame;
mod front;
mod haptic;
mod http;
mod hub;
mod inbox;
mod measured;
mod message;
mod operator;
mod outbox;
mod pace;
mod page;
mod picture;
mod policy;
mod protocol;
mod readings;
mod record;
mod server;
mod session;
mod shapes;
mod show;
mod snapshot;
mod socket;
mod source;
mod table;
mod values;

pub use error::{Error, Result};
pub use follow::Follower;
pub use page::build_page;
pub use server::{Options, Server};
pub use source::{Building, Source};
