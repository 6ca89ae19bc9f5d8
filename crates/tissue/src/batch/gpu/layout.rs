//! Where the numbers of a batch lie in the buffers of a graphics card.
//!
//! What varies by instance is one array of rows; a row has one number of every column, and a column
//! is an instance. So neighbouring threads, which have neighbouring columns, read neighbouring
//! numbers. The shaders know all places as constants, which are written before their text.

use super::super::elastic::{LIMITED_RATIO, LIMITED_SQUARE};
use super::super::frame::Schedule;
use super::super::search::{MAX_REJECTED, MEMORY, MIN_CURVATURE, MIN_RATIO as MIN_CELL_RATIO, OVERSHOOT, SHORTENED};
use super::super::topology::Topology;
use super::super::warp::MIN_RATIO as TURNED_RATIO;
use std::fmt::Write;

/// Columns and rows of a tile of the solve: columns come in multiples of it.
pub(super) const TILE: usize = 64;

/// Volume ratio below which the barrier of the limits is a parabola.
const PARABOLA_RATIO: f32 = 0.02;

/// Rows of the arrays that the host writes or reads, and the text of all constants.
pub(super) struct Layout {
    pub columns: usize,
    /// Rows of the inverse: three for each node, rounded up to tiles.
    pub padded: usize,
    /// Greatest number of springs of a grasp.
    pub springs: usize,
    pub displacements: usize,
    pub velocities: usize,
    pub idle: usize,
    pub inertia: usize,
    pub gravity: usize,
    pub held_nodes: usize,
    pub held_weights: usize,
    pub stiffness: usize,
    pub resistance: usize,
    pub targets: usize,
    /// Rounds, searches that did not converge, and damage: three rows.
    pub reports: usize,
    /// Rows of all arrays.
    pub rows: usize,
    /// Constants of the shaders.
    pub constants: String,
}

/// The arrays that all instances share, and where they begin.
#[derive(Default)]
pub(super) struct Shared {
    pub numbers: Vec<f32>,
    pub indices: Vec<u32>,
}

/// Hands out rows.
struct Rows {
    next: usize,
    constants: String,
}

impl Rows {
    fn take(&mut self, name: &str, rows: usize) -> usize {
        let first = self.next;
        self.next += rows;
        self.constant(name, first);
        first
    }

    fn constant(&mut self, name: &str, value: usize) {
        let _ = writeln!(self.constants, "const {name}: u32 = {value}u;");
    }

    fn number(&mut self, name: &str, value: f32) {
        // WGSL's numbers: `{:e}` has all digits that are needed.
        let _ = writeln!(self.constants, "const {name}: f32 = {value:e}f;");
    }
}

impl Layout {
    /// For a number of columns and of springs of a grasp; with the shared arrays. `factors` has the
    /// number of the factor of each tile of columns.
    pub fn new(
        topology: &Topology,
        schedule: &Schedule,
        columns: usize,
        springs: usize,
        factors: &[u32],
    ) -> (Self, Shared) {
        let (nodes, cells) = (topology.len(), topology.cells.len());
        let (field, rank) = (3 * nodes, 3 * springs);
        let padded = field.next_multiple_of(TILE);
        let mut rows = Rows { next: 0, constants: String::new() };
        let shared = Shared::new(topology, factors, &mut rows);
        for (name, value) in [
            ("COLUMNS", columns),
            ("NODES", nodes),
            ("CELLS", cells),
            ("ROWS", field),
            ("PADDED", padded),
            ("SPRINGS", springs),
            ("RANK", rank),
            ("MEMORY", MEMORY),
        ] {
            rows.constant(name, value);
        }
        for (name, value) in [
            ("SUBSTEP_LENGTH", schedule.h as f32),
            ("TOLERANCE", schedule.ends.tolerance),
            ("RELATIVE", schedule.ends.relative),
            ("SHEAR", topology.shear),
            ("BULK", topology.bulk),
            ("LIMIT_STRENGTH", topology.bulk + topology.shear / 3.0),
            ("LIMITED_RATIO", LIMITED_RATIO),
            ("LIMITED_SQUARE", LIMITED_SQUARE),
            ("PARABOLA_RATIO", PARABOLA_RATIO),
            ("TURNED_RATIO", TURNED_RATIO),
            ("MIN_RATIO", MIN_CELL_RATIO),
            ("OVERSHOOT", OVERSHOOT),
            ("MIN_CURVATURE", MIN_CURVATURE),
            ("MAX_REJECTED", MAX_REJECTED),
            ("SHORTEST", SHORTENED[0]),
            ("LONGEST", SHORTENED[1]),
        ] {
            rows.number(name, value);
        }
        for name in ["START", "PREDICTOR", "TRIAL", "GRADIENT", "TRIAL_GRADIENT", "DIRECTION"] {
            rows.take(name, field);
        }
        for name in ["SOLUTION", "SOLVED"] {
            rows.take(name, padded);
        }
        rows.take("STEPS", MEMORY * field);
        rows.take("CHANGES", MEMORY * field);
        rows.take("ROTATIONS", 3 * field);
        rows.take("FORCES", 24 * cells);
        rows.take("RATIO", cells);
        rows.take("RESPONSES", rank * field);
        for name in ["DONE", "FRESH", "FLAT", "SHARE", "SLOPE", "SIZE", "WAY", "LEAST", "REJECTED", "USED", "CONVERGED"]
        {
            rows.take(name, 1);
        }
        rows.take("INVERSES", MEMORY);
        rows.take("SHARES_OF_PAIRS", MEMORY);
        let displacements = rows.take("U", field);
        let velocities = rows.take("V", field);
        let idle = rows.take("IDLE", 1);
        let inertia = rows.take("INERTIA", 1);
        let gravity = rows.take("GRAVITY", 3);
        let held_nodes = rows.take("HELD_NODES", 8 * springs);
        let held_weights = rows.take("HELD_WEIGHTS", 8 * springs);
        let stiffness = rows.take("STIFFNESS", springs);
        let resistance = rows.take("RESISTANCE", rank * rank);
        let targets = rows.take("TARGETS", schedule.substeps * rank);
        let reports = rows.take("ROUNDS", 1);
        rows.take("UNCONVERGED", 1);
        rows.take("DAMAGED", 1);
        let layout = Self {
            columns,
            padded,
            springs,
            displacements,
            velocities,
            idle,
            inertia,
            gravity,
            held_nodes,
            held_weights,
            stiffness,
            resistance,
            targets,
            reports,
            rows: rows.next,
            constants: rows.constants,
        };
        (layout, shared)
    }

    /// Bytes of the array with the numbers of the instances.
    pub fn bytes(&self) -> u64 {
        4 * self.rows as u64 * self.columns as u64
    }

    /// Where a row begins (bytes).
    pub fn offset(&self, row: usize) -> u64 {
        4 * row as u64 * self.columns as u64
    }
}

impl Shared {
    fn new(topology: &Topology, factors: &[u32], rows: &mut Rows) -> Self {
        let mut shared = Self::default();
        let cells = &topology.cells;
        shared.numbers("CELL_POINTS", cells.iter().flat_map(|c| c.points).flat_map(|p| [p.x, p.y, p.z]), rows);
        shared.numbers("CELL_NUMBERS", cells.iter().flat_map(|c| [c.volume, c.fill]), rows);
        shared.numbers("MASSES", topology.masses.iter().copied(), rows);
        shared.numbers("WEIGHTS", topology.weights.iter().copied(), rows);
        shared.numbers("TURNING", topology.turning.iter().copied(), rows);
        shared.numbers("PINS", topology.pins.iter().map(|pin| pin.stiffness), rows);
        shared.indices("CELL_NODES", cells.iter().flat_map(|c| c.nodes), rows);
        let nodes = topology.len();
        let mut corners: Vec<Vec<u32>> = vec![Vec::new(); nodes];
        for (corner, node) in cells.iter().flat_map(|c| c.nodes).enumerate() {
            corners[node as usize].push(corner as u32);
        }
        shared.lists(["CORNER_STARTS", "CORNERS"], &corners, rows);
        // The pins are sorted by the node that they act on.
        let mut pins: Vec<Vec<u32>> = vec![Vec::new(); nodes];
        topology.pins.iter().for_each(|pin| pins[pin.to as usize].push(pin.from));
        shared.lists(["PIN_STARTS", "PIN_NODES"], &pins, rows);
        let mut fixed = vec![0; nodes];
        topology.fixed.iter().for_each(|node| fixed[*node as usize] = 1);
        shared.indices("FIXED", fixed.into_iter(), rows);
        shared.indices("FACTORS", factors.iter().copied(), rows);
        shared
    }

    fn numbers(&mut self, name: &str, values: impl Iterator<Item = f32>, rows: &mut Rows) {
        rows.constant(name, self.numbers.len());
        self.numbers.extend(values);
    }

    fn indices(&mut self, name: &str, values: impl Iterator<Item = u32>, rows: &mut Rows) {
        rows.constant(name, self.indices.len());
        self.indices.extend(values);
    }

    /// Lists of nodes: where each begins, one more than there are, and their parts.
    fn lists(&mut self, [starts, parts]: [&str; 2], lists: &[Vec<u32>], rows: &mut Rows) {
        let ends = lists.iter().scan(0, |end, list| {
            *end += list.len() as u32;
            Some(*end)
        });
        self.indices(starts, std::iter::once(0).chain(ends), rows);
        self.indices(parts, lists.iter().flatten().copied(), rows);
    }
}
