//! Errors of picture comparisons.

/// Result of picture comparisons.
pub type Result<T> = std::result::Result<T, Error>;

/// Pictures that cannot be compared.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum Error {
    /// Different sizes, or a number of pixels that does not match the size.
    #[error(
        "{what} is {width} x {height} with {pixels} pixels; it must be {expected_width} x {expected_height}, the size of all compared pictures and masks"
    )]
    Size {
        /// The picture or mask.
        what: &'static str,
        /// Its width (px).
        width: usize,
        /// Its height (px).
        height: usize,
        /// Its number of pixels.
        pixels: usize,
        /// The expected width (px).
        expected_width: usize,
        /// The expected height (px).
        expected_height: usize,
    },
    /// The mask is empty.
    #[error("the mask is empty; at least one pixel must be set")]
    Empty,
}

/// Checks the size and number of pixels.
pub(crate) fn fits(
    what: &'static str,
    (width, height, pixels): (usize, usize, usize),
    expected: (usize, usize),
) -> Result<()> {
    if (width, height) == expected && Some(pixels) == width.checked_mul(height) {
        return Ok(());
    }
    Err(Error::Size { what, width, height, pixels, expected_width: expected.0, expected_height: expected.1 })
}
