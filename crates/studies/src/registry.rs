//! All studies. A new one adds its file and a line here.

use crate::bench::{CellSpeed, EpisodeBench, GraspCost, MeshingBench, OrgansBench, RenderBench, ScalingBench};
use crate::experiment::{
    ControllerGridExperiment, ConvergenceExperiment, ElementQuality, GraspDesigns, IntegratorsExperiment, PortBudget,
    RandomActionsExperiment, ReconstructionExperiment, RolloutsExperiment, Settling, SimilarityExperiment, Weighing,
};
use crate::study::{Entry, Of};

/// Every study in the order in which the command line lists them.
pub static STUDIES: &[&dyn Entry] = &[
    &Of::<ReconstructionExperiment>::NEW,
    &Of::<ConvergenceExperiment>::NEW,
    &Of::<IntegratorsExperiment>::NEW,
    &Of::<Settling>::NEW,
    &Of::<GraspDesigns>::NEW,
    &Of::<ElementQuality>::NEW,
    &Of::<PortBudget>::NEW,
    &Of::<ControllerGridExperiment>::NEW,
    &Of::<Weighing>::NEW,
    &Of::<RandomActionsExperiment>::NEW,
    &Of::<RolloutsExperiment>::NEW,
    &Of::<SimilarityExperiment>::NEW,
    &Of::<MeshingBench>::NEW,
    &Of::<OrgansBench>::NEW,
    &Of::<ScalingBench>::NEW,
    &Of::<GraspCost>::NEW,
    &Of::<CellSpeed>::NEW,
    &Of::<EpisodeBench>::NEW,
    &Of::<RenderBench>::NEW,
];
