//! The paper's tables and figures, made anew: one file an experiment.

mod controller_grid;
mod controller_motion;
mod convergence;
mod element_quality;
mod grasp_designs;
mod integrator_forms;
mod integrators;
mod lift_trials;
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

pub(crate) use controller_grid::IN_HAND;
#[cfg(test)]
pub(crate) use controller_grid::tests::made_up_result as made_up_controller_grid;
pub use controller_grid::{ControllerBars, ControllerGridExperiment, ControllerGridResult, ControllerRow};
pub use controller_motion::{ControllerFigures, ControllerInstant};
pub use convergence::{ConvergenceCase, ConvergenceExperiment, ConvergenceResult};
#[cfg(test)]
pub(crate) use element_quality::tests::made_up_result as made_up_element_quality;
pub use element_quality::{ElementQualityExperiment, ElementQualityResult, ElementQualityRow};
pub(crate) use grasp_designs::DESIGNS;
#[cfg(test)]
pub(crate) use grasp_designs::tests::made_up_result as made_up_grasp_designs;
pub use grasp_designs::{GraspDesignRow, GraspDesignsExperiment, GraspDesignsResult, GraspTrial, PaperGrasp};
pub(crate) use integrators::SPEED_LIMIT;
pub use integrators::{IntegratorRow, IntegratorsExperiment, IntegratorsResult};
pub(crate) use lift_trials::design_name;
pub use lift_trials::{AppendixSource, Condition};
pub(crate) use port_budget::SHEETS;
#[cfg(test)]
pub(crate) use port_budget::tests::measured as measured_port_budget;
pub use port_budget::{PortBudgetExperiment, PortBudgetResult, PortBudgetRow, PortRoom, PortStart};
pub use random_actions::{RandomActionsExperiment, RandomActionsResult, RandomActionsRow};
pub use reconstruction::{PhantomFigures, ReconstructionExperiment, ReconstructionResult, ReconstructionRow};
pub use rollouts::{PaperRollouts, RolloutsExperiment, RolloutsResult};
pub(crate) use settling::SETTLED;
pub use settling::{SettlingExperiment, SettlingOrgan, SettlingResult, SettlingRow};
pub(crate) use similarity::SimilarityPictures;
pub use similarity::{PaperSimilarity, SimilarityExperiment, SimilarityResult, SimilarityRow};
pub use step_ladder::StepRow;
pub use trials::Resumed;
#[cfg(test)]
pub(crate) use wrench::tests::measured as measured_wrench;
pub(crate) use wrench::{CHI_SQUARED_95, chi_squared_10};
pub use wrench::{WrenchExperiment, WrenchFrame, WrenchParameter, WrenchResult, WrenchTilt};

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
