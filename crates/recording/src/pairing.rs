//! Pairs two streams of images by time.

/// The pairs of two streams of images.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pairing {
    /// (Index of the colour image, index of the depth image), ordered by time.
    pub pairs: Vec<(usize, usize)>,
    /// Colour images without a depth image close enough in time.
    pub lone_color: usize,
    /// Depth images without a colour image close enough in time.
    pub lone_depth: usize,
    /// Frames missing in the depth stream: gaps of at least one and a half intervals, counted in
    /// intervals.
    pub gaps: usize,
    /// Median time between the images of a pair (s).
    pub offset_s: f64,
    /// Median time between depth images (s); 0 for fewer than two.
    pub interval_s: f64,
}

impl Pairing {
    /// Pairs images taken at the times `color` and `depth` (s). Images pair when each is nearest to
    /// the other and they are at most half a depth interval apart. Times need not ascend; those
    /// that are not finite pair with nothing.
    pub fn by_time(color: &[f64], depth: &[f64]) -> Self {
        let ordered = |times: &[f64]| {
            let mut order: Vec<usize> = (0..times.len()).filter(|i| times[*i].is_finite()).collect();
            order.sort_by(|a, b| times[*a].total_cmp(&times[*b]));
            order
        };
        let (colors, depths) = (ordered(color), ordered(depth));
        let mut intervals: Vec<f64> = depths.windows(2).map(|w| depth[w[1]] - depth[w[0]]).collect();
        intervals.sort_by(f64::total_cmp);
        let interval_s = intervals.get(intervals.len() / 2).copied().unwrap_or(0.0);
        // Slightly more than half: two streams may run exactly half an interval apart.
        let tolerance = if interval_s > 0.0 { 0.501 * interval_s } else { f64::INFINITY };
        let nearest = |time: f64, order: &[usize], times: &[f64]| {
            let after = order.partition_point(|i| times[*i] < time);
            let candidates = [after.checked_sub(1), Some(after)].into_iter().flatten().filter(|k| *k < order.len());
            candidates.min_by(|a, b| (times[order[*a]] - time).abs().total_cmp(&(times[order[*b]] - time).abs()))
        };
        let mut pairs = Vec::new();
        let mut offsets = Vec::new();
        for &c in &colors {
            let Some(d) = nearest(color[c], &depths, depth).map(|k| depths[k]) else { continue };
            let back = nearest(depth[d], &colors, color).map(|k| colors[k]);
            let offset = (color[c] - depth[d]).abs();
            if back == Some(c) && offset <= tolerance {
                pairs.push((c, d));
                offsets.push(offset);
            }
        }
        offsets.sort_by(f64::total_cmp);
        let missing = |gap: &f64| if *gap >= 1.5 * interval_s { (gap / interval_s).round() as usize - 1 } else { 0 };
        let gaps = if interval_s > 0.0 { intervals.iter().map(missing).sum() } else { 0 };
        Self {
            lone_color: color.len() - pairs.len(),
            lone_depth: depth.len() - pairs.len(),
            gaps,
            offset_s: offsets.get(offsets.len() / 2).copied().unwrap_or(0.0),
            interval_s,
            pairs,
        }
    }

    /// Notes for the user, one sentence each; empty when every image has a partner.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.lone_color + self.lone_depth > 0 {
            notes.push(format!(
                "{} frames were paired by time (median {:.1} ms apart); {} colour and {} depth images without a partner \
                 were dropped.",
                self.pairs.len(),
                1e3 * self.offset_s,
                self.lone_color,
                self.lone_depth
            ));
        }
        if self.gaps > 0 {
            notes.push(format!(
                "The camera dropped {} frames: depth has gaps (images are {:.1} ms apart otherwise).",
                self.gaps,
                1e3 * self.interval_s
            ));
        }
        notes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames at 30 Hz from `start` (s) without those of `missing`.
    fn stream(start: f64, frames: usize, missing: &[usize]) -> Vec<f64> {
        (0..frames).filter(|i| !missing.contains(i)).map(|i| start + i as f64 / 30.0).collect()
    }

    #[test]
    fn drops_on_either_side_do_not_shift_the_rest() {
        let (color, depth) = (stream(0.004, 100, &[10, 50, 51]), stream(0.0, 103, &[20]));
        let pairing = Pairing::by_time(&color, &depth);
        assert_eq!(pairing.pairs.len(), 96);
        assert!(pairing.pairs.iter().all(|&(c, d)| (color[c] - depth[d] - 0.004).abs() < 1e-9));
        assert_eq!((pairing.lone_color, pairing.lone_depth, pairing.gaps), (1, 6, 1));
        assert!((pairing.offset_s - 0.004).abs() < 1e-9 && (pairing.interval_s - 1.0 / 30.0).abs() < 1e-9);
        let notes = pairing.notes();
        assert!(notes[0].contains("1 colour and 6 depth") && notes[1].contains("dropped 1 frames"), "{notes:?}");
        assert!(
            Pairing::by_time(&depth, &depth).notes().len() == 1,
            "a stream pairs with itself; only its gap is noted"
        );
    }

    #[test]
    fn streams_that_never_meet_do_not_pair() {
        let pairing = Pairing::by_time(&stream(100.0, 5, &[]), &stream(0.0, 5, &[]));
        assert_eq!((pairing.pairs.len(), pairing.lone_color, pairing.lone_depth), (0, 5, 5));
        assert_eq!(Pairing::by_time(&[], &[0.0]).pairs.len(), 0);
        assert_eq!(Pairing::by_time(&[f64::NAN, 1.0], &[1.2]).pairs, [(1, 0)]);
    }

    #[test]
    fn a_slow_stream_takes_its_nearest_partners() {
        let color: Vec<f64> = (0..10).map(|i| 0.1 * f64::from(i)).collect();
        let depth: Vec<f64> = (0..30).map(|i| 0.1 / 3.0 * f64::from(i) + 0.001).collect();
        let pairing = Pairing::by_time(&color, &depth);
        assert_eq!(pairing.pairs, (0..10).map(|i| (i, 3 * i)).collect::<Vec<_>>());
    }
}
