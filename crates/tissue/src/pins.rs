//! Rules that choose which nodes are held.

use glam::DVec3;

/// The lowest `share` (0..=1) of `nodes` along `up`; ties by index. round(share * n) indices,
/// ascending.
pub fn lowest_band(nodes: &[DVec3], up: DVec3, share: f64) -> Vec<u32> {
    let mut all: Vec<u32> = (0..nodes.len() as u32).collect();
    lowest(&mut all, nodes, up, share)
}

/// One end of a tubular organ and a band along the part next to it.
///
/// `s` is the organ coordinate of each node. Every node within `length` of the base (or of the tip)
/// is chosen, and of the nodes in the next `band_length` the lowest `band_share` along `up`.
/// Ascending.
pub fn end(
    nodes: &[DVec3],
    s: &[f64],
    up: DVec3,
    at_base: bool,
    length: f64,
    band_length: f64,
    band_share: f64,
) -> Vec<u32> {
    let from_end = |i: u32| if at_base { s[i as usize] } else { 1.0 - s[i as usize] };
    let all = 0..nodes.len() as u32;
    let mut chosen: Vec<u32> = all.clone().filter(|i| from_end(*i) <= length).collect();
    let mut next: Vec<u32> =
        all.filter(|i| (length..length + band_length).contains(&from_end(*i)) && from_end(*i) > length).collect();
    chosen.extend(lowest(&mut next, nodes, up, band_share));
    chosen.sort_unstable();
    chosen
}

/// The lowest node along `up` of each of the slices that divide a part of a tubular organ, with the
/// slice's length in the organ coordinate: where the threads of a sheet below it begin.
///
/// `s` is the organ coordinate of each node, the part is from `from` to `to`, and slices are as
/// long as `longest` at most. Slices without nodes have none.
pub fn lowest_along(nodes: &[DVec3], s: &[f64], up: DVec3, [from, to]: [f64; 2], longest: f64) -> Vec<(u32, f64)> {
    let count = ((to - from) / longest).ceil().max(1.0) as usize;
    let step = (to - from) / count as f64;
    let lowest = |k: usize| {
        let (low, high) = (from + k as f64 * step, from + (k + 1) as f64 * step);
        let slice = (0..nodes.len()).filter(|i| s[*i] >= low && s[*i] <= high);
        let node = slice.min_by(|a, b| nodes[*a].dot(up).total_cmp(&nodes[*b].dot(up)))?;
        Some((node as u32, step))
    };
    (0..count).filter_map(lowest).collect()
}

/// The length of the part `from` to `to` that each of some places along it bears, if a load on the
/// part is divided between the two places around it as on a beam. The places rise; outermost ones
/// bear up to `margin` beyond themselves.
pub fn borne(places: &[f64], [from, to]: [f64; 2], margin: f64) -> Vec<f64> {
    let mut borne = vec![0.0; places.len()];
    let (Some(first), Some(last)) = (places.first(), places.last()) else { return borne };
    let overlap = |low: f64, high: f64| (low.max(from), high.min(to));
    let length = |(low, high): (f64, f64)| (high - low).max(0.0);
    borne[0] += length(overlap(first - margin, *first));
    borne[places.len() - 1] += length(overlap(*last, last + margin));
    for (i, pair) in places.windows(2).enumerate() {
        let part = overlap(pair[0], pair[1]);
        if length(part) > 0.0 {
            let share = (0.5 * (part.0 + part.1) - pair[0]) / (pair[1] - pair[0]);
            borne[i] += (1.0 - share) * length(part);
            borne[i + 1] += share * length(part);
        }
    }
    borne
}

fn lowest(candidates: &mut [u32], nodes: &[DVec3], up: DVec3, share: f64) -> Vec<u32> {
    let height = |i: u32| nodes[i as usize].dot(up);
    candidates.sort_by(|a, b| height(*a).total_cmp(&height(*b)).then(a.cmp(b)));
    let count = (share.clamp(0.0, 1.0) * candidates.len() as f64).round() as usize;
    let mut chosen = candidates[..count].to_vec();
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column() -> Vec<DVec3> {
        (0..10).map(|i| DVec3::new(0.1 * i as f64, 0.0, -(i as f64))).collect()
    }

    #[test]
    fn the_band_is_the_lowest_share() {
        assert_eq!(lowest_band(&column(), DVec3::Z, 0.42), [6, 7, 8, 9]);
        assert_eq!(lowest_band(&column(), -DVec3::Z, 0.2), [0, 1]);
        assert!(lowest_band(&column(), DVec3::Z, 0.0).is_empty());
        assert_eq!(lowest_band(&column(), DVec3::Z, 1.0).len(), 10);
    }

    #[test]
    fn each_slice_has_its_lowest_node() {
        let s: Vec<f64> = (0..10).map(|i| i as f64 / 9.0).collect();
        let found = lowest_along(&column(), &s, DVec3::Z, [0.5, 1.0], 0.3);
        assert_eq!(found, [(6, 0.25), (9, 0.25)]);
        assert_eq!(lowest_along(&column(), &s, DVec3::Z, [0.92, 0.97], 0.3), []);
    }

    #[test]
    fn places_bear_the_part_around_them() {
        let places = [0.1, 0.3, 0.4];
        let near = |found: Vec<f64>, right: [f64; 3]| found.iter().zip(right).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(near(borne(&places, [0.0, 1.0], 0.05), [0.15, 0.15, 0.1]));
        // Of 0.2 to 0.3 a quarter is the first one's.
        assert!(near(borne(&places, [0.2, 0.3], 0.05), [0.025, 0.075, 0.0]));
        assert!(near(borne(&places, [0.6, 0.9], 0.05), [0.0; 3]));
        assert!(borne(&[], [0.0, 1.0], 0.1).is_empty());
    }

    #[test]
    fn the_end_and_its_band_are_counted_along_the_organ() {
        let s: Vec<f64> = (0..10).map(|i| i as f64 / 9.0).collect();
        assert_eq!(end(&column(), &s, DVec3::Z, true, 0.25, 0.0, 0.0), [0, 1, 2]);
        assert_eq!(end(&column(), &s, DVec3::Z, false, 0.25, 0.0, 0.0), [7, 8, 9]);
        // Of nodes 3 to 6 the lower half (node 6 is the lowest).
        assert_eq!(end(&column(), &s, DVec3::Z, true, 0.25, 0.45, 0.5), [0, 1, 2, 5, 6]);
    }
}
