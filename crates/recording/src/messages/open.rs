//! Opens a log file of either format.

use super::byte_source::{ByteSource, ReadSeek};
use super::error::{Error, Result};
use super::topic::MessageLog;
use super::{bag, mcap};
use std::path::Path;

/// Opens a log file. Its content, not its name, decides the format.
///
/// A file without an index (the recorder was killed, the copy was cut) is read through, and what is
/// undamaged is used; see [`MessageLog::problems`].
///
/// # Errors
/// [`Error::File`] if the file cannot be read or is neither a ROS 1 bag nor MCAP.
///
/// ```no_run
/// use trocar_recording::messages::{find_rgbd_topics, open};
///
/// let log = open("session.mcap".as_ref())?;
/// let topics = find_rgbd_topics(&*log, None, None)?;
/// println!("colour is {}", log.topics()[topics.color].name);
/// # Ok::<(), trocar_recording::messages::Error>(())
/// ```
pub fn open(path: &Path) -> Result<Box<dyn MessageLog>> {
    let file = std::fs::File::open(path)
        .map_err(|e| Error::File { path: path.to_owned(), reason: format!("cannot be opened ({e})") })?;
    open_reader(path, Box::new(file))
}

/// Opens a log from any reader; `path` names it in errors.
///
/// # Errors
/// As [`open`].
pub fn open_reader(path: &Path, reader: Box<dyn ReadSeek>) -> Result<Box<dyn MessageLog>> {
    let wrong = |reason: String| Error::File { path: path.to_owned(), reason };
    let source = ByteSource::new(path, reader)?;
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
