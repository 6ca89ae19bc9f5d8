//! Reads stamped messages of RGB-D recordings from log files.
//!
//! Opens ROS 1 bags (as `rosbag record`, RealSense Viewer and librealsense write them) and MCAP
//! files (with ROS 1, ROS 2, or foxglove's protobuf or JSON messages). Decodes the message types
//! that a recording needs: images, camera calibrations, numbers and transforms.
//!
//! ```text
//! open -> MessageLog (topics, times) -> find_rgbd_topics -> messages -> decode_*
//! ```
//!
//! Files are read in pieces, one chunk in memory at a time, and may be damaged or hostile. Memory
//! stays below a constant times the size of the file. Every defect is an error or a sentence in
//! [`MessageLog::problems`].
//!
//! Sources of the formats: ROS bag 2.0 (<http://wiki.ros.org/Bags/Format/2.0>), MCAP
//! (<https://mcap.dev/spec>), the message definitions of `sensor_msgs`, `std_msgs`,
//! `geometry_msgs`, `tf2_msgs`, foxglove's schemas (<https://docs.foxglove.dev/docs/sdk/schemas>),
//! depth images as in ROS REP 118, and librealsense's `ros_file_format.h` for the topics of its
//! bags.
//!
//! The records of both formats are parsed here: there are few of them, and both formats share one
//! walk over the file and one chunk reader, so that damage costs only the messages it hits. Crate
//! `rosbag` 0.6 maps the whole file, which needs `unsafe`, and allocates what a chunk's header
//! claims. Other crates, all in Rust, do decompression, images and JSON.

mod bag;
mod byte_reader;
mod byte_source;
mod calibration;
mod chunk;
mod compressed;
mod decode;
mod distortion;
mod error;
mod foxglove;
mod image;
mod log;
mod log_builder;
mod mcap;
mod open;
pub mod realsense;
mod rgbd_topics;
mod ros;
mod topic;
mod transform;

pub use byte_source::ReadSeek;
pub use decode::{decode_calibration, decode_float, decode_image, decode_transforms};
pub use error::{Error, Result};
pub use image::{DepthValues, Image, RawDepth, StampedImage};
pub use open::{open, open_reader};
pub use rgbd_topics::{RgbdTopics, find_rgbd_topics};
pub use topic::{Encoding, Message, MessageLog, Topic, read_one};
pub use transform::Transform;
