//! Smooth curves through values that are known at some of many evenly spaced places.

/// Weight of the squared second differences over that of the squared residuals. Values one
/// millimetre apart are smoothed over about three millimetres.
const ROUGHNESS: f64 = 30.0;

/// The curve that minimises the squared residuals of the known values and its squared second
/// differences (Whittaker 1923). It bridges gaps as a cubic and goes on straight beyond the last
/// known value. `None` with fewer than two known values.
pub fn smooth(values: &[Option<f64>]) -> Option<Vec<f64>> {
    let n = values.len();
    if values.iter().flatten().count() < 2 {
        return None;
    }
    // The matrix is symmetric with two diagonals to each side.
    let mut matrix = vec![[0.0; 3]; n];
    let mut right: Vec<f64> = values.iter().map(|v| v.unwrap_or(0.0)).collect();
    for (row, value) in matrix.iter_mut().zip(values) {
        row[0] = f64::from(u8::from(value.is_some()));
    }
    for i in 0..n.saturating_sub(2) {
        const SECOND: [f64; 3] = [1.0, -2.0, 1.0];
        for a in 0..3 {
            for b in a..3 {
                matrix[i + a][b - a] += ROUGHNESS * SECOND[a] * SECOND[b];
            }
        }
    }
    // L D L' in place: the diagonal holds D, the others L.
    for i in 0..n {
        let [d, mut one, mut two] = matrix[i];
        if d <= 0.0 {
            return None;
        }
        (one, two) = (one / d, two / d);
        matrix[i] = [d, one, two];
        if i + 1 < n {
            matrix[i + 1][0] -= one * one * d;
            matrix[i + 1][1] -= one * two * d;
        }
        if i + 2 < n {
            matrix[i + 2][0] -= two * two * d;
        }
    }
    for i in 0..n {
        if i + 1 < n {
            right[i + 1] -= matrix[i][1] * right[i];
        }
        if i + 2 < n {
            right[i + 2] -= matrix[i][2] * right[i];
        }
    }
    for i in (0..n).rev() {
        right[i] /= matrix[i][0];
        if i + 1 < n {
            right[i] -= matrix[i][1] * right[i + 1];
        }
        if i + 2 < n {
            right[i] -= matrix[i][2] * right[i + 2];
        }
    }
    Some(right)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_lines_stay_and_gaps_are_bridged() {
        let line = |i: usize| 2.0 + 0.3 * i as f64;
        let known = |i: usize| !(10..25).contains(&i) && i < 40;
        let values: Vec<_> = (0..50).map(|i| known(i).then(|| line(i))).collect();
        let curve = smooth(&values).unwrap();
        assert!((0..50).all(|i| (curve[i] - line(i)).abs() < 1e-9), "{curve:?}");
    }

    #[test]
    fn a_hidden_top_is_found() {
        let bell = |i: usize| 20.0 * (-(i as f64 - 40.0).powi(2) / (2.0 * 15.0 * 15.0)).exp();
        let values: Vec<_> = (0..80).map(|i| (!(34..46).contains(&i)).then(|| bell(i))).collect();
        let curve = smooth(&values).unwrap();
        let top = curve.iter().copied().fold(0.0, f64::max);
        assert!((top - 20.0).abs() < 0.7, "{top}");
    }

    #[test]
    fn one_value_is_no_curve() {
        assert_eq!(smooth(&[None, Some(1.0), None]), None);
        assert_eq!(smooth(&[]), None);
    }
}
