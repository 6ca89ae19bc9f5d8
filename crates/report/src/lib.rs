//! Pages as single HTML files: tables, plots, pictures. Nothing here knows what is shown; no
//! scripts, nothing loaded from elsewhere.

mod axis;
pub mod colors;
pub mod document;
mod error;
pub mod figures;
pub mod overlays;
pub mod page;
pub mod plots;
pub mod table;
pub mod views;

pub use error::{Error, Result};
