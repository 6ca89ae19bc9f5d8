//! What differs from the factor, as a low-rank update of the inverse.
//!
//! The factor contains the stiffness at rest and that of the nodes that pressed when it was made.
//! Contacts that are new, harder or lost, that slide, and elements that are far stiffer than at
//! rest differ from it by springs on a few nodes: a matrix U K U' of low rank. With A = L L'
//! Woodbury's formula (Hager 1989, "Updating the inverse of a matrix") becomes
//! (A + U K U')^-1 = L'^-1 (1 - V (K^-1 + V'V)^-1 V') L^-1 with V = L^-1 U: a correction between
//! the two halves of a solve.
//!
//! V is made of the columns of nodes ([`HalfColumns`]). They are kept in the tissue's rest frame
//! until the factor changes, and stay valid however the tissue turns. Springs that come, go, turn
//! or harden need no other solve.

use super::column_cache::{ColumnCache, MAX_COLUMNS, MAX_NODES};
use super::dense::{decompose, solve};
use super::factor::Factor;
use super::springs::{Springs, Term};
use crate::threads::for_each_with;
use fearless_simd::{Level, dispatch};

/// Greatest number of springs in the update.
const MAX_SPRINGS: usize = 256;

/// Fewest springs whose matrix several threads build, and the ends of parts of a triangle's columns
/// that are as much work, 1 - sqrt(1 - k/4).
const MIN_PARTED: usize = 48;
const EVEN_ENDS: [f64; 4] = [0.134, 0.293, 0.5, 1.0];

/// Columns that are built side by side.
const LANES: usize = 8;

/// Room to build columns in.
struct BuildRoom {
    /// Products of a spring with all columns of the factor.
    sums: Vec<f64>,
    /// The same of several springs, with the columns in use.
    of_columns: Vec<[f64; LANES]>,
    /// The numbers of the columns, by row.
    rows: Vec<[f64; LANES]>,
}

impl BuildRoom {
    fn new() -> Self {
        Self {
            sums: Vec::with_capacity(MAX_COLUMNS),
            of_columns: Vec::with_capacity(MAX_COLUMNS),
            rows: Vec::with_capacity(MAX_SPRINGS),
        }
    }
}

/// The difference between the matrix now and the factor.
pub(super) struct LowRankUpdate {
    /// The springs.
    springs: Springs,
    /// The place of each of their terms' nodes.
    places: Vec<usize>,
    columns: ColumnCache,
    /// K^-1 + V'V as L D L', by columns: what is below the diagonal of L, and D on it.
    matrix: Vec<f64>,
    /// Scratch, by part of the matrix.
    rooms: [BuildRoom; EVEN_ENDS.len()],
    /// Scratch: one number a spring.
    shares: Vec<f64>,
    /// Scratch: one number a column.
    of_columns: Vec<f64>,
    /// Scratch: nodes of springs.
    nodes: Vec<u32>,
    /// Whether the matrix is that of a sum that is positive definite.
    usable: bool,
}

impl LowRankUpdate {
    /// An empty one.
    pub fn new() -> Self {
        Self {
            springs: Springs::with_capacity(MAX_SPRINGS),
            places: Vec::with_capacity(3 * MAX_SPRINGS),
            columns: ColumnCache::new(),
            matrix: vec![0.0; MAX_SPRINGS * MAX_SPRINGS],
            rooms: std::array::from_fn(|_| BuildRoom::new()),
            shares: Vec::with_capacity(MAX_SPRINGS),
            of_columns: vec![0.0; MAX_COLUMNS],
            nodes: Vec::with_capacity(MAX_NODES + 12),
            usable: false,
        }
    }

    /// Forgets everything: the factor has changed.
    pub fn clear(&mut self) {
        self.columns.clear();
        self.reset();
    }

    /// Makes the update empty.
    pub fn reset(&mut self) {
        self.springs.clear();
        self.usable = false;
    }

    /// What the update adds to the stiffness of a node that has one stiffness in all directions
    /// (N/m).
    pub fn added(&self, node: u32) -> f32 {
        if !self.usable {
            return 0.0;
        }
        let own = |range: std::ops::Range<usize>| self.springs.terms()[range].iter().all(|term| term.node == node);
        let springs = self.springs.ranges().filter(|(_, range)| own(range.clone()));
        springs.map(|(stiffness, _)| stiffness).sum::<f32>() / 3.0
    }

    /// Sets the springs. Those that are added come first. Those that are taken away follow; they
    /// are no stiffer than what the factor has there. Springs beyond the limits are removed from
    /// the list.
    pub fn set(&mut self, level: Level, factor: &Factor, springs: &mut Springs) {
        self.limit(springs);
        if springs.are_like(&self.springs) {
            return;
        }
        self.springs.copy_from(springs);
        let Self { springs, places, columns, nodes, .. } = self;
        columns.use_nodes(level, factor, nodes);
        // Every node is in the list.
        let number = |term: &Term| nodes.iter().position(|node| *node == term.node).unwrap_or(0);
        places.clear();
        places.extend(springs.terms().iter().map(|term| columns.used()[number(term)]));
        self.usable = self.factorise(level);
    }

    /// Removes springs beyond the greatest number of springs, and those beyond the greatest number
    /// of nodes. Lists the nodes of the others.
    fn limit(&mut self, springs: &mut Springs) {
        springs.truncate(MAX_SPRINGS);
        let Self { nodes, .. } = self;
        nodes.clear();
        let mut kept = 0;
        for (_, range) in springs.ranges() {
            let before = nodes.len();
            for term in &springs.terms()[range] {
                if !nodes.contains(&term.node) {
                    nodes.push(term.node);
                }
            }
            if nodes.len() > MAX_NODES {
                nodes.truncate(before);
                break;
            }
            kept += 1;
        }
        springs.truncate(kept);
    }

    /// Builds the matrix of the springs and its L D L'. False if the sum is not positive definite.
    fn factorise(&mut self, level: Level) -> bool {
        let n = self.springs.len();
        if n == 0 {
            return false;
        }
        self.build(level);
        let Self { matrix, springs, .. } = self;
        dispatch!(level, _simd => decompose(matrix, n));
        // Springs that are taken away make D negative there, added ones positive: it is
        // quasi-definite.
        let positive = |(j, (stiffness, _)): (usize, (f32, _))| matrix[j * n + j] * f64::from(stiffness) > 0.0;
        springs.ranges().enumerate().all(positive)
    }

    /// K^-1 + V'V, from the diagonal down.
    fn build(&mut self, level: Level) {
        let Self { springs, places, columns, matrix, rooms, .. } = self;
        let (n, columns) = (springs.len(), &*columns);
        let (ends, used) = if n < MIN_PARTED { ([1.0; 4], 1) } else { (EVEN_ENDS, EVEN_ENDS.len()) };
        let mut parts: [(usize, &mut [f64]); EVEN_ENDS.len()] = Default::default();
        let (mut rest, mut first) = (&mut matrix[..n * n], 0);
        for (part, end) in parts.iter_mut().zip(ends) {
            let end = (end * n as f64) as usize;
            let (numbers, others) = rest.split_at_mut(n * (end - first));
            *part = (first, numbers);
            (rest, first) = (others, end);
        }
        for_each_with(&mut parts[..used], rooms, |(first, numbers), room| {
            dispatch!(level, _simd => for (k, numbers) in numbers.chunks_mut(LANES * n).enumerate() {
                build_columns(springs, places, columns, *first + LANES * k, room, numbers);
            });
        });
    }

    /// Turns `y`, solved by half with the factor, into that of the sum.
    pub fn apply(&mut self, level: Level, y: &mut [f32]) {
        if !self.usable {
            return;
        }
        let Self { springs, places, columns, matrix, shares, of_columns, .. } = self;
        let terms = springs.terms();
        columns.multiply(level, y, of_columns);
        shares.clear();
        shares.extend(springs.ranges().map(|(_, range)| along(&terms[range.clone()], &places[range], of_columns)));
        dispatch!(level, _simd => solve(matrix, shares));
        of_columns[..columns.len()].fill(0.0);
        for (share, (_, range)) in shares.iter().zip(springs.ranges()) {
            for (term, place) in terms[range.clone()].iter().zip(&places[range]) {
                let sums = &mut of_columns[3 * place..3 * place + 3];
                sums.iter_mut().zip(term.along).for_each(|(sum, along)| *sum += share * f64::from(along));
            }
        }
        columns.subtract(level, of_columns, y);
    }
}

/// Columns of K^-1 + V'V from the one of number `first` on, at most [`LANES`], from row `first`
/// down. What is above the diagonal is not read.
#[inline(always)]
fn build_columns(
    springs: &Springs,
    places: &[usize],
    columns: &ColumnCache,
    first: usize,
    BuildRoom { sums, of_columns, rows }: &mut BuildRoom,
    numbers: &mut [f64],
) {
    let (terms, n) = (springs.terms(), springs.len());
    let count = numbers.len() / n;
    sums.resize(columns.len(), 0.0);
    of_columns.resize(columns.len().max(of_columns.len()), [0.0; LANES]);
    for lane in 0..count {
        // All columns of the factor times this spring's.
        let (_, range) = springs.range(first + lane);
        sums.fill(0.0);
        for (term, place) in terms[range.clone()].iter().zip(&places[range]) {
            for (c, along) in term.along.iter().enumerate() {
                let products = columns.products(*place, c);
                sums.iter_mut().zip(products).for_each(|(sum, product)| *sum += f64::from(*along) * product);
            }
        }
        for place in columns.used() {
            (3 * place..3 * place + 3).for_each(|column| of_columns[column][lane] = sums[column]);
        }
    }
    rows.clear();
    for i in first..n {
        let (_, range) = springs.range(i);
        let mut row = [0.0; LANES];
        for (term, place) in terms[range.clone()].iter().zip(&places[range]) {
            for (along, lanes) in term.along.iter().zip(&of_columns[3 * place..3 * place + 3]) {
                row.iter_mut().zip(lanes).for_each(|(sum, number)| *sum += f64::from(*along) * number);
            }
        }
        rows.push(row);
    }
    for (lane, column) in numbers.chunks_exact_mut(n).enumerate() {
        column[first..].iter_mut().zip(&*rows).for_each(|(number, row)| *number = row[lane]);
        column[first + lane] += 1.0 / f64::from(springs.range(first + lane).0);
    }
}

/// Product of a spring's vectors and a vector of one number for each column.
#[inline(always)]
fn along(terms: &[Term], places: &[usize], of_columns: &[f64]) -> f64 {
    let mut sum = 0.0;
    for (term, place) in terms.iter().zip(places) {
        let numbers = &of_columns[3 * place..3 * place + 3];
        for (along, number) in term.along.iter().zip(numbers) {
            sum += f64::from(*along) * number;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::{LowRankUpdate, along};
    use crate::quasi_newton::factor::Factor;
    use crate::quasi_newton::springs::{Springs, Term};
    use crate::{BodyDescription, ConstitutiveModel, Isa, Material, Model, ModelBuilder};
    use fearless_simd::dispatch;
    use glam::Vec3A;
    use trocar_testing::blocks::block;

    fn model(cells: [usize; 3]) -> Model {
        let mesh = block(cells, 2e-3);
        let pinned = (0..mesh.vertices.len() as u32).filter(|i| mesh.vertices[*i as usize].z < 1e-3).collect();
        let material = Material {
            model: ConstitutiveModel::StableNeoHookean,
            young_modulus: 12e3,
            poisson_ratio: 0.45,
            density: 1200.0,
            viscosity: 0.0,
        };
        let mut builder = ModelBuilder::new();
        let body = BodyDescription { name: "block".into(), mesh: &mesh, material, pinned, supports: vec![] };
        builder.body(body).unwrap();
        builder.build().unwrap()
    }

    /// The matrix has the bits of products one by one, whether or not it is built in parts and
    /// columns fill them.
    #[test]
    fn columns_side_by_side_have_the_same_bits() {
        let model = model([4, 4, 6]);
        let level = Isa::detect().level();
        let mut factor = Factor::new(&model.bodies[0], 1e-2).unwrap();
        let free = factor.order.len();
        factor.set_step(&vec![1e-3; free], 1e-2);
        assert!(factor.factorise(level, &vec![false; free], &vec![0.0; free]));
        for (n, threads) in [1, 8, 9, 47, 48, 100].into_iter().flat_map(|n| [(n, 1), (n, 2)]) {
            let mut springs = Springs::with_capacity(0);
            for k in 0..n {
                let along = [1.0, 0.1 * k as f32, -0.3];
                let term =
                    |node: usize, share: f32| Term { node: (node % free) as u32, along: along.map(|u| share * u) };
                springs.push(50.0 + k as f32, [term(7 * k, 1.0), term(11 * k + 3, 0.4)].into_iter().take(1 + k % 2));
            }
            let mut update = LowRankUpdate::new();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                update.set(level, &factor, &mut springs);
                update.build(level);
            });
            assert_eq!(update.springs.len(), n);
            let LowRankUpdate { springs, places, columns, matrix, .. } = &update;
            let terms = springs.terms();
            for j in 0..n {
                let (stiffness, range) = springs.range(j);
                let mut of_columns = vec![0.0; columns.len()];
                for (term, place) in terms[range.clone()].iter().zip(&places[range]) {
                    for (c, along) in term.along.iter().enumerate() {
                        let products = columns.products(*place, c).iter();
                        of_columns.iter_mut().zip(products).for_each(|(sum, p)| *sum += f64::from(*along) * p);
                    }
                }
                for i in j..n {
                    let (_, range) = springs.range(i);
                    let product = along(&terms[range.clone()], &places[range], &of_columns);
                    let number = product + if i == j { 1.0 / f64::from(stiffness) } else { 0.0 };
                    assert_eq!(matrix[j * n + i].to_bits(), number.to_bits(), "{i} {j} of {n}, {threads} threads");
                }
            }
        }
    }

    /// Nodes that press in the factor and now, softly or hard, a node that no longer does, and
    /// springs between nodes: a solve with the update is that with a factor of all that.
    #[test]
    fn an_updated_solve_is_that_of_the_sum() {
        // The tree of the larger one is cut into parts.
        for cells in [[4, 4, 6], [14, 14, 24]] {
            let model = model(cells);
            let level = Isa::detect().level();
            let factors = || {
                let mut factor = Factor::new(&model.bodies[0], 1e-2).unwrap();
                let masses = vec![1e-3; factor.order.len()];
                factor.set_step(&masses, 1e-2);
                factor
            };
            let (mut before, mut after) = (factors(), factors());
            let free = before.order.len();
            let held = vec![false; free];
            let stiffness = 400.0;
            // Nodes in the order of elimination: the first ones, and some that come last.
            let nodes = [1, free / 3, free / 2, free - 40, free - 2];
            let mut supports = vec![0.0; free];
            (supports[nodes[0]], supports[nodes[1]]) = (stiffness, stiffness);
            assert!(before.factorise(level, &held, &supports));
            supports[nodes[0]] = 0.0;
            supports[nodes[1]] = 25.0 * stiffness;
            nodes[2..].iter().for_each(|i| supports[*i] = stiffness);
            assert!(after.factorise(level, &held, &supports));
            let mut springs = Springs::with_capacity(0);
            springs.push_alike(24.0 * stiffness, nodes[1] as u32);
            springs.push_alike(stiffness, nodes[2] as u32);
            // Three springs at right angles are one that is alike in all directions.
            let along = [[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]];
            along.into_iter().for_each(|along| springs.push(stiffness, [Term { node: nodes[3] as u32, along }]));
            springs.push_alike(-stiffness, nodes[0] as u32);
            springs.push_alike(stiffness, nodes[4] as u32);
            let right: Vec<f32> = (0..3 * free).map(|i| ((7 * i) % 11) as f32 - 5.0).collect();
            let [mut x, mut y, mut without] = [(); 3].map(|()| [&right[..], &[0.0; 16]].concat());
            let mut update = LowRankUpdate::new();
            update.set(level, &before, &mut springs);
            dispatch!(level, simd => {
                before.forward(simd, &mut x, true);
                update.apply(level, &mut x);
                before.backward(simd, &mut x, true);
                before.forward(simd, &mut without, true);
                before.backward(simd, &mut without, true);
                after.forward(simd, &mut y, true);
                after.backward(simd, &mut y, true);
            });
            let most = y.iter().fold(0.0f32, |most, y| most.max(y.abs()));
            let off = |x: &[f32]| x.iter().zip(&y).fold(0.0f32, |most, (x, y)| most.max((x - y).abs())) / most;
            let (error, change) = (off(&x), off(&without));
            assert!(error < 2e-3 && change > 10.0 * error, "{cells:?}: off by {error}, by {change} without the update");
            // Springs between nodes are not in any factor: the solution has to fulfil its equation.
            supports[nodes[1]] = stiffness;
            let between =
                [(1, 0.5), (2, 0.3), (4, 0.2)].map(|(k, share)| Term { node: nodes[k] as u32, along: [share; 3] });
            springs.clear();
            springs.push(25.0 * stiffness, between);
            springs.push(stiffness, between[..2].iter().map(|term| Term { along: [0.6, -0.8, 0.1], ..*term }));
            springs.push(-stiffness, [Term { node: nodes[0] as u32, along: [0.0, 0.6, 0.8] }]);
            let mut x = [&right[..], &[0.0; 16]].concat();
            update.set(level, &before, &mut springs);
            dispatch!(level, simd => {
                before.forward(simd, &mut x, true);
                update.apply(level, &mut x);
                before.backward(simd, &mut x, true);
            });
            let at = |i: usize| Vec3A::from_slice(&x[3 * i..]);
            let mut product = vec![Vec3A::ZERO; free];
            before.multiply(at, &mut product);
            product[nodes[0]] += stiffness * at(nodes[0]);
            product[nodes[1]] += stiffness * at(nodes[1]);
            let without = product.clone();
            for (stiffness, range) in springs.ranges() {
                let terms = &springs.terms()[range];
                let off: f32 = terms.iter().map(|term| Vec3A::from(term.along).dot(at(term.node as usize))).sum();
                for term in terms {
                    product[term.node as usize] += stiffness * off * Vec3A::from(term.along);
                }
            }
            let off = |product: &[Vec3A]| {
                let rights = right.chunks_exact(3).map(Vec3A::from_slice);
                product.iter().zip(rights).fold(0.0f32, |most, (a, b)| most.max((*a - b).length()))
            };
            let (error, change) = (off(&product), off(&without));
            assert!(
                error < 0.05 && change > 10.0 * error,
                "{cells:?}: off by {error} N, by {change} N without springs"
            );
        }
    }
}
