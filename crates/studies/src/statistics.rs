//! Statistics of measured values.

/// The median; NaN without values. Sorts the values.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    trocar_core::median(values).unwrap_or(f64::NAN)
}

/// The smallest value that at least `share` of the values do not exceed; NaN without values. Sorts
/// the values.
pub(crate) fn percentile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let place = (share * values.len() as f64).ceil().max(1.0) as usize - 1;
    values.get(place.min(values.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
}
