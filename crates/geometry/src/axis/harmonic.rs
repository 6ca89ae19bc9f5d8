//! Harmonic fields on a tetrahedral mesh: linear finite elements, solved by conjugate gradients.

use crate::tet_mesh::adjacency::EDGES;
use crate::{Error, Result, TetMesh};
use rayon::prelude::*;

/// Conjugate gradients stop when the residual has decreased by this factor.
const TOLERANCE: f64 = 1e-7;

/// The stiffness matrix of Laplace's equation: K_ij is the integral of grad phi_i . grad phi_j (m).
/// Off-diagonal entries are stored in compressed rows.
pub(super) struct Stiffness {
    starts: Vec<usize>,
    columns: Vec<u32>,
    entries: Vec<f64>,
    diagonal: Vec<f64>,
}

impl Stiffness {
    /// Assembles the matrix. Rejects a mesh without elements, or with an element without positive
    /// volume.
    pub(super) fn of(mesh: &TetMesh) -> Result<Self> {
        if mesh.tets.is_empty() {
            return Err(Error::Mesh("the tetrahedral mesh has no elements; an organ axis needs at least one".into()));
        }
        let edges = mesh.edges();
        let nodes = mesh.vertices.len();
        let mut starts = vec![0; nodes + 1];
        for &node in edges.iter().flatten() {
            starts[node as usize + 1] += 1;
        }
        for i in 0..nodes {
            starts[i + 1] += starts[i];
        }
        // Edges are sorted, so filling the lower half of all rows before the upper half leaves each
        // row sorted.
        let mut fill = starts.clone();
        let mut columns = vec![0; 2 * edges.len()];
        for half in [[1, 0], [0, 1]] {
            for edge in &edges {
                let [row, column] = half.map(|end: usize| edge[end]);
                columns[fill[row as usize]] = column;
                fill[row as usize] += 1;
            }
        }
        let entries = vec![0.0; columns.len()];
        let mut matrix = Self { starts, columns, entries, diagonal: vec![0.0; nodes] };
        for (t, tet) in mesh.tets.iter().enumerate() {
            let volume = mesh.tet_volume(t);
            if !(volume > 0.0 && volume.is_finite()) {
                return Err(Error::Mesh(format!("element {t} has volume {volume} m3; it must be positive")));
            }
            let [a, b, c, d] = mesh.corners(t);
            let [b, c, d] = [b - a, c - a, d - a];
            let gradients = [c.cross(d), d.cross(b), b.cross(c)].map(|normal| normal / (6.0 * volume));
            let gradients = [-(gradients[0] + gradients[1] + gradients[2]), gradients[0], gradients[1], gradients[2]];
            for [i, j] in EDGES {
                let value = volume * gradients[i].dot(gradients[j]);
                matrix.add(tet[i], tet[j], value);
                matrix.add(tet[j], tet[i], value);
            }
            for i in 0..4 {
                matrix.diagonal[tet[i] as usize] += volume * gradients[i].length_squared();
            }
        }
        Ok(matrix)
    }

    /// Number of nodes.
    pub(super) fn nodes(&self) -> usize {
        self.diagonal.len()
    }

    /// The nodes that share an edge with `node`, each with the index of its entry.
    pub(super) fn row(&self, node: usize) -> impl Iterator<Item = (usize, usize)> {
        (self.starts[node]..self.starts[node + 1]).map(|entry| (entry, self.columns[entry] as usize))
    }

    /// Length of the edge of each entry (m).
    pub(super) fn edge_lengths(&self, mesh: &TetMesh) -> Vec<f64> {
        (0..self.nodes())
            .flat_map(|i| self.row(i).map(move |(_, j)| mesh.vertices[i].distance(mesh.vertices[j])))
            .collect()
    }

    /// The harmonic field with the `fixed` values, from the initial guess `guess`. Each value is in
    /// [0, 1].
    ///
    /// Conjugate gradients with a diagonal preconditioner. Sums have a fixed order, so the result
    /// is the same for any number of threads.
    pub(super) fn solve(&self, fixed: &[Option<f64>], guess: Vec<f64>) -> Vec<f64> {
        let mut u: Vec<f64> = fixed.iter().zip(guess).map(|(fixed, guess)| fixed.unwrap_or(guess)).collect();
        let free = |i: usize| fixed[i].is_none();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut product = vec![0.0; u.len()];
        self.multiply(&u, &mut product);
        let mut residual: Vec<f64> = (0..u.len()).map(|i| if free(i) { -product[i] } else { 0.0 }).collect();
        let mut scaled: Vec<f64> = residual.iter().zip(&self.diagonal).map(|(r, d)| r / d).collect();
        let mut direction = scaled.clone();
        let mut rho = dot(&residual, &scaled);
        let target = rho * TOLERANCE * TOLERANCE;
        for _ in 0..self.nodes() {
            if rho <= target {
                break;
            }
            self.multiply(&direction, &mut product);
            let step = rho / dot(&direction, &product);
            for i in (0..u.len()).filter(|&i| free(i)) {
                u[i] += step * direction[i];
                residual[i] -= step * product[i];
                scaled[i] = residual[i] / self.diagonal[i];
            }
            let next = dot(&residual, &scaled);
            let turn = next / rho;
            rho = next;
            for (direction, scaled) in direction.iter_mut().zip(&scaled) {
                *direction = scaled + turn * *direction;
            }
        }
        // With obtuse elements the discrete field may overshoot its bounds slightly.
        u.iter_mut().for_each(|u| *u = u.clamp(0.0, 1.0));
        u
    }

    fn add(&mut self, row: u32, column: u32, value: f64) {
        let range = self.starts[row as usize]..self.starts[row as usize + 1];
        if let Ok(place) = self.columns[range.clone()].binary_search(&column) {
            self.entries[range.start + place] += value;
        }
    }

    fn multiply(&self, x: &[f64], product: &mut [f64]) {
        product.par_iter_mut().with_min_len(4096).enumerate().for_each(|(i, sum)| {
            *sum = self.diagonal[i] * x[i] + self.row(i).map(|(entry, j)| self.entries[entry] * x[j]).sum::<f64>();
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn a_linear_field_is_reproduced() {
        // A 3 x 3 x 3 block of cubes of six tets each, with perturbed inner nodes. Linear functions
        // are harmonic, and the elements represent them exactly.
        let n = 4;
        let at = |i: usize| DVec3::new((i % n) as f64, (i / n % n) as f64, (i / n / n) as f64);
        let inside = |p: DVec3| p.min_element() > 0.0 && p.max_element() < 3.0;
        let vertices: Vec<DVec3> = (0..n * n * n)
            .map(|i| {
                if inside(at(i)) {
                    at(i) + 0.2 * DVec3::new((i as f64).sin(), (2.0 * i as f64).cos(), 0.3)
                } else {
                    at(i)
                }
            })
            .collect();
        let mut tets = Vec::new();
        for base in (0..n * n * n).filter(|&i| at(i).max_element() < 3.0) {
            let c = [0, 1, n, n + 1, n * n, n * n + 1, n * n + n, n * n + n + 1].map(|o| (base + o) as u32);
            for t in [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]] {
                tets.push(t.map(|i: usize| c[i]));
            }
        }
        let mesh = TetMesh { vertices, tets };
        assert_eq!(mesh.inverted(), 0);
        let truth = |p: DVec3| (p.x + 2.0 * p.y + 0.5 * p.z) / 12.0;
        let fixed: Vec<Option<f64>> = mesh.vertices.iter().map(|&p| (!inside(p)).then(|| truth(p))).collect();
        let u = Stiffness::of(&mesh).unwrap().solve(&fixed, vec![0.5; mesh.vertices.len()]);
        let worst = mesh.vertices.iter().zip(&u).map(|(&p, u)| (u - truth(p)).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-6, "{worst}");
    }
}
