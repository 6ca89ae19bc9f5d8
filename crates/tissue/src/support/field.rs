//! A height field that conforms to the underside of a body at rest.
//!
//! The surface is a biquadratic B-spline over a square grid. Its normal is continuous: a node that
//! slides over it meets no edges. It lies nowhere above its coefficients: if these are lowered, it
//! stays under every node of a body.

use super::SupportContact;
use crate::{Error, Result};
use glam::{DMat3, DVec3};
use trocar_geometry::TetMesh;

/// Greatest slope of a support under a body: 45 degrees. Where the body's side is steeper, the
/// support leaves it.
const MAX_SLOPE: f64 = 1.0;

/// Cells of level bed around the body; the spline reaches over one and a half.
const MARGIN: usize = 4;

/// Greatest number of cells of a field.
const MAX_CELLS: f64 = 4e6;

/// A one-sided height field over a plane.
#[derive(Clone, Debug, PartialEq)]
pub struct SupportField {
    /// Where the first coefficient lies on the level bed (m).
    pub(crate) origin: DVec3,
    /// Unit vectors along columns and rows of the grid, and up.
    pub(crate) axes: [DVec3; 3],
    /// Side of a cell (m).
    pub(crate) cell: f64,
    /// Columns and rows.
    pub(crate) size: [usize; 2],
    /// Coefficients of the spline, row by row: heights above the bed (m).
    pub(crate) heights: Vec<f64>,
    friction: f64,
}

impl SupportField {
    /// The support of `mesh` as it lies: under each node of its underside, as near as `cell` (m)
    /// and slopes of at most 45 degrees allow, and never above it, so that it pushes nothing at
    /// rest. Beyond the body it is the level bed at the height of the lowest node. `friction` is
    /// Coulomb's coefficient.
    ///
    /// # Errors
    /// A mesh without elements or with numbers that are not finite, an `up` without direction, a
    /// cell that is not above 0 or so small that the field has more than four million cells, and
    /// negative friction.
    pub fn under(mesh: &TetMesh, up: DVec3, cell: f64, friction: f64) -> Result<Self> {
        let refuse = |what: String| Err(Error::Model(format!("a support cannot be made: {what}")));
        let Some(up) = up.try_normalize() else {
            return refuse(format!("up is {up}; it must be a direction"));
        };
        if !(cell > 0.0 && cell.is_finite() && friction >= 0.0 && friction.is_finite()) {
            return refuse(format!(
                "cells of {cell} m and friction of {friction}; the first is above 0, the second not below"
            ));
        }
        if mesh.tets.is_empty() || mesh.vertices.iter().any(|v| !v.is_finite()) {
            return refuse("the mesh has no element or a node that is nowhere".to_owned());
        }
        let along = up.any_orthonormal_vector();
        let axes = [along, up.cross(along), up];
        let place = |p: DVec3| axes.map(|a| a.dot(p));
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in mesh.vertices.iter().map(|p| place(*p)) {
            low = std::array::from_fn(|k| p[k].min(low[k]));
            high = std::array::from_fn(|k| p[k].max(high[k]));
        }
        let margin = MARGIN as f64;
        let cells = [0, 1].map(|k| ((high[k] - low[k]) / cell).ceil() + 2.0 * margin + 1.0);
        if cells[0] * cells[1] > MAX_CELLS {
            return refuse(format!("{} x {} cells of {cell} m; larger ones will do", cells[0], cells[1]));
        }
        let size = cells.map(|n| n as usize);
        let start = [low[0] - margin * cell, low[1] - margin * cell, low[2]];
        let origin = axes[0] * start[0] + axes[1] * start[1] + axes[2] * start[2];
        let mut field = Self { origin, axes, cell, size, heights: vec![f64::INFINITY; size[0] * size[1]], friction };
        field.press(mesh);
        for height in field.heights.iter_mut().filter(|height| height.is_infinite()) {
            *height = 0.0;
        }
        field.soften();
        field.lower(mesh);
        field.soften();
        Ok(field)
    }

    /// Coulomb friction coefficient.
    pub fn friction(&self) -> f64 {
        self.friction
    }

    /// Place of a point in the grid: column, row, height above the bed (m).
    fn place(&self, p: DVec3) -> [f64; 3] {
        let off = p - self.origin;
        [off.dot(self.axes[0]) / self.cell, off.dot(self.axes[1]) / self.cell, off.dot(self.axes[2])]
    }

    /// Lowers each coefficient to the lowest point of the mesh's surface over it.
    fn press(&mut self, mesh: &TetMesh) {
        let (surface, _) = mesh.boundary();
        for triangle in &surface.triangles {
            let [a, b, c] = triangle.map(|i| self.place(surface.vertices[i as usize]));
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            // From below, outward faces are seen clockwise.
            if area >= 0.0 {
                continue;
            }
            let span = |k: usize| {
                let (low, high) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
                low.ceil().max(0.0) as usize..=(high.floor().max(0.0) as usize).min(self.size[k] - 1)
            };
            for row in span(1) {
                for column in span(0) {
                    let p = [column as f64, row as f64];
                    let part = |q: [f64; 3], r: [f64; 3]| {
                        ((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])) / area
                    };
                    let parts = [part(b, c), part(c, a), part(a, b)];
                    if parts.iter().all(|w| *w >= -1e-9) {
                        let height = parts[0] * a[2] + parts[1] * b[2] + parts[2] * c[2];
                        let at = &mut self.heights[row * self.size[0] + column];
                        *at = at.min(height.max(0.0));
                    }
                }
            }
        }
    }

    /// Lowers coefficients until none is steeper above its neighbours than allowed: two passes over
    /// the grid with eight neighbours (chamfer distances).
    fn soften(&mut self) {
        let [columns, rows] = self.size;
        let rise = MAX_SLOPE * self.cell;
        let near = [(-1, 0, 1.0), (0, -1, 1.0), (-1, -1, std::f64::consts::SQRT_2), (1, -1, std::f64::consts::SQRT_2)];
        for backwards in [false, true] {
            for k in 0..columns * rows {
                let k = if backwards { columns * rows - 1 - k } else { k };
                let (column, row) = ((k % columns) as i64, (k / columns) as i64);
                let sign = if backwards { -1 } else { 1 };
                for (i, j, distance) in near {
                    let (i, j) = (column + sign * i, row + sign * j);
                    if (0..columns as i64).contains(&i) && (0..rows as i64).contains(&j) {
                        let most = self.heights[j as usize * columns + i as usize] + rise * distance;
                        self.heights[k] = self.heights[k].min(most);
                    }
                }
            }
        }
    }

    /// Lowers the coefficients around each node that lies below the surface by its depth. Each
    /// lowering also lowers the surface for the other nodes.
    fn lower(&mut self, mesh: &TetMesh) {
        for p in &mesh.vertices {
            let depth = -self.contact(*p).height;
            if depth > 0.0 {
                let [u, v, _] = self.place(*p);
                let ([column, _], [row, _]) = (self.knot(u, 0), self.knot(v, 1));
                for j in 0..3 {
                    for i in 0..3 {
                        // A little more than the depth: rounding must not make a contact.
                        let k = (row as usize + j) * self.size[0] + column as usize + i;
                        self.heights[k] -= depth * (1.0 + 1e-9) + 1e-12;
                    }
                }
            }
        }
    }

    /// First of the three coefficients that count at a place along an axis, and the way from the
    /// middle one. The bed continues beyond the grid.
    fn knot(&self, place: f64, axis: usize) -> [f64; 2] {
        let last = (self.size[axis] - 2) as f64;
        let place = place.clamp(0.5, last + 0.5);
        let middle = place.round().clamp(1.0, last);
        [middle - 1.0, place - middle]
    }

    pub(crate) fn contact(&self, p: DVec3) -> SupportContact {
        let [u, v, w] = self.place(p);
        let ([column, s], [row, t]) = (self.knot(u, 0), self.knot(v, 1));
        let (across, down) = (weights(s), weights(t));
        let mut sums = [[0.0; 3]; 3];
        for j in 0..3 {
            let at = (row as usize + j) * self.size[0] + column as usize;
            let heights = &self.heights[at..at + 3];
            for (d, sum) in sums.iter_mut().enumerate() {
                let along: f64 = heights.iter().zip(across[d]).map(|(h, w)| h * w).sum();
                for (e, sum) in sum.iter_mut().enumerate() {
                    *sum += along * down[e][j];
                }
            }
        }
        let [a, b, up] = self.axes;
        let (one, two) = (1.0 / self.cell, 1.0 / (self.cell * self.cell));
        let outer = |p: DVec3, q: DVec3| DMat3::from_cols(p * q.x, p * q.y, p * q.z);
        let curvature = outer(a, a) * sums[2][0] + outer(b, b) * sums[0][2] + (outer(a, b) + outer(b, a)) * sums[1][1];
        SupportContact {
            height: w - sums[0][0],
            gradient: up - one * (sums[1][0] * a + sums[0][1] * b),
            curvature: curvature * -two,
        }
    }
}

/// The quadratic B-spline's weights of three neighbours at `t` (-0.5..=0.5) from the middle one,
/// and their first two derivatives.
fn weights(t: f64) -> [[f64; 3]; 3] {
    [
        [0.5 * (0.5 - t) * (0.5 - t), 0.75 - t * t, 0.5 * (0.5 + t) * (0.5 + t)],
        [t - 0.5, -2.0 * t, t + 0.5],
        [1.0, -2.0, 1.0],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A field of some heights, level at its border.
    fn bumpy() -> SupportField {
        let size = [12, 11];
        let height = |k: usize| {
            let (i, j) = (k % 12, k / 12);
            let inside = (3..9).contains(&i) && (3..8).contains(&j);
            if inside { 1e-3 * ((k as f64 * 12.9898).sin() * 43758.5453).fract() } else { 0.0 }
        };
        let up = DVec3::new(0.2, -0.4, 0.9).normalize();
        let along = up.any_orthonormal_vector();
        SupportField {
            origin: DVec3::new(0.3, 0.1, -0.2),
            axes: [along, up.cross(along), up],
            cell: 2e-3,
            size,
            heights: (0..132).map(height).collect(),
            friction: 0.0,
        }
    }

    #[test]
    fn gradient_and_curvature_are_the_heights_derivatives() {
        let field = bumpy();
        let mut steepest: f64 = 0.0;
        for k in 0..300 {
            let at = |f: f64| (k as f64 * f).fract();
            let [a, b, up] = field.axes;
            let p =
                field.origin + 2e-3 * (13.0 * at(0.617) - 1.0) * a + 2e-3 * (12.0 * at(0.137) - 1.0) * b + 1e-4 * up;
            let touch = field.contact(p);
            steepest = steepest.max((touch.gradient - up).length());
            let d = 1e-7;
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                let (more, less) = (field.contact(p + d * axis), field.contact(p - d * axis));
                let slope = (more.height - less.height) / (2.0 * d);
                assert!((slope - touch.gradient.dot(axis)).abs() < 1e-4, "{k}: {slope}, {}", touch.gradient);
                let bend = (more.gradient - less.gradient) / (2.0 * d);
                // The curvature jumps between cells.
                let jump = (more.curvature - less.curvature).abs_diff_eq(DMat3::ZERO, 1e-3);
                assert!(!jump || (bend - touch.curvature * axis).length() < 1e-3, "{k}: {bend}");
            }
        }
        assert!(steepest > 0.1, "the field is too level to tell: {steepest}");
    }
}
