//! What can be wrong with pictures that are to be compared.

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Pictures that cannot be compared.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum Error {
    /// They differ in size, or one has not as many pixels as its size says.
    #[error(
        "{what} is {width} x {height} with {pixels} pixels, not {expected_width} x {expected_height}; pictures and masks that are compared have one size"
    )]
    Size {
        /// Which of them.
        what: &'static str,
        /// Its width (px).
        width: usize,
        /// Its height (px).
        height: usize,
        /// Its pixels.
        pixels: usize,
        /// The width it should have (px).
        expected_width: usize,
        /// The height it should have (px).
        expected_height: usize,
    },
    /// No pixel counts.
    #[error("the mask is empty; at least one pixel must be compared")]
    Empty,
}

/// Checks that something has as many pixels as it should.
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
