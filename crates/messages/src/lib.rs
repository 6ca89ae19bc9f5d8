//! Stamped messages of RGB-D recordings, out of log files.
//!
//! Reads ROS 1 bags (as `rosbag record`, RealSense Viewer and librealsense write them) and MCAP files (with ROS 1, ROS 2,
//! and foxglove's protobuf or JSON messages), and decodes the few kinds of message a recording needs: images, camera
//! calibrations, numbers and transforms. It knows nothing of reconstruction.
//!
//! ```text
//! open -> MessageLog: topics, times -> guess or realsense::find: which topics -> messages -> decode_*
//! ```
//!
//! Files are read piece by piece, one chunk in memory at a time, and may be damaged or hostile: memory stays below a
//! constant times what the file really holds, and everything wrong is an error or a sentence in [`MessageLog::problems`].
//!
//! Sources of the formats: ROS bag 2.0 (<http://wiki.ros.org/Bags/Format/2.0>), MCAP (<https://mcap.dev/spec>), the message
//! definitions of `sensor_msgs`, `std_msgs`, `geometry_msgs`, `tf2_msgs` and foxglove's schemas
//! (<https://docs.foxglove.dev/docs/sdk/schemas>), depth images as in ROS REP 118, and librealsense's `ros_file_format.h` for
//! the topics of its bags.
//!
//! The records of both files are parsed here: they are few, and one walk and one chunk reader serve both, so that damage costs
//! the messages it hits and no others. Crate `rosbag` 0.6 maps the whole file, which needs `unsafe`, and allocates what a
//! chunk's header claims. Decompression, images and JSON are left to crates; all are pure Rust.

mod bag;
mod calibration;
mod chunk;
mod compressed;
mod distortion;
mod error;
mod foxglove;
mod guess;
mod image;
mod log;
mod mcap;
mod message;
mod reader;
pub mod realsense;
mod ros;
mod source;
mod transform;

pub use crate::calibration::decode_calibration;
pub use crate::error::{Error, Result};
pub use crate::guess::{Guess, guess};
pub use crate::image::{DepthValues, Image, RawDepth, StampedImage, decode_image};
pub use crate::log::read_one;
pub use crate::message::decode_float;
pub use crate::source::ReadSeek;
pub use crate::transform::{Transform, decode_transforms};

use crate::source::Source;
use std::path::Path;

/// A log file of stamped messages.
pub trait MessageLog: Send + Sync {
    /// The file.
    fn path(&self) -> &Path;

    /// Topics in the order of their names; those without messages are left out.
    fn topics(&self) -> &[Topic];

    /// Log times [ns since the epoch] of a topic's messages, ascending; index i here is message i below. Empty when there is
    /// no such topic.
    fn times(&self, topic: usize) -> &[u64];

    /// The wanted messages (topic, index), in the order they lie in the file; only their chunks are read, and memory holds
    /// one at a time. A message that is damaged, or lies in a damaged chunk, is an error and the rest goes on; so is one
    /// that is not there.
    fn messages<'a>(&'a self, wanted: &[(usize, usize)]) -> Box<dyn Iterator<Item = Message> + Send + 'a>;

    /// What was wrong with the file as a whole, a sentence each; empty for a whole file.
    fn problems(&self) -> &[String];
}

/// A named stream of messages of one type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Its name: `/camera/color/image_raw`.
    pub name: String,
    /// Message type, in ROS 1's form for both ROS: `sensor_msgs/Image`, `foxglove.RawImage`.
    pub kind: String,
    /// How the messages are written.
    pub encoding: Encoding,
    /// Number of messages.
    pub count: usize,
}

/// How messages are written.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Encoding {
    /// ROS 1 serialization.
    Ros1,
    /// ROS 2's CDR.
    Cdr,
    /// Protocol buffers.
    Protobuf,
    /// JSON.
    Json,
    /// Something else, by the file's name for it; cannot be decoded.
    Other(String),
}

/// A message read from a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Index of its topic.
    pub topic: usize,
    /// Its place among the messages of its topic, by time.
    pub index: usize,
    /// Its content, or why it cannot be had.
    pub bytes: Result<Vec<u8>>,
}

/// Opens a log file; its content, not its name, says which kind it is.
///
/// A file without an index (the recorder was killed, the copy was cut) is read through and used as far as it is whole; see
/// [`MessageLog::problems`].
///
/// # Errors
/// [`Error::File`] if the file cannot be read or is neither a ROS 1 bag nor MCAP.
pub fn open(path: &Path) -> Result<Box<dyn MessageLog>> {
    let file = std::fs::File::open(path)
        .map_err(|e| Error::File { path: path.to_owned(), reason: format!("cannot be opened ({e})") })?;
    open_reader(path, Box::new(file))
}

/// Opens a log that is not (only) a file; `path` names it in errors.
///
/// # Errors
/// As [`open`].
pub fn open_reader(path: &Path, reader: Box<dyn ReadSeek>) -> Result<Box<dyn MessageLog>> {
    let wrong = |reason: String| Error::File { path: path.to_owned(), reason };
    let source = Source::new(path, reader)?;
    let start = source.up_to(0, 16).map_err(wrong)?;
    if start.starts_with(bag::MAGIC) {
        return Ok(Box::new(bag::open(source).map_err(wrong)?));
    }
    if start.starts_with(mcap::MAGIC) {
        return Ok(Box::new(mcap::open(source)));
    }
    Err(wrong(if start.starts_with(b"#ROSBAG V1") {
        "a ROS bag of version 1; convert it with `rosbag fix`".into()
    } else if start.starts_with(b"SQLite format 3") {
        "an SQLite file, perhaps a ROS 2 bag; convert it with `ros2 bag convert` to MCAP".into()
    } else {
        "neither a ROS 1 bag nor an MCAP file".into()
    }))
}
