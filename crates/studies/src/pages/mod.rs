//! The pages of lifts of the appendix.

mod element_quality;
mod grasp_designs;

use crate::Result;
use crate::experiment::{ElementQualityResult, GraspDesignsResult};
use trocar_report::page;

/// The page of the grasp designs.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn grasp_designs(result: &GraspDesignsResult) -> Result<String> {
    Ok(page::page("Grasp designs", "Four ways to hold the appendix", &grasp_designs::body(result)?))
}

/// The page of the element-quality experiment.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn element_quality(result: &ElementQualityResult) -> Result<String> {
    Ok(page::page("Element quality", "Lifts of the appendix against its pins", &element_quality::body(result)?))
}
