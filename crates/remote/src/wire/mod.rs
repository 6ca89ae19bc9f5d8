//! MessagePack with NumPy arrays in it, as `openpi_client.msgpack_numpy` writes it: an array is a
//! map with the keys `__ndarray__`, `data`, `dtype`, `shape`, a NumPy number one with
//! `__npgeneric__`, `data`, `dtype`. These keys are byte strings, others are text.

mod decode;
mod encode;

pub use decode::unpack;
pub use encode::pack;

/// Marks an array.
const ARRAY: &str = "__ndarray__";
/// Marks a number that is NumPy's own.
const NUMBER: &str = "__npgeneric__";
/// Deepest nesting of lists and maps.
const DEPTH: usize = 32;
/// Most values in a message, elements of arrays not counted.
const VALUES: usize = 100_000;
