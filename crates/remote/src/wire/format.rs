//! Keys and limits of the format.

/// Key that marks an array.
pub const ARRAY: &str = "__ndarray__";
/// Key that marks a NumPy number.
pub const NUMBER: &str = "__npgeneric__";
/// Maximum nesting of lists and maps.
pub const MAX_DEPTH: usize = 32;
/// Maximum number of values in a message, without elements of arrays.
pub const MAX_VALUES: usize = 100_000;
