//! Results as documents: tables, plots and pictures in single HTML files, as text and as Markdown.
//! The crate knows no study and no simulator. Pages have no scripts and load nothing.

mod axis;
pub mod canvas;
pub mod chart;
pub mod colors;
pub mod document;
mod error;
pub mod figures;
pub mod overlays;
pub mod page;
pub mod picture_colors;
pub mod plots;
pub mod table;
pub mod views;

pub use error::{Error, Result};
