//! The shape of a body at the end of a frame: inverted elements, volume ratios, edges that are far
//! too long.
//!
//! It is measured from the positions alone, with nothing that a solver knows, sixteen elements or
//! edges at a time.

use crate::lanes::{LANES, Row, cross, dot, gather, load, splat, sub};
use crate::state::BodyState;
use crate::threads::in_parts;
use crate::{Body, Isa};
use fearless_simd::{Level, Simd, SimdBase, dispatch};
use glam::DVec3;

/// An edge of more than this many rest lengths has diverged.
pub(crate) const STRETCH_LIMIT: f32 = 10.0;

/// Batches that are worth a thread of their own, and the most parts of them.
const MIN_PART: usize = 800;
const MAX_PARTS: usize = 8;

/// What is measured of a body's shape.
#[derive(Clone, Copy)]
pub(crate) struct Shape {
    /// Whether all positions are numbers; nothing else is measured if not.
    pub finite: bool,
    pub inverted: usize,
    pub min_volume_ratio: f64,
    /// Whether an edge is too long.
    pub stretched: bool,
}

/// Measures the shape of one body. It knows the last shape: most bodies have not moved since the
/// last frame.
pub(crate) struct ShapeMeter {
    level: Level,
    /// The elements; none of a body in a lattice, where tetrahedra bear nothing.
    elements: Vec<Elements>,
    edges: Vec<Edges>,
    /// Number of elements.
    count: usize,
    /// Where the body was last (m).
    x: Vec<Row>,
    /// Of its lattice, if it has one.
    nodes: Vec<DVec3>,
    shape: Option<Shape>,
}

/// Sixteen elements; the last ones are filled up with their first.
struct Elements {
    corners: [[u32; LANES]; 4],
    /// 1 / (6 V) of the rest volumes V (1/m3).
    inverse_6v: [f32; LANES],
}

/// Sixteen edges; the last ones are filled up with their first.
struct Edges {
    ends: [[u32; LANES]; 2],
    /// Squares of the greatest lengths (m2).
    most: [f32; LANES],
}

impl ShapeMeter {
    /// For one body.
    pub fn new(body: &Body) -> Self {
        let count = if body.lattice.is_some() { 0 } else { body.tets.len() };
        let numbers: Vec<usize> = (0..count).collect();
        // Every edge appears at both its ends.
        let edges: Vec<([usize; 2], f32)> = (0..body.len())
            .flat_map(|i| body.edges_of(i).iter().map(move |edge| ([i, edge.to as usize], edge.length)))
            .filter(|([from, to], _)| from < to)
            .collect();
        Self {
            level: Isa::detect().level(),
            elements: numbers.chunks(LANES).map(|chunk| Elements::new(body, chunk)).collect(),
            edges: edges.chunks(LANES).map(Edges::new).collect(),
            count,
            x: vec![[f32::NAN; 4]; body.vertex_count()],
            nodes: Vec::new(),
            shape: None,
        }
    }

    /// The shape of the body.
    pub fn measure(&mut self, body: &Body, state: &BodyState) -> Shape {
        let (mut same, mut finite) = (true, true);
        for (row, x) in self.x.iter_mut().zip(&state.x) {
            let now = x.extend(0.0).to_array();
            same &= now == *row;
            finite &= x.is_finite();
            *row = now;
        }
        let nodes = state.lattice.as_ref().map_or(&[][..], |lattice| &lattice.positions);
        if let Some(shape) = self.shape.filter(|_| same && self.nodes == nodes) {
            return shape;
        }
        self.nodes.clear();
        self.nodes.extend_from_slice(nodes);
        let shape = if finite { self.shape_of(body, state) } else { Shape { finite, ..Shape::NONE } };
        self.shape = Some(shape);
        shape
    }

    fn shape_of(&self, body: &Body, state: &BodyState) -> Shape {
        let Self { level, elements, edges, count, x, .. } = self;
        let volumes = match (&body.lattice, &state.lattice) {
            (Some(embedding), Some(lattice)) => {
                embedding.body.volume_ratios(&lattice.positions).fold(Shape::NONE, Shape::with_ratio)
            }
            _ => sum_of_parts(elements, |first, elements| {
                let left = count - first * LANES;
                dispatch!(*level, simd => volumes(simd, elements, x, left))
            }),
        };
        let lengths = sum_of_parts(edges, |_, edges| {
            let mut stretched = false;
            dispatch!(*level, simd => for batch in edges {
                stretched |= batch.is_stretched(simd, x);
            });
            Shape { stretched, ..Shape::NONE }
        });
        volumes.with(lengths)
    }
}

impl Elements {
    fn new(body: &Body, numbers: &[usize]) -> Self {
        let number = |lane: usize| *numbers.get(lane).unwrap_or(&numbers[0]);
        Self {
            corners: [0, 1, 2, 3].map(|corner| std::array::from_fn(|lane| body.tets[number(lane)][corner])),
            inverse_6v: std::array::from_fn(|lane| (1.0 / (6.0 * body.volumes[number(lane)])) as f32),
        }
    }
}

impl Edges {
    fn new(edges: &[([usize; 2], f32)]) -> Self {
        let edge = |lane: usize| *edges.get(lane).unwrap_or(&edges[0]);
        Self {
            ends: [0, 1].map(|end| std::array::from_fn(|lane| edge(lane).0[end] as u32)),
            most: std::array::from_fn(|lane| (STRETCH_LIMIT * edge(lane).1).powi(2)),
        }
    }

    /// Whether one of them is too long.
    #[inline(always)]
    fn is_stretched<S: Simd>(&self, simd: S, x: &[Row]) -> bool {
        let [from, to] = [gather(simd, x, &self.ends[0]), gather(simd, x, &self.ends[1])];
        let along = sub(to, from);
        simd.any_true_mask32x16(simd.simd_gt_f32x16(dot(along, along), load(simd, &self.most)))
    }
}

/// Volume ratios of batches, of which the first `left` elements count.
#[inline(always)]
fn volumes<S: Simd>(simd: S, elements: &[Elements], x: &[Row], left: usize) -> Shape {
    let zero = splat(simd, 0.0);
    let (mut least, mut inverted) = (splat(simd, f32::INFINITY), 0);
    for (b, batch) in elements.iter().enumerate() {
        let origin = gather(simd, x, &batch.corners[0]);
        let first = sub(gather(simd, x, &batch.corners[1]), origin);
        let second = sub(gather(simd, x, &batch.corners[2]), origin);
        let third = sub(gather(simd, x, &batch.corners[3]), origin);
        let ratio = dot(cross(first, second), third) * load(simd, &batch.inverse_6v);
        // Processors differ in the smaller of a number and NaN.
        least = simd.select_f32x16(simd.simd_lt_f32x16(ratio, least), ratio, least);
        if simd.any_true_mask32x16(simd.simd_le_f32x16(ratio, zero)) {
            let mut ratios = [0.0; LANES];
            ratio.store_slice(&mut ratios);
            inverted += ratios.iter().take(left - b * LANES).filter(|ratio| **ratio <= 0.0).count();
        }
    }
    let mut ratios = [0.0; LANES];
    least.store_slice(&mut ratios);
    let min_volume_ratio = f64::from(ratios.into_iter().fold(f32::INFINITY, f32::min));
    Shape { inverted, min_volume_ratio, ..Shape::NONE }
}

impl Shape {
    /// The shape of nothing.
    const NONE: Self = Self { finite: true, inverted: 0, min_volume_ratio: f64::INFINITY, stretched: false };

    /// The same with an element of that volume ratio.
    fn with_ratio(self, ratio: f64) -> Self {
        let inverted = self.inverted + usize::from(ratio <= 0.0);
        Self { inverted, min_volume_ratio: self.min_volume_ratio.min(ratio), ..self }
    }

    /// Both.
    fn with(self, other: Self) -> Self {
        Self {
            finite: self.finite && other.finite,
            inverted: self.inverted + other.inverted,
            min_volume_ratio: self.min_volume_ratio.min(other.min_volume_ratio),
            stretched: self.stretched || other.stretched,
        }
    }
}

/// The shape of all batches, part by part on the threads of the pool that calls; `of` is given the
/// number of a part's first one.
fn sum_of_parts<T: Sync>(batches: &[T], of: impl Fn(usize, &[T]) -> Shape + Send + Sync) -> Shape {
    let (mut parts, count) = ([Shape::NONE; MAX_PARTS], batches.len());
    let used = 1 << (count / MIN_PART).clamp(1, MAX_PARTS).ilog2();
    in_parts(&mut parts[..used], 1, |first, parts| {
        for (k, part) in (first..).zip(parts) {
            let begin = count * k / used;
            *part = of(begin, &batches[begin..count * (k + 1) / used]);
        }
    });
    parts.into_iter().fold(Shape::NONE, Shape::with)
}

#[cfg(test)]
mod tests {
    use super::{STRETCH_LIMIT, ShapeMeter};
    use crate::state::BodyState;
    use crate::{Body, BodyDescription, ConstitutiveModel, Material, ModelBuilder};
    use glam::Vec3A;
    use trocar_core::Random;
    use trocar_testing::blocks::block;

    fn body(cells: [usize; 3]) -> Body {
        let mesh = block(cells, 2e-3);
        let material = Material {
            model: ConstitutiveModel::StableNeoHookean,
            young_modulus: 12e3,
            poisson_ratio: 0.45,
            density: 1200.0,
            viscosity: 0.0,
        };
        let mut builder = ModelBuilder::new();
        builder
            .body(BodyDescription { name: "block".into(), mesh: &mesh, material, pinned: vec![], supports: vec![] })
            .unwrap();
        builder.build().unwrap().bodies[0].clone()
    }

    /// Elements in lanes are counted as one by one, in bodies of any size: as many threads as they
    /// are worth, and a last batch that is not full.
    #[test]
    fn elements_and_edges_are_those_counted_one_by_one() {
        for cells in [[1, 1, 1], [3, 3, 5], [16, 16, 20]] {
            let body = body(cells);
            let mut meter = ShapeMeter::new(&body);
            let mut state = BodyState::at_rest(&body);
            let shape = meter.measure(&body, &state);
            assert!(shape.finite && !shape.stretched && shape.inverted == 0);
            assert!((shape.min_volume_ratio - 1.0).abs() < 1e-4, "{}", shape.min_volume_ratio);

            let random = Random::from_keys(&[cells[2] as u64]);
            for (k, x) in state.x.iter_mut().enumerate() {
                let by = [0, 1, 2].map(|c| 0.8e-3 * random.normal(3 * k as u64 + c) as f32);
                *x += Vec3A::from(by);
            }
            let ratios: Vec<f64> = body
                .tets
                .iter()
                .zip(&body.volumes)
                .map(|(tet, volume)| {
                    let [a, b, c, d] = tet.map(|i| state.x[i as usize].as_dvec3());
                    (b - a).cross(c - a).dot(d - a) / 6.0 / volume
                })
                .collect();
            let shape = meter.measure(&body, &state);
            assert_eq!(shape.inverted, ratios.iter().filter(|ratio| **ratio <= 0.0).count(), "{cells:?}");
            let least = ratios.iter().fold(f64::INFINITY, |least, ratio| least.min(*ratio));
            assert!((shape.min_volume_ratio - least).abs() < 1e-4, "{} {least}", shape.min_volume_ratio);
            assert!(!shape.stretched);

            let last = state.x.len() - 1;
            state.x[last] += Vec3A::X * 2e-3 * STRETCH_LIMIT * 2.0;
            assert!(meter.measure(&body, &state).stretched);
            state.x[last].y = f32::NAN;
            assert!(!meter.measure(&body, &state).finite);
        }
    }
}
