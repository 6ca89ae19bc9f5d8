//! What a factor of an organ's size costs: analysis, numbers, and a solve. A grid of 40 x 20 x 10
//! nodes has as many as an organ of 40,000 tetrahedra. `cargo bench -p trocar-sparse`.

use divan::Bencher;
use glam::DMat3;
use trocar_sparse::{BlockMatrix, Cholesky, Level};

const SIDES: [u32; 3] = [40, 20, 10];

fn main() {
    divan::main();
}

/// A grid of nodes, joined by springs along axes and diagonals and held weakly.
fn grid() -> BlockMatrix {
    let index = |p: [u32; 3]| p[0] + SIDES[0] * (p[1] + SIDES[1] * p[2]);
    let nodes = (0..SIDES[2]).flat_map(|z| (0..SIDES[1]).flat_map(move |y| (0..SIDES[0]).map(move |x| [x, y, z])));
    let steps = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1], [1, 1, 1]];
    let pairs: Vec<(u32, u32)> = nodes
        .flat_map(|p| steps.map(|step| (p, [0, 1, 2].map(|c| p[c] + step[c]))))
        .filter(|(_, q)| (0..3).all(|c| q[c] < SIDES[c]))
        .map(|(p, q)| (index(p), index(q)))
        .collect();
    let mut matrix = BlockMatrix::new(SIDES.iter().product::<u32>() as usize, pairs.iter().copied());
    matrix.shift(0.01);
    for (a, b) in pairs {
        for (i, j, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
            matrix.add(i, j, DMat3::IDENTITY * sign);
        }
    }
    matrix
}

fn factorise(matrix: &BlockMatrix, factor: &mut Cholesky<f32>) -> bool {
    let blocks = matrix.blocks().map(|(_, _, block)| block.to_cols_array_2d().map(|column| column.map(|x| x as f32)));
    factor.factorise(Level::new(), blocks)
}

#[divan::bench(sample_count = 5)]
fn analyse(bencher: Bencher<'_, '_>) {
    let matrix = grid();
    bencher.bench(|| Cholesky::<f32>::new(&matrix));
}

/// On 1 thread and on 2.
#[divan::bench(args = [1, 2], sample_count = 10)]
fn numbers(bencher: Bencher<'_, '_>, threads: usize) {
    let matrix = grid();
    let mut factor = Cholesky::new(&matrix);
    let Ok(pool) = rayon::ThreadPoolBuilder::new().num_threads(threads).build() else { return };
    bencher.bench_local(|| pool.install(|| factorise(&matrix, &mut factor)));
}

#[divan::bench(sample_count = 10)]
fn solve(bencher: Bencher<'_, '_>) {
    let matrix = grid();
    let mut factor = Cholesky::new(&matrix);
    factorise(&matrix, &mut factor);
    let mut x = vec![1.0; 3 * matrix.len()];
    bencher.bench_local(|| factor.solve(Level::new(), &mut x));
}
