//! The ways in which jaws can hold tissue, by name (paper section IV-C and Table II).

use crate::World;
use crate::blades::{FRICTION, Tools};
use glam::DVec3;
use trocar_core::Pose;
use trocar_tissue::{Compliance, Grasp};

/// How jaws hold what is between them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum GraspDesign {
    /// Friction of the two blades alone.
    Friction,
    /// Nodes tied to the jaws at their places in the undeformed organ: the organ's motion since
    /// then becomes a jump (paper, equation 5).
    RestPose,
    /// Nodes tied to the jaws at their places when the jaws close (paper, equation 4).
    LivePose,
    /// As live-pose, by springs whose force is limited to the friction of the jaws, and that tear.
    #[default]
    Compliant,
}

/// Stiffness of a compliant grasp's spring over Young's modulus times the median edge, about the
/// stiffness of the tissue around a node. It is far above one: held tissue follows the jaws.
const SPRING: f64 = 20.0;

/// Forces of a compliant grasp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JawForces {
    /// Force with which the jaws close (N).
    pub closing: f64,
    /// Pull at which tissue tears out of the jaws (N).
    pub tearing: f64,
}

impl GraspDesign {
    /// All of them, in the paper's order.
    pub const ALL: [Self; 4] = [Self::Friction, Self::RestPose, Self::LivePose, Self::Compliant];

    /// Its name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Friction => "friction",
            Self::RestPose => "rest-pose",
            Self::LivePose => "live-pose",
            Self::Compliant => "compliant",
        }
    }

    /// The grasp of `nodes` of organ `organ` by the gripper `tools` at `pose`; `None` for friction.
    pub fn grasp(
        self,
        world: &World,
        organ: usize,
        nodes: &[u32],
        tools: Tools,
        pose: &Pose,
        forces: JawForces,
    ) -> Option<Grasp> {
        let (model, state) = (&world.model, &world.state);
        let live = || Grasp::capture(model, state, organ, nodes, tools.gripper, pose);
        let body = &model.bodies()[organ];
        match self {
            Self::Friction => None,
            Self::RestPose => {
                // Offsets from the undeformed organ to the gripper where it closes: the
                // displacement since rest becomes the snap.
                let rest: Vec<DVec3> = nodes.iter().map(|i| body.rest_positions()[*i as usize]).collect();
                Some(Grasp::prescribe(model, organ, nodes, &rest, tools.gripper, pose))
            }
            Self::LivePose => Some(live()),
            Self::Compliant => Some(live().compliant(Compliance {
                stiffness: SPRING * body.material().young_modulus * body.median_edge(),
                closing: DVec3::Y,
                jaw_force: forces.closing,
                friction: FRICTION,
                tear_force: forces.tearing,
                blades: Some(tools.blades),
            })),
        }
    }
}

impl std::fmt::Display for GraspDesign {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for GraspDesign {
    type Err = crate::Error;

    fn from_str(name: &str) -> crate::Result<Self> {
        let names = || Self::ALL.map(Self::name).join(", ");
        let unknown = || crate::Error::Option(format!("no grasp design '{name}'; there are {}", names()));
        Self::ALL.into_iter().find(|d| d.name() == name).ok_or_else(unknown)
    }
}
