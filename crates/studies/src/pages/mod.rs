//! The pages of studies: each a title, what was found, tables, plots and pictures.

mod controller_grid;
mod convergence;
mod element_quality;
mod grasp_designs;
mod integrators;
mod meshing;
mod port_budget;
mod random_actions;
mod reconstruction_experiment;
mod rollouts;
mod scaling;
mod settling;
mod similarity;
mod wrench;

use crate::Result;
use crate::bench::{MeshingResult, ScalingResult};
use crate::experiment::{
    ControllerGridResult, ConvergenceResult, ElementQualityResult, GraspDesignsResult, IntegratorsResult,
    PortBudgetResult, RandomActionsResult, ReconstructionResult, RolloutsResult, SettlingResult, SimilarityPictures,
    SimilarityResult, WrenchResult,
};
use trocar_campaign::{Kept, Plan};
use trocar_reconstruct::Reconstruction;
use trocar_report::page;

/// The page of the reconstruction experiment; `made` are the reconstructions of its phantoms in their order.
///
/// # Errors
/// Images of differing sizes, a picture that cannot be encoded.
pub(crate) fn reconstruction_experiment(result: &ReconstructionResult, made: &[Reconstruction]) -> Result<String> {
    made.iter().try_for_each(trocar_workflow::pages::check_sizes)?;
    let subtitle = format!("{} organs of {} phantoms, one set of settings", result.organs.len(), made.len());
    Ok(page::page("Reconstruction", &subtitle, &reconstruction_experiment::body(result, made)?))
}

/// The page of the rollouts beside the paper.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn rollouts(plan: &Plan, result: &RolloutsResult, kept: &[Kept]) -> Result<String> {
    let subtitle = "Lift and RCM deviation of six controllers, beside the paper's Fig. 6(d, e)";
    Ok(page::page("Rollouts", subtitle, &rollouts::body(plan, result, kept)?))
}

/// The page of the meshing benchmark.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn meshing(result: &MeshingResult) -> Result<String> {
    Ok(page::page("Meshing", "From closed surfaces to tetrahedra", &meshing::body(result)?))
}

/// The page of the scaling benchmark.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn scaling(result: &ScalingResult) -> Result<String> {
    Ok(page::page("Scaling", "Stepping over elements, threads and models", &scaling::body(result)?))
}

/// The page of the integrators' comparison.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn integrators(result: &IntegratorsResult) -> Result<String> {
    Ok(page::page("Integrators", "Which stay bounded, and which are right", &integrators::body(result)?))
}

/// The page of random actions.
pub(crate) fn random_actions(result: &RandomActionsResult) -> String {
    page::page("Random actions", "What breaks under random but legal actions", &random_actions::body(result))
}

/// The page of the settling experiment.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn settling(result: &SettlingResult) -> Result<String> {
    Ok(page::page("Settling", "Phantoms released into the cell", &settling::body(result)?))
}

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

/// The page of the convergence experiment.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn convergence(result: &ConvergenceResult) -> Result<String> {
    let subtitle = "Position and energy error of one substep, over iterations and over time";
    Ok(page::page("Convergence", subtitle, &convergence::body(result)?))
}

/// The page of the port budget.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn port_budget(result: &PortBudgetResult) -> Result<String> {
    Ok(page::page("Port budget", "How far a shaft may lie beside its port's centre", &port_budget::body(result)?))
}

/// The page of the controllers' grid.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn controller_grid(result: &ControllerGridResult) -> Result<String> {
    let subtitle = "182 configurations on the same motion, and the one that is chosen";
    Ok(page::page("Controllers", subtitle, &controller_grid::body(result)?))
}

/// The page of the similarity experiment; `shown` and `oblique` are the pictures of its rows and of its oblique views.
///
/// # Errors
/// A picture that cannot be encoded.
pub(crate) fn similarity(
    result: &SimilarityResult,
    shown: &[SimilarityPictures],
    oblique: &[SimilarityPictures],
) -> Result<String> {
    let subtitle = "Reconstructions rendered beside what was filmed";
    Ok(page::page("Similarity", subtitle, &similarity::body(result, shown, oblique)?))
}

/// The page of the wrench experiment.
///
/// # Errors
/// A plot that cannot be drawn.
pub(crate) fn wrench(result: &WrenchResult) -> Result<String> {
    Ok(page::page("Force at the tool mount", "An instrument weighed, tared and touched", &wrench::body(result)?))
}
