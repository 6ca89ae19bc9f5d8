//! The factor against dense arithmetic, and its bits over threads and instruction sets.

use glam::{DMat3, DVec3};
use trocar_sparse::{BlockMatrix, Cholesky, Level};

/// A number in -1..1 for each counter.
fn noise(k: usize) -> f64 {
    2.0 * ((k as f64 * 12.9898).sin() * 43758.5453).rem_euclid(1.0) - 1.0
}

/// A grid of `n` nodes a side, each joined to the nodes around it by an anisotropic spring, with
/// every seventh node left out and some nodes joined to nothing.
fn grid(n: [usize; 3], ground: f64) -> BlockMatrix {
    let index = |p: [usize; 3]| p[0] + n[0] * (p[1] + n[1] * p[2]);
    let places: Vec<[usize; 3]> =
        (0..n[2]).flat_map(|z| (0..n[1]).flat_map(move |y| (0..n[0]).map(move |x| [x, y, z]))).collect();
    let mut pairs = Vec::new();
    for (a, p) in places.iter().enumerate().filter(|(a, _)| a % 7 != 3) {
        for step in [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1], [1, 1, 1]] {
            let q = [p[0] + step[0], p[1] + step[1], p[2] + step[2]];
            if (0..3).all(|c| q[c] < n[c]) && index(q) % 7 != 3 {
                pairs.push((a as u32, index(q) as u32));
            }
        }
    }
    let mut matrix = BlockMatrix::new(places.len(), pairs.iter().copied());
    for i in 0..places.len() as u32 {
        matrix.add(i, i, DMat3::from_diagonal(DVec3::new(1.0, 1.5, 2.0)) * ground);
    }
    for (k, (a, b)) in pairs.into_iter().enumerate() {
        let d = DVec3::new(noise(3 * k), noise(3 * k + 1), noise(3 * k + 2));
        let block = DMat3::from_cols(d * d.x, d * d.y, d * d.z) + DMat3::IDENTITY * 0.3;
        for (i, j, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
            matrix.add(i, j, block * sign);
        }
    }
    matrix
}

/// A x.
fn product(matrix: &BlockMatrix, x: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; x.len()];
    let mut add = |i: u32, j: u32, block: DMat3| {
        let y = block * DVec3::from_slice(&x[3 * j as usize..]);
        (0..3).for_each(|c| out[3 * i as usize + c] += y[c]);
    };
    for (i, j, block) in matrix.blocks() {
        add(i, j, *block);
        if i != j {
            add(j, i, block.transpose());
        }
    }
    out
}

fn factor_f64(matrix: &BlockMatrix, level: Level) -> Cholesky<f64> {
    let mut factor = Cholesky::new(matrix);
    assert!(factor.factorise(level, matrix.blocks().map(|(_, _, block)| block.to_cols_array_2d())));
    factor
}

fn factor_f32(matrix: &BlockMatrix, level: Level) -> Cholesky<f32> {
    let mut factor = Cholesky::new(matrix);
    let blocks = matrix.blocks().map(|(_, _, block)| block.to_cols_array_2d().map(|column| column.map(|v| v as f32)));
    assert!(factor.factorise(level, blocks));
    factor
}

#[test]
fn solution_satisfies_the_equations() {
    for n in [[1, 1, 1], [2, 1, 1], [5, 4, 3], [12, 3, 3], [9, 10, 8], [40, 6, 5]] {
        let matrix = grid(n, 0.01);
        let expected: Vec<f64> = (0..3 * matrix.len()).map(noise).collect();
        let right = product(&matrix, &expected);
        let mut x = right.clone();
        factor_f64(&matrix, Level::new()).solve(Level::new(), &mut x);
        let off = x.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-10, "{n:?}: off by {off}");
        let mut x: Vec<f32> = right.iter().map(|v| *v as f32).collect();
        factor_f32(&matrix, Level::new()).solve(Level::new(), &mut x);
        let off = x.iter().zip(&expected).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
        assert!(off < 0.01, "{n:?}, single precision: off by {off}");
    }
}

#[test]
fn order_is_a_permutation_and_panels_cover_all_columns() {
    let matrix = grid([9, 10, 8], 0.01);
    let factor = factor_f64(&matrix, Level::new());
    let mut order = factor.order().to_vec();
    order.sort_unstable();
    assert_eq!(order, (0..matrix.len() as u32).collect::<Vec<_>>());
    let mut next = 0;
    for panel in factor.panels() {
        assert_eq!(panel.first(), next);
        next += panel.width();
        assert!(panel.rows().is_sorted() && panel.rows().iter().all(|row| 3 * *row as usize >= next));
    }
    assert_eq!(next, 3 * matrix.len());
}

#[test]
fn inverse_of_a_triangle_times_the_triangle_is_the_identity() {
    let matrix = grid([9, 10, 8], 0.01);
    let factor = factor_f64(&matrix, Level::new());
    let widest = factor.panels().map(|panel| panel.width()).max().unwrap();
    assert!(widest > 64, "{widest} columns");
    let mut inverse = Vec::new();
    for panel in factor.panels() {
        let n = panel.width();
        panel.inverse(Level::new(), &mut inverse);
        for row in 0..n {
            for column in 0..n {
                let sum: f64 = (0..=row).map(|k| panel.at(row, k) * inverse[n * column + k]).sum();
                let expected = if row == column { 1.0 } else { 0.0 };
                assert!((sum - expected).abs() < 1e-10, "{n} columns, ({row}, {column}): {sum}");
            }
        }
    }
}

#[test]
fn bits_depend_neither_on_threads_nor_on_instructions() {
    let matrix = grid([16, 16, 16], 0.01);
    let bits = |level: Level| -> Vec<u32> {
        let factor = factor_f32(&matrix, level);
        let mut x: Vec<f32> = (0..3 * matrix.len()).map(|k| noise(k) as f32).collect();
        factor.solve(level, &mut x);
        let numbers = factor.panels().flat_map(|p| (0..p.width()).map(move |k| p.at(p.width() - 1, k).to_bits()));
        numbers.chain(x.into_iter().map(f32::to_bits)).collect()
    };
    let reference = bits(Level::baseline());
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert!(pool.install(|| bits(Level::new()) == reference), "{threads} threads");
    }
}

#[test]
fn indefinite_and_non_finite_matrices_are_refused() {
    let mut matrix = grid([5, 4, 3], 0.01);
    let mut factor = Cholesky::<f64>::new(&matrix);
    let mut done = |matrix: &BlockMatrix| {
        factor.factorise(Level::new(), matrix.blocks().map(|(_, _, block)| block.to_cols_array_2d()))
    };
    assert!(done(&matrix));
    matrix.shift(-0.5);
    assert!(!done(&matrix));
    matrix.shift(f64::NAN);
    assert!(!done(&matrix));
    matrix.clear();
    matrix.shift(f64::INFINITY);
    assert!(!done(&matrix));
    matrix.clear();
    matrix.shift(1.0);
    assert!(done(&matrix));
}
