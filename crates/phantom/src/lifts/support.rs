//! What holds the lifted organ besides its bed. The reconstruction does not see it.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use trocar_geometry::{OrganAxis, TetMesh};
use trocar_specimen::Threads;
use trocar_tissue::{Tether, pins};

/// Share of the organ's length at its base that does not move.
const BASE: f64 = 0.08;

/// What holds the lifted organ, by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HiddenSupport {
    /// The base alone: everything else lies loose on the bed.
    Base,
    /// The base, and a slack sheet along the underside of the half beyond the middle.
    #[default]
    Mesentery,
    /// The base, and a short adhesion at the tip.
    Adhesion,
}

impl HiddenSupport {
    /// All supports.
    pub const ALL: [Self; 3] = [Self::Base, Self::Mesentery, Self::Adhesion];

    /// The name in files and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Base => "base",
            Self::Mesentery => "mesentery",
            Self::Adhesion => "adhesion",
        }
    }

    /// The threads, if there are any.
    pub fn threads(self) -> Option<Threads> {
        match self {
            Self::Base => None,
            Self::Mesentery => Some(Threads { from: 0.5, to: 1.0, slack_m: 8e-3, stiffness_n_m2: 600.0 }),
            Self::Adhesion => Some(Threads { from: 0.93, to: 1.0, slack_m: 2e-3, stiffness_n_m2: 6000.0 }),
        }
    }

    /// The nodes that never move: those of the base.
    pub(super) fn pinned(axis: &OrganAxis) -> Vec<u32> {
        (0..axis.s.len() as u32).filter(|i| axis.s[*i as usize] <= BASE).collect()
    }

    /// The threads of the lowest nodes along `up` (unit vector). `spacing` (m) is the distance
    /// between two threads along the organ.
    pub(super) fn tethers(self, mesh: &TetMesh, axis: &OrganAxis, up: DVec3, spacing: f64) -> Vec<Tether> {
        let Some(Threads { from, to, slack_m, stiffness_n_m2 }) = self.threads() else { return Vec::new() };
        let thread = |(node, step): (u32, f64)| Tether {
            node,
            anchor: mesh.vertices[node as usize],
            length: slack_m,
            stiffness: stiffness_n_m2 * step * axis.length,
        };
        let along = pins::lowest_along(&mesh.vertices, &axis.s, up, [from, to], spacing / axis.length);
        along.into_iter().map(thread).collect()
    }
}
