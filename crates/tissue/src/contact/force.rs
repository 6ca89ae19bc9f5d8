//! Forces of tissue on tools, and events of grasps.

use trocar_core::Wrench;

impl ToolForce {
    /// Adds the forces of another body.
    pub fn add(&mut self, other: &Self) {
        for (sum, part) in [(&mut self.contact, &other.contact), (&mut self.constraint, &other.constraint)] {
            *sum += *part;
        }
        self.pressing += other.pressing;
        self.touching += other.touching;
    }
}

/// Force of tissue on one tool at the end of the last frame. Contact and constraint are kept apart.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolForce {
    /// Tissue's reaction on the tool's colliders.
    pub contact: Wrench,
    /// Pull of the nodes that the tool holds; of rigidly held ones without dashpots and their own
    /// inertia.
    pub constraint: Wrench,
    /// Sum of the magnitudes of the normal contact forces (N): how hard tissue is pressed, even
    /// where forces cancel.
    pub pressing: f64,
    /// Nodes that press against the tool's colliders.
    pub touching: usize,
}

/// Something that happened to a grasp in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// Held tissue began to slide through the jaws. Reported once, until it sticks again.
    Slipped {
        /// The tool.
        tool: usize,
        /// The body.
        body: usize,
    },
    /// The pull exceeded the tissue's strength: the grasp is empty now. Reported once.
    Torn {
        /// The tool.
        tool: usize,
        /// The body.
        body: usize,
        /// Pull at which it tore (N).
        force: f64,
    },
}
