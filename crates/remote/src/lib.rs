//! Remote policies: a client of openpi's WebSocket policy protocol, in the dialects of openpi's and
//! RoboArena's servers.
//!
//! An [`Observation`] is sent as one binary message of MessagePack with NumPy arrays; the reply is
//! a chunk of [`Actions`]. The client does not trust the server: it checks every size, shape and
//! type before use, every wait has a deadline, and every failure is an [`Error`] of one line. The
//! guide to policies describes the format and the errors.
//!
//! ```
//! use trocar_remote::{
//!     ActionQueue, Actions, Array, Client, Endpoint, Loopback, Observation, Playback,
//! };
//!
//! // A server on this machine, for tests and examples. It answers with chunks of two actions.
//! let server = Loopback::start(&Default::default(), |_| {
//!     let chunk = Array::from_f64(&[2, 3], &[0.0, 0.1, 0.2, 1.0, 1.1, 1.2]);
//!     let chunk = chunk.map_err(|e| e.to_string())?;
//!     Ok(Observation::from([("actions".to_owned(), chunk.into())]))
//! })?;
//! let mut client = Client::connect(&Endpoint::new(server.url()))?;
//! let mut queue = ActionQueue::new(Playback::default())?;
//! let mut played = Vec::new();
//! for frame in 0..4 {
//!     let action = queue.at(frame as f64 / 30.0, || -> Result<Actions, _> {
//!         let mut observation = Observation::new();
//!         let image = Array::from_u8(&[1, 2, 3], vec![0; 6])?;
//!         observation.insert("observation/image".into(), image.into());
//!         observation.insert("prompt".into(), "lift the appendix".into());
//!         Ok(client.infer(&observation)?.actions)
//!     })?;
//!     played.push(action[0]);
//! }
//! assert_eq!(played, [0.0, 1.0, 0.0, 1.0]);
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

pub use actions::{Actions, ReplyLimits};
pub use array::{Array, Dtype};
pub use client::{Client, Reply};
pub use endpoint::{Dialect, Endpoint, Retry, Timeouts};
pub use error::{Error, Result};
pub use loopback::{Call, Loopback, LoopbackOptions};
pub use queue::{ActionQueue, Playback};
pub use roboarena::ServerConfig;
pub use value::{Map, Observation, Value};
pub use wire::{pack, unpack};
