//! What the rules remember of an organ.

/// The strain record of an organ over earlier frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::cell) struct OrganWatch {
    /// It was strained beyond its limits and has not recovered.
    pub overstretched: bool,
    /// Frames for which it has been strained without an instrument at it.
    pub frames_alone: u32,
}

impl OrganWatch {
    /// Its bytes, for the hash.
    pub fn bytes(&self) -> [u8; 5] {
        let Self { overstretched, frames_alone } = *self;
        let [a, b, c, d] = frames_alone.to_le_bytes();
        [a, b, c, d, u8::from(overstretched)]
    }
}
