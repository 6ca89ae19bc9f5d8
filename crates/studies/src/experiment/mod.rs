//! The paper's tables and figures: one file each.

mod controller_grid;
mod controller_motion;
mod convergence;
mod element_quality;
mod grasp_designs;
mod integrator_forms;
mod integrator_row;
mod integrators;
mod lift_trials;
mod lifts;
mod normal;
mod port_budget;
mod random_actions;
mod reconstruction;
mod rollouts;
mod settling;
mod side_by_side;
mod similarity;
mod step_ladder;
mod trials;
mod wrench;

pub use controller_grid::ControllerGridExperiment;
pub use convergence::ConvergenceExperiment;
#[cfg(test)]
pub(crate) use element_quality::tests::made_up_result as made_up_element_quality;
pub(crate) use element_quality::{ElementQualityResult, ElementQualityRow};
pub(crate) use grasp_designs::DESIGNS;
#[cfg(test)]
pub(crate) use grasp_designs::tests::made_up_result as made_up_grasp_designs;
pub(crate) use grasp_designs::{GraspDesignRow, GraspDesignsResult, GraspTrial};
pub use integrators::IntegratorsExperiment;
pub use lift_trials::Condition;
pub(crate) use lift_trials::design_name;
pub use lifts::{ElementQuality, GraspDesigns};
pub use port_budget::PortBudget;
pub use random_actions::RandomActionsExperiment;
pub use reconstruction::ReconstructionExperiment;
pub use rollouts::RolloutsExperiment;
pub use settling::Settling;
pub use similarity::SimilarityExperiment;
pub use wrench::Weighing;

use crate::{Error, Result};
use std::path::Path;

/// Makes the folder of an experiment that goes on where an earlier run was: it must be new, empty, or hold `marker`.
fn claim(output: &Path, marker: &str) -> Result<()> {
    let io = |source| Error::Io { path: output.to_owned(), source };
    let path = output.join(marker);
    if output.exists() && !path.is_file() && output.read_dir().map_err(io)?.next().is_some() {
        let reason =
            format!("holds no {marker}, so it is no earlier experiment and is not written to; name a new folder");
        return Err(Error::Exists { path: output.to_owned(), reason });
    }
    std::fs::create_dir_all(output).map_err(io)?;
    if !path.is_file() {
        write(&path, b"{}\n")?;
    }
    Ok(())
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|source| Error::Io { path: path.to_owned(), source })
}
