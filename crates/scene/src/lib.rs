//! Scene files: the whole cell in one TOML file, checked before anything is built from it.
//!
//! A [`Scene`] says which specimen lies where, how its tissue is stepped, which arms hold which
//! instruments through which ports, what the cameras see, and what the task asks for.
//! [`Scene::read`] takes a file or the name of a built-in scene, refuses unknown keys and values
//! that cannot be meant, and says in one line where and why.
//!
//! One rule for units: a key ends in its unit. Where things are in the cell is in metres (`_m`);
//! how large things are and how far they may go is in millimetres (`_mm`); angles are in degrees
//! (`_deg`), pressures in pascals (`_pa`), forces in newtons (`_n`). Shares, organ coordinates and
//! jaw openings run from 0 to 1 and have no unit.

#![cfg_attr(not(test), warn(clippy::disallowed_methods, reason = "the same bits on every processor"))]

mod anatomy;
mod builtin;
mod camera;
mod cell;
mod check;
mod error;
mod expression;
mod imaging;
mod phantoms;
mod port;
mod program;
mod random;
mod read;
mod scene;
mod schema;
mod stages;
mod start;
mod surfaces;
mod task;
mod task_definition;
mod task_name;
mod tissue;
mod tissue_preset;
mod variation;

pub use anatomy::{
    FIELD, MaterialOverride, OrganOverride, PinEnd, PinRule, Source, SpecimenSource, TOUGHNESS, ThreadRule,
};
pub use builtin::{BUILTINS, Builtin};
pub use camera::{CellCamera, Lens, View};
pub use cell::{Arm, ArmModel, Controller, Drive, FRANKA_FR3, Frame, GravityError, Instrument, InstrumentKind, Side};
pub use error::{Error, Result};
pub use expression::{
    Comparison, Condition, MAX_MEASURES, Measure, Number, Operation, Part, Place, Target, channel_names,
};
pub use imaging::Imaging;
pub use phantoms::{PHANTOMS, Phantom};
pub use port::Port;
pub use program::{
    AbortProgram, HintPart, Program, ScriptAction, ScriptProgram, StageProgram, TaskContext, TaskMistake,
};
pub use random::EpisodeRandom;
pub use scene::{Origin, Rates, Scene, Tool};
pub use stages::{Abort, BUILTIN_TASKS, BuiltinTask, Definition, ScriptStep, Stage, StageOrder};
pub use start::Start;
pub use surfaces::{CollisionMesh, RenderMesh, Surfaces};
pub use task::{Gates, GraspDesignName, Safety, SafetyRules, Task};
pub use task_name::TaskName;
pub use tissue::{BackendName, LatticeLaw, ScheduleName, Support, SupportKind, Tissue, ToolContactKind};
pub use tissue_preset::TissuePreset;
pub use variation::{
    Distribution, Drawn, DrawnTissue, DrawnValue, Factor, Per, Specimens, Split, TissueSource, Variation, VariationSet,
};
