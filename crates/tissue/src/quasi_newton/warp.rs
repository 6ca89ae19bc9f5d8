//! The rotation of the tissue around each node. It turns a residual into the frame in which the
//! stiffness at rest is valid (stiffness warping, Mueller and others 2002).

use super::layout::Layout;
use crate::lanes::{LANES, Mat3L, Row, apply, apply_transposed, load, load_rows, rotation, store_rows};
use crate::threads::in_parts;
use fearless_simd::{Level, Simd, SimdBase, dispatch, f32x4};

/// Sixteen nodes' rotations.
#[derive(Clone)]
#[repr(C, align(64))]
struct Sixteen {
    columns: [[[f32; LANES]; 3]; 3],
}

/// Rotations of a body's free nodes.
pub(super) struct Warp {
    nodes: Vec<Sixteen>,
}

/// Fewest groups of sixteen nodes that are worth a thread of their own.
const MIN_GROUPS: usize = 64;

/// A neighbourhood squeezed below this volume ratio has no reliable rotation.
const MIN_VOLUME_RATIO: f32 = 0.01;

impl Warp {
    pub fn new(layout: &Layout) -> Self {
        let none = Sixteen { columns: [[[0.0; LANES]; 3]; 3] };
        Self { nodes: vec![none; layout.rows / LANES] }
    }

    /// Computes the rotations at `x` from scratch: they do not depend on the past.
    pub fn update(&mut self, level: Level, layout: &Layout, x: &[Row]) {
        in_parts(&mut self.nodes, MIN_GROUPS, |first, nodes| {
            dispatch!(level, simd => update(simd, layout, x, first, nodes));
        });
    }

    /// Turns one vector of a node into its rest frame.
    pub fn turn_back(&self, node: u32, v: [f32; 3]) -> [f32; 3] {
        let (columns, lane) = (&self.nodes[node as usize / LANES].columns, node as usize % LANES);
        std::array::from_fn(|c| (0..3).map(|k| columns[c][k][lane] * v[k]).sum())
    }

    /// Turns rows into the nodes' rest frames, three numbers a node.
    #[inline(always)]
    pub fn to_rest<S: Simd>(&self, simd: S, rows: &[Row], out: &mut [f32]) {
        for (group, sixteen) in self.nodes.iter().enumerate() {
            let v = load_rows(simd, &rows[group * LANES..(group + 1) * LANES]);
            let turned = apply_transposed(&sixteen.load(simd), v);
            let mut parts = [[0.0f32; LANES]; 3];
            turned[0].store_slice(&mut parts[0]);
            turned[1].store_slice(&mut parts[1]);
            turned[2].store_slice(&mut parts[2]);
            let out = &mut out[3 * group * LANES..3 * (group + 1) * LANES];
            for lane in 0..LANES {
                out[3 * lane] = parts[0][lane];
                out[3 * lane + 1] = parts[1][lane];
                out[3 * lane + 2] = parts[2][lane];
            }
        }
    }

    /// Turns the numbers back into rows.
    #[inline(always)]
    pub fn out_of_rest<S: Simd>(&self, simd: S, numbers: &[f32], rows: &mut [Row]) {
        for (group, sixteen) in self.nodes.iter().enumerate() {
            let mut parts = [[0.0f32; LANES]; 3];
            let numbers = &numbers[3 * group * LANES..3 * (group + 1) * LANES];
            for lane in 0..LANES {
                parts[0][lane] = numbers[3 * lane];
                parts[1][lane] = numbers[3 * lane + 1];
                parts[2][lane] = numbers[3 * lane + 2];
            }
            let v = [load(simd, &parts[0]), load(simd, &parts[1]), load(simd, &parts[2])];
            store_rows(simd, apply(&sixteen.load(simd), v), &mut rows[group * LANES..(group + 1) * LANES]);
        }
    }
}

impl Sixteen {
    #[inline(always)]
    fn load<S: Simd>(&self, simd: S) -> Mat3L<S> {
        let [a, b, c] = &self.columns;
        [
            [load(simd, &a[0]), load(simd, &a[1]), load(simd, &a[2])],
            [load(simd, &b[0]), load(simd, &b[1]), load(simd, &b[2])],
            [load(simd, &c[0]), load(simd, &c[1]), load(simd, &c[2])],
        ]
    }
}

/// Computes the rotations of `nodes`, of which the first has this number, at `x`.
#[inline(always)]
fn update<S: Simd>(simd: S, layout: &Layout, x: &[Row], first: usize, nodes: &mut [Sixteen]) {
    for (k, sixteen) in nodes.iter_mut().enumerate() {
        let group = first + k;
        // Rows of F by lane; the identity for what fills the last group up.
        let mut f = [[[0.0; 4]; LANES]; 3];
        for lane in 0..LANES {
            let i = group * LANES + lane;
            if i >= layout.free {
                f[0][lane][0] = 1.0;
                f[1][lane][1] = 1.0;
                f[2][lane][2] = 1.0;
                continue;
            }
            let here = f32x4::from_slice(simd, &x[i]);
            let mut columns = [f32x4::splat(simd, 0.0); 3];
            for k in layout.first_neighbour[i] as usize..layout.first_neighbour[i + 1] as usize {
                let offset = f32x4::from_slice(simd, &x[layout.neighbours[k] as usize]) - here;
                let weight = &layout.weights[k];
                columns[0] += offset * weight[0];
                columns[1] += offset * weight[1];
                columns[2] += offset * weight[2];
            }
            columns[0].store_slice(&mut f[0][lane]);
            columns[1].store_slice(&mut f[1][lane]);
            columns[2].store_slice(&mut f[2][lane]);
        }
        let f = [load_rows(simd, &f[0]), load_rows(simd, &f[1]), load_rows(simd, &f[2])];
        let r = rotation(simd, &f, MIN_VOLUME_RATIO);
        for c in 0..3 {
            for k in 0..3 {
                r[c][k].store_slice(&mut sixteen.columns[c][k]);
            }
        }
    }
}
