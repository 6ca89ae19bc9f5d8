//! RGB-D recordings on disk: the folder form.
//!
//! ```text
//! recording.toml            intrinsics, depth scale, rate, organs
//! frames.csv                index,time_s,color,depth,instruments (optional: without it files pair by name, else by order)
//! color/000000.png|jpg      8-bit colour (optional: without it colour is a grey shading of depth)
//! depth/000000.png          16-bit depth
//! masks/<organ>.png         one still mask an organ, in the view of the composite
//! masks/instruments/*.png   instrument masks, one a frame (optional)
//! ```

mod frame_list;
mod info;
mod polygon;
mod reader;
mod writer;

pub use info::{OrganInfo, RecordingInfo};
pub use reader::{Recording, RgbdFrame};
pub use writer::RecordingWriter;

/// The file that makes a folder a recording.
const MARKER: &str = "recording.toml";
