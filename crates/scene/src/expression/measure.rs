//! Measures of tasks, besides the channels that every episode has.

use crate::Side;
use std::fmt::{Display, Formatter, Result};

/// A part of an organ.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Its name; its pieces after a cut belong to it.
    pub organ: String,
    /// Organ coordinates, its ends included; 0 to 1 is all of it.
    pub range: [f64; 2],
}

/// A point of an instrument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The tip of the closed blades.
    Tip(Side),
    /// The middle of the region between the blades.
    Jaws(Side),
}

/// What moves.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// A point of an instrument.
    Place(Place),
    /// A part of an organ: its centroid, or its nearest node for distances.
    Part(Part),
}

/// A number that is measured in every row of a task that names it.
#[derive(Clone, Debug, PartialEq)]
pub enum Measure {
    /// Distance of a point of an instrument from another or from the nearest node of an organ (mm).
    Distance(Place, Target),
    /// Organ coordinate at which an arm holds the organ; -1 where it does not.
    Held(Side, String),
    /// The organ is in the mouth of an arm: 0 or 1.
    InMouth(Side, String),
    /// Distance from where it was at the episode's start (mm).
    Moved(Target),
    /// The same, but for the height (mm).
    Aside(Target),
    /// Rise since the episode's start (mm).
    Risen(Target),
    /// Visible share of a part of an organ, 0 to 1: the pixels that a camera sees of it, over those
    /// that it would see if nothing hid the part.
    Visible(String, Part),
}

impl Measure {
    /// The organ that it is about.
    pub fn organ(&self) -> Option<&str> {
        match self {
            Self::Held(_, organ) | Self::InMouth(_, organ) | Self::Visible(_, Part { organ, .. }) => Some(organ),
            Self::Distance(_, target) | Self::Moved(target) | Self::Aside(target) | Self::Risen(target) => match target
            {
                Target::Part(part) => Some(&part.organ),
                Target::Place(_) => None,
            },
        }
    }
}

impl Display for Part {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "organ.{}", self.organ)?;
        if self.range == [0.0, 1.0] { Ok(()) } else { write!(f, "[{}, {}]", self.range[0], self.range[1]) }
    }
}

impl Display for Place {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::Tip(side) => write!(f, "{}.tip", side.name()),
            Self::Jaws(side) => write!(f, "{}.jaws", side.name()),
        }
    }
}

impl Display for Target {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::Place(place) => place.fmt(f),
            Self::Part(part) => part.fmt(f),
        }
    }
}

impl Display for Measure {
    /// As it is written in expressions; the name of its column.
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::Distance(a, b) => write!(f, "distance({a}, {b})"),
            Self::Held(side, organ) => write!(f, "attached({}, organ.{organ})", side.name()),
            Self::InMouth(side, organ) => write!(f, "in_mouth({}, organ.{organ})", side.name()),
            Self::Moved(what) => write!(f, "moved({what})"),
            Self::Aside(what) => write!(f, "aside({what})"),
            Self::Risen(what) => write!(f, "risen({what})"),
            Self::Visible(camera, part) => write!(f, "visible({camera}, {part})"),
        }
    }
}
