//! The port: a round hole in a sheet, on whose rim an instrument's shaft leans and pivots.
//!
//! ```text
//!            \  shaft                        outside
//!             \ \
//!   ___________\ \   _______________________ sheet (thickness t, z from -t/2 to t/2)
//!   ____________\_\_|_______________________     o---> x    y into the page
//!        rim     \ \  rim                        |
//!                 \ \                            v z = normal, into the body
//! ```
//!
//! The *port frame* has its origin at the hole's centre in the middle of the sheet and z along the
//! normal, into the body: an upright shaft points along +z. The two pivots of
//! [`Coordinates`](crate::instrument::Coordinates) rotate z first about x, then about the rotated
//! y. This is singular only at a second pivot of 90 degrees, where a shaft would lie in the sheet;
//! the hole allows 33.6 degrees.
//!
//! The port is not a fixed pivot: a shaft is thinner than the hole and leans on its rim. The
//! distance of its axis from the centre is measured ([`Measured::deviation`]).

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
