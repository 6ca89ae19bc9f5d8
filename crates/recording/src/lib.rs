//! RGB-D recordings of a fixed view: read from a folder of images, a RealSense bag or an MCAP file;
//! written as folders.
//!
//! ```text
//! recording.toml            facts: cameras, depth scale, organs, source of the frames
//! frames.csv                index,time_s,color,depth,instruments
//!                           (optional: without it frames pair by name, time or order)
//! color/000000.png|jpg      8-bit colour (optional: without it colour is a grey shading of depth)
//! depth/000000.png          16-bit depth
//! masks/<organ>.png         one still mask per organ, in the view of the composite
//! masks/instruments/*.png   instrument masks, one per frame (optional)
//! session.bag|mcap          instead of the image folders, named by recording.toml
//! ```
//!
//! A [`Recording`] streams: [`Recording::packets`] yields undecoded frames in the order of the
//! file, and [`Recording::decode`] decodes one on any thread. Memory holds no more than the caller
//! keeps.

mod error;
mod folder;
mod frame_list;
mod info;
mod lift;
mod log;
pub mod messages;
mod pairing;
mod recording;
mod register;
mod shade;
mod source;
mod writer;

pub use error::{Error, Result};
pub use info::{DepthToColor, InstrumentInfo, InstrumentRule, OrganInfo, RecordingInfo, SourceInfo};
pub use lift::LiftInfo;
pub use pairing::Pairing;
pub use recording::{Recording, RgbdFrame};
pub use register::Registration;
pub use source::{Packet, Parts};
pub use writer::RecordingWriter;
