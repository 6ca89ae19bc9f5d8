//! The paper's tables and figures: one file or folder each.

mod appendix;
mod contact;
mod controller_grid;
mod convergence;
mod cut_force;
mod element_quality;
mod grasp_designs;
mod integrators;
mod mesh_convergence;
mod port_budget;
mod port_regrasp;
mod random_actions;
mod reconstruction;
mod robustness;
mod rollouts;
mod settling;
mod similarity;
mod wrench;

pub use contact::ContactExperiment;
pub use controller_grid::ControllerGridExperiment;
pub use convergence::ConvergenceExperiment;
pub use cut_force::CutForceExperiment;
pub use element_quality::ElementQualityExperiment;
pub use grasp_designs::GraspDesignsExperiment;
pub use integrators::IntegratorsExperiment;
pub use mesh_convergence::MeshConvergenceExperiment;
pub use port_budget::PortBudgetExperiment;
pub use port_regrasp::PortRegraspExperiment;
pub use random_actions::RandomActionsExperiment;
pub use reconstruction::ReconstructionExperiment;
pub use robustness::RobustnessExperiment;
pub use rollouts::RolloutsExperiment;
pub use settling::SettlingExperiment;
pub use similarity::SimilarityExperiment;
pub use wrench::WrenchExperiment;
