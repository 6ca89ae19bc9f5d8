//! The regular grid of cubic cells that a lattice is cut from.

use crate::{Error, Result};
use glam::DVec3;

/// Smallest and largest edge of a cell (m).
const CELL_RANGE: [f64; 2] = [1e-4, 0.1];

/// Greatest number of cells with material. A factor of so many cells takes some gigabytes.
pub const MAX_CELLS: usize = 200_000;

/// Greatest number of cells along an axis.
const MAX_SIDE: f64 = 100_000.0;

/// Coordinates are moved to a plane of the grid that is nearer than this (cells).
const SNAP: f64 = 1e-7;

/// How a lattice is cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatticeOptions {
    /// Edge of a cell (m), 0.1 mm to 100 mm.
    pub cell: f64,
    /// A corner of a cell (m). Without it the grid is centred about the shape.
    pub origin: Option<DVec3>,
    /// Stiffness of the empty part of boundary cells over the tissue's, 0 to 0.1. It holds nodes
    /// that have next to no material around them. The fictitious part has neither mass nor weight.
    /// Parvizian, Duester and Rank, "Finite cell method", 2007, section 3 (their alpha).
    pub fill: f64,
    /// How boundary cells are integrated.
    pub rule: BoundaryRule,
}

/// How the shape change of a boundary cell is integrated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BoundaryRule {
    /// Eight points whose volume, mean and covariance are those of the material in the cell. It
    /// integrates polynomials of degree two exactly, and is Gauss's rule in full cells.
    #[default]
    Moments,
    /// Gauss's eight points of the whole cell, times the fraction of the cell that is full. The
    /// usual choice of lattices; less accurate.
    Fraction,
}

impl LatticeOptions {
    /// The default fill.
    pub const FILL: f64 = 1e-4;

    /// Cells of `cell` (m), centred about the shape, with the default fill and rule.
    pub fn new(cell: f64) -> Self {
        Self { cell, origin: None, fill: Self::FILL, rule: BoundaryRule::default() }
    }

    fn check(&self) -> Result<()> {
        let [least, most] = CELL_RANGE;
        if !(least..=most).contains(&self.cell) {
            let (cell, least, most) = (1e3 * self.cell, 1e3 * least, 1e3 * most);
            return Err(Error::Lattice(format!("the cell is {cell} mm; must be in [{least}, {most}] mm")));
        }
        if let Some(origin) = self.origin.filter(|origin| !origin.is_finite()) {
            return Err(Error::Lattice(format!("the origin is {origin}; must be finite")));
        }
        if !(0.0..=0.1).contains(&self.fill) {
            return Err(Error::Lattice(format!("the fill is {}; must be in [0, 0.1]", self.fill)));
        }
        Ok(())
    }
}

/// A grid that covers a shape. Coordinates in cells: cell (i, j, k) is [i, i+1] x [j, j+1] x
/// [k, k+1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grid {
    /// Position of the lowest corner (m).
    pub origin: DVec3,
    /// Edge of a cell (m).
    pub cell: f64,
    /// Number of cells along each axis.
    pub dims: [usize; 3],
}

impl Grid {
    /// The grid over `bounds` (m) of a shape of `volume` (m3).
    pub fn new(options: &LatticeOptions, bounds: (DVec3, DVec3), volume: f64) -> Result<Self> {
        options.check()?;
        let cell = options.cell;
        let (low, high) = bounds;
        let expected = volume / cell.powi(3);
        if expected > MAX_CELLS as f64 {
            return Err(too_many(cell, expected));
        }
        let count = |extent: f64| (extent / cell - SNAP).ceil().max(1.0);
        let (origin, sides) = match options.origin {
            Some(corner) => {
                let first = ((low - corner) / cell + SNAP).floor();
                let origin = corner + first * cell;
                (origin, high - origin)
            }
            None => {
                // The excess from rounding up is divided between the two sides.
                let sides = high - low;
                let whole = DVec3::from_array(sides.to_array().map(count)) * cell;
                (low - 0.5 * (whole - sides), sides)
            }
        };
        let dims = sides.to_array().map(count);
        if let Some(side) = dims.into_iter().find(|side| side.is_nan() || *side > MAX_SIDE) {
            let least = 1e3 * cell * side / MAX_SIDE;
            return Err(Error::Lattice(format!(
                "{side} cells along one axis of the shape; must be at most {MAX_SIDE}: choose a cell of {least:.2} mm \
                 or more"
            )));
        }
        Ok(Self { origin, cell, dims: dims.map(|side| side as usize) })
    }

    /// A point (m) in cells.
    pub fn local(&self, p: DVec3) -> DVec3 {
        let q = (p - self.origin) / self.cell;
        let (near, dims) = (q.round(), self.dims.map(|n| n as f64));
        let snapped = DVec3::select((q - near).abs().cmplt(DVec3::splat(SNAP)), near, q);
        snapped.clamp(DVec3::ZERO, DVec3::from_array(dims))
    }

    /// Position (m) of a corner of the grid.
    pub fn corner(&self, at: [usize; 3]) -> DVec3 {
        self.origin + self.cell * DVec3::from_array(at.map(|n| n as f64))
    }

    /// Number of a cell, x fastest.
    pub fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        (k * self.dims[1] + j) * self.dims[0] + i
    }

    /// The cell with a number.
    pub fn at(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.dims;
        [index % nx, index / nx % ny, index / (nx * ny)]
    }
}

/// More cells than can be solved.
pub(crate) fn too_many(cell: f64, cells: f64) -> Error {
    let right = 1e3 * cell * libm::cbrt(cells / MAX_CELLS as f64) * 1.05;
    let cell = 1e3 * cell;
    Error::Lattice(format!(
        "cells of {cell} mm are {cells:.0} in number; must be at most {MAX_CELLS}: choose a cell of {right:.2} mm or \
         more"
    ))
}
