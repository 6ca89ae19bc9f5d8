//! RGB-D recordings of a fixed view: read from a folder of images, a RealSense bag or an MCAP file;
//! written as a folder.
//!
//! ```text
//! recording.toml            what is known of it: cameras, depth scale, organs, where the frames are
//! frames.csv                index,time_s,color,depth,instruments (optional: without it frames pair by name, time or order)
//! color/000000.png|jpg      8-bit colour (optional: without it colour is a grey shading of depth)
//! depth/000000.png          16-bit depth
//! masks/<organ>.png         one still mask an organ, in the view of the composite
//! masks/instruments/*.png   instrument masks, one a frame (optional)
//! session.bag|mcap          in place of the image folders, named by recording.toml
//! ```
//!
//! A [`Recording`] streams: [`Recording::packets`] hands out undecoded frames in the order they lie
//! on disk, and [`Recording::decode`] turns one into images on any thread. No more is in memory
//! than the caller keeps.

mod error;
mod folder;
mod frame_list;
mod info;
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
pub use pairing::Pairing;
pub use recording::{Recording, RgbdFrame};
pub use register::Registration;
pub use source::{Packet, Parts};
pub use writer::RecordingWriter;
