//! The factor L D L' of a small dense matrix, indefinite but without a zero on the way: the matrix
//! of a low-rank update.

/// Columns that [`decompose`] subtracts from as many others at once.
const BLOCK: usize = 4;

/// L D L' of a symmetric matrix of `n` columns in place, of which only what is not above the
/// diagonal is read.
#[inline(always)]
pub(super) fn decompose(matrix: &mut [f64], n: usize) {
    let mut first = 0;
    while first + BLOCK <= n {
        let (before, columns) = matrix.split_at_mut(first * n);
        let (a, columns) = columns.split_at_mut(n);
        let (b, columns) = columns.split_at_mut(n);
        let (c, columns) = columns.split_at_mut(n);
        let mut columns = [a, b, c, &mut columns[..n]].map(|column| &mut column[first..]);
        for four in before.chunks_exact(BLOCK * n).enumerate().map(|(k, four)| (BLOCK * k, four)) {
            subtract_block(four, n, first, &mut columns);
        }
        for j in first..first + BLOCK {
            finish_column(matrix, n, first, j);
        }
        first += BLOCK;
    }
    (first..n).for_each(|j| finish_column(matrix, n, 0, j));
}

/// Subtracts what columns of L before a block have in it, from the first row of the block on. The
/// columns begin with the one of number `four.0`.
#[inline(always)]
fn subtract_block(four: (usize, &[f64]), n: usize, first: usize, columns: &mut [&mut [f64]; BLOCK]) {
    let rows = n - first;
    let l: [&[f64]; BLOCK] = std::array::from_fn(|k| &four.1[k * n + first..][..rows]);
    let d: [f64; BLOCK] = std::array::from_fn(|k| four.1[k * n + four.0 + k]);
    let shares: [[f64; BLOCK]; BLOCK] = std::array::from_fn(|j| std::array::from_fn(|k| d[k] * l[k][j]));
    let [a, b, c, e] = columns;
    let (a, b, c, e) = (&mut a[..rows], &mut b[..rows], &mut c[..rows], &mut e[..rows]);
    for r in 0..rows {
        let l = [l[0][r], l[1][r], l[2][r], l[3][r]];
        let sum = |from: f64, s: &[f64; BLOCK]| from - s[0] * l[0] - s[1] * l[1] - s[2] * l[2] - s[3] * l[3];
        a[r] = sum(a[r], &shares[0]);
        b[r] = sum(b[r], &shares[1]);
        c[r] = sum(c[r], &shares[2]);
        e[r] = sum(e[r], &shares[3]);
    }
}

/// Subtracts what the columns of L from `first` on have in column j, and divides it by its D.
#[inline(always)]
fn finish_column(matrix: &mut [f64], n: usize, first: usize, j: usize) {
    let (before, column) = matrix.split_at_mut(j * n);
    let column = &mut column[j..n];
    for (k, before) in before.chunks_exact(n).enumerate().skip(first) {
        let share = before[k] * before[j];
        column.iter_mut().zip(&before[j..]).for_each(|(sum, l)| *sum -= share * l);
    }
    let d = column[0];
    column[1..].iter_mut().for_each(|l| *l /= d);
}

/// Numbers of a sum of products that are added side by side.
const LANES: usize = 8;

/// Solves L D L' x = b in place, for the columns that [`decompose`] leaves.
#[inline(always)]
pub(super) fn solve(matrix: &[f64], x: &mut [f64]) {
    let n = x.len();
    for (k, l) in matrix.chunks_exact(n).take(n).enumerate() {
        let (solved, below) = x.split_at_mut(k + 1);
        below.iter_mut().zip(&l[k + 1..]).for_each(|(sum, l)| *sum -= solved[k] * l);
    }
    for (k, l) in matrix.chunks_exact(n).take(n).enumerate().rev() {
        x[k] = x[k] / l[k] - dot(&l[k + 1..], &x[k + 1..]);
    }
}

/// Sum of products, in lanes.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let ((a, rest_a), (b, rest_b)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    for (a, b) in a.iter().zip(b) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest: f64 = rest_a.iter().zip(rest_b).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::{decompose, solve};
    use trocar_core::Random;

    /// L D L' is the matrix, whether or not its columns fill whole blocks, with both signs in D.
    #[test]
    fn products_of_factors_are_the_matrix() {
        for n in [1, 3, 4, 7, 16, 33] {
            let random = Random::from_keys(&[n as u64]);
            let own = |i: usize| if i % 3 == 1 { -4.0 } else { 4.0 } * n as f64;
            let number = |i: usize, j: usize| match i == j {
                true => own(i),
                false => random.normal((i.max(j) * n + i.min(j)) as u64),
            };
            // Numbers above the diagonal are not read.
            let mut matrix: Vec<f64> =
                (0..n * n).map(|k| if k % n < k / n { f64::NAN } else { number(k % n, k / n) }).collect();
            decompose(&mut matrix, n);
            let l = |i: usize, k: usize| if i == k { 1.0 } else { matrix[k * n + i] };
            for j in 0..n {
                assert_eq!(matrix[j * n + j] < 0.0, own(j) < 0.0);
                for i in j..n {
                    let product: f64 = (0..=j).map(|k| l(i, k) * matrix[k * n + k] * l(j, k)).sum();
                    assert!((product - number(i, j)).abs() < 1e-9, "{n}: {i} {j}: {product} {}", number(i, j));
                }
            }
            let right: Vec<f64> = (0..n).map(|i| random.normal((n * n + i) as u64)).collect();
            let mut x = right.clone();
            solve(&matrix, &mut x);
            for (i, right) in right.iter().enumerate() {
                let product: f64 = (0..n).map(|j| number(i, j) * x[j]).sum();
                assert!((product - right).abs() < 1e-9, "{n}: {i}: {product} {right}");
            }
        }
    }
}
