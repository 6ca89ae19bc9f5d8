//! The list of all studies.

use crate::bench::{
    CellBench, EpisodeBench, GraspBench, LiftBench, ManyBench, MeshingBench, OrgansBench, RenderBench, ScalingBench,
    ViewBench,
};
use crate::experiment::{
    BackendsExperiment, BeamExperiment, ContactExperiment, ControllerGridExperiment, ConvergenceExperiment,
    CutForceExperiment, ElementQualityExperiment, GraspDesignsExperiment, IdentificationExperiment,
    IntegratorsExperiment, LiftsExperiment, MeshConvergenceExperiment, PortBudgetExperiment, PortRegraspExperiment,
    RandomActionsExperiment, ReconstructionExperiment, RobustnessExperiment, RolloutsExperiment, SettlingExperiment,
    SimilarityExperiment, TruthCubeExperiment, WrenchExperiment,
};
use crate::study::{Entry, Of};

/// All studies, in the order of the command line.
pub static STUDIES: &[&dyn Entry] = &[
    &Of::<ReconstructionExperiment>::NEW,
    &Of::<ConvergenceExperiment>::NEW,
    &Of::<MeshConvergenceExperiment>::NEW,
    &Of::<IntegratorsExperiment>::NEW,
    &Of::<TruthCubeExperiment>::NEW,
    &Of::<BeamExperiment>::NEW,
    &Of::<ContactExperiment>::NEW,
    &Of::<SettlingExperiment>::NEW,
    &Of::<GraspDesignsExperiment>::NEW,
    &Of::<ElementQualityExperiment>::NEW,
    &Of::<CutForceExperiment>::NEW,
    &Of::<PortBudgetExperiment>::NEW,
    &Of::<PortRegraspExperiment>::NEW,
    &Of::<ControllerGridExperiment>::NEW,
    &Of::<WrenchExperiment>::NEW,
    &Of::<RandomActionsExperiment>::NEW,
    &Of::<RolloutsExperiment>::NEW,
    &Of::<RobustnessExperiment>::NEW,
    &Of::<BackendsExperiment>::NEW,
    &Of::<SimilarityExperiment>::NEW,
    &Of::<LiftsExperiment>::NEW,
    &Of::<IdentificationExperiment>::NEW,
    &Of::<MeshingBench>::NEW,
    &Of::<OrgansBench>::NEW,
    &Of::<ScalingBench>::NEW,
    &Of::<ManyBench>::NEW,
    &Of::<GraspBench>::NEW,
    &Of::<LiftBench>::NEW,
    &Of::<CellBench>::NEW,
    &Of::<EpisodeBench>::NEW,
    &Of::<RenderBench>::NEW,
    &Of::<ViewBench>::NEW,
];
