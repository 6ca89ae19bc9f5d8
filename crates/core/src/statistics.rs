//! Statistics of measured values.

/// The median: the middle value, or the mean of the two middle ones; `None` without values. Sorts
/// the values.
///
/// ```
/// use trocar_core::median;
/// assert_eq!(median([3.0, 1.0, 2.0]), Some(2.0));
/// assert_eq!(median([4.0, 1.0]), Some(2.5));
/// assert_eq!(median([]), None);
/// ```
pub fn median(mut values: impl AsMut<[f64]>) -> Option<f64> {
    let values = values.as_mut();
    values.sort_unstable_by(f64::total_cmp);
    let n = values.len();
    (n > 0).then(|| 0.5 * (values[(n - 1) / 2] + values[n / 2]))
}
