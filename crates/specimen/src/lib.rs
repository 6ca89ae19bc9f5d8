//! Organs on disk: the folder that reconstruction writes and the simulation reads.
//!
//! ```text
//! specimen.toml     organs, materials, pins, provenance
//! <organ>.msh       tetrahedral mesh, Gmsh 4.1, metres
//! <organ>.ply       closed coloured surface, metres
//! background.png    the composite (recordings only)
//! report.html       the page for people (written by `trocar reconstruct`)
//! ```

#![cfg_attr(not(test), warn(clippy::disallowed_methods, reason = "the same bits on every processor"))]

mod document;
mod error;
mod folder;
mod identified;
mod organ;
mod parameter;
mod posterior;
mod specimen;
mod staged;
mod strict_toml;
mod swap;
mod threads;

pub use error::{Error, Result};
pub use organ::{End, Material, MaterialModel, Organ, OrganFacts, Pins, check_name};
pub use parameter::{Parameter, Scale};
pub use posterior::{NINETY, Posterior, Prior};
pub use specimen::{Provenance, Specimen};
pub use staged::StagedFolder;
pub use strict_toml::{line_of, nearest, parse_toml, read_toml};
pub use threads::Threads;
