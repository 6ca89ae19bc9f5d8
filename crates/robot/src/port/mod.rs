//! The port: a hole in a sheet that an instrument's shaft leans on and pivots in.
//!
//! ```text
//!            \  shaft                        outside
//!             \ \
//!   ___________\ \   _______________________ sheet (thickness t, z from -t/2 to t/2)
//!   ____________\_\_|_______________________     o---> x    y away from the reader
//!        rim     \ \  rim                        |
//!                 \ \                            v z = normal, into the body
//! ```
//!
//! The *port frame* has its origin at the hole's centre in the middle of the sheet and z along the
//! normal, into the body: an upright shaft points along +z. The two pivots of
//! [`Coordinates`](crate::instrument::Coordinates) turn z first about x, then about the y that the
//! first has turned. That is singular only at a second pivot of 90 degrees, where a shaft would lie
//! in the sheet; the hole allows 33.6.
//!
//! The port is no welded pivot: a shaft is thinner than the hole, leans on its rim, and how far its
//! axis is from the centre is measured ([`Measured::deviation`]).

mod contact;
mod deviation;
mod kinematics;
mod port_model;
mod rim;
mod shaft;

pub use contact::{ContactRow, Contacts, RimContact, RimState};
pub use deviation::{Deviation, RCM_ABORT, RCM_THRESHOLD};
pub use kinematics::{Measured, Solution};
pub use port_model::Port;
pub use rim::{Edge, RimPoint};
pub use shaft::{Shaft, Twist};
