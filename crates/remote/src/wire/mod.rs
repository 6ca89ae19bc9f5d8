//! MessagePack with NumPy arrays, as `openpi_client.msgpack_numpy` writes it: an array is a map
//! with the keys `__ndarray__`, `data`, `dtype`, `shape`; a NumPy number is a map with the keys
//! `__npgeneric__`, `data`, `dtype`. These keys are byte strings, other keys are text.

mod decode;
mod encode;
mod format;

pub use decode::unpack;
pub use encode::pack;
