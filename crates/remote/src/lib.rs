//! Policies over a wire: a client of openpi's WebSocket policy protocol, as its own servers and RoboArena's speak it.
//!
//! An [`Observation`] goes out as one binary message of MessagePack with NumPy arrays in it, a chunk of [`Actions`] comes back.
//! Nothing that a server sends is trusted: every size, shape and type is checked before it is used, every wait has a deadline, and
//! whatever goes wrong is an [`Error`] of one line. The format and the errors are described in `docs/guides/policies.md`.
//!
//! ```no_run
//! use trocar_remote::{ActionQueue, Array, Client, Endpoint, Observation, Playback};
//!
//! let mut client = Client::connect(&Endpoint::new("ws://127.0.0.1:8000"))?;
//! let mut queue = ActionQueue::new(Playback::default())?;
//! for frame in 0..90 {
//!     let action = queue.at(frame as f64 / 60.0, || {
//!         let mut observation = Observation::new();
//!         observation.insert("observation/image".into(), Array::from_u8(&[1, 2, 3], vec![0; 6])?.into());
//!         observation.insert("prompt".into(), "lift the appendix".into());
//!         Ok(client.infer(&observation)?.actions)
//!     })?;
//!     println!("{action:?}");
//! }
//! # Ok::<(), trocar_remote::Error>(())
//! ```

mod actions;
mod array;
mod client;
mod endpoint;
mod error;
mod loopback;
mod queue;
mod roboarena;
mod value;
mod wire;

pub use actions::{ActionLimits, Actions};
pub use array::{Array, Dtype};
pub use client::{Client, Reply};
pub use endpoint::{Dialect, Endpoint, Retry, Timeouts};
pub use error::{Error, Result};
pub use loopback::{Call, Loopback, LoopbackOptions};
pub use queue::{ActionQueue, Playback};
pub use roboarena::ServerConfig;
pub use value::{Map, Observation, Value};
pub use wire::{pack, unpack};
