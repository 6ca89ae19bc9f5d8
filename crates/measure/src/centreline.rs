//! The centreline of a long organ as the camera sees it: the middle of its mask, with the depth of
//! its front.

use crate::depth::depth_at;
use glam::{DVec2, DVec3};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use trocar_camera::{Camera, DepthImage, Mask};

/// Distance between two places along the organ (m).
pub const SPACING: f64 = 1e-3;

/// Length of a step along the mask in which pixels are gathered (px).
const BIN: f64 = 2.0;

/// Steps to each side over which pixels and depths are smoothed.
const SMOOTHING: usize = 3;

/// Times that the line is moved to the middle between the edges. Its direction near the ends is not
/// right at first.
const CENTRING_ROUNDS: usize = 3;

/// Shortest usable centreline (m).
const SHORTEST: f64 = 0.02;

/// One place along the organ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Station {
    /// Its pixel, in the middle of the mask.
    pub pixel: DVec2,
    /// Unit vector across the organ in the picture.
    pub across: DVec2,
    /// Half of the mask's width there (px).
    pub half_width: f64,
    /// The point of the organ's front (m).
    pub point: DVec3,
}

/// Places along an organ, [`SPACING`] apart, base first.
#[derive(Clone, Debug, PartialEq)]
pub struct Centreline {
    /// The places.
    pub stations: Vec<Station>,
}

impl Centreline {
    /// The centreline of the part of `mask` that holds the pixel `click`. It begins at the end
    /// nearer to `base` (px), or else at the one nearer to the middle of the picture.
    ///
    /// # Errors
    /// Says why the mask has no centreline.
    pub fn of(
        mask: &Mask,
        depth: &DepthImage,
        camera: &Camera,
        click: DVec2,
        base: Option<DVec2>,
    ) -> Result<Self, String> {
        let at = (click.y.round() as usize) * mask.width + click.x.round() as usize;
        if !mask.set.get(at).copied().unwrap_or(false) {
            return Err(format!("the click [{}, {}] is not on the organ's mask", click.x, click.y));
        }
        let farthest = |from: &[f64]| {
            let known = (0..from.len()).filter(|i| from[*i].is_finite());
            known.max_by(|a, b| from[*a].total_cmp(&from[*b]).then(b.cmp(a)))
        };
        let one = farthest(&distances(mask, at)).ok_or("the mask is empty")?;
        let from_one = distances(mask, one);
        let other = farthest(&from_one).ok_or("the mask is empty")?;
        let mut bins = gathered(mask, &from_one, from_one[other]);
        let place = |i: usize| DVec2::new((i % mask.width) as f64, (i / mask.width) as f64);
        let target = base.unwrap_or(0.5 * DVec2::new(mask.width as f64, mask.height as f64));
        if place(other).distance(target) < place(one).distance(target) {
            bins.reverse();
        }
        let line = centred(mask, &bins);
        let stations = stations(&line, depth, camera);
        let length = (stations.len().max(1) - 1) as f64 * SPACING;
        if length < SHORTEST {
            return Err(format!(
                "the organ's centreline is {:.0} mm long; it must have at least {:.0} mm with depth",
                1e3 * length,
                1e3 * SHORTEST
            ));
        }
        Ok(Self { stations })
    }

    /// Its length (m).
    pub fn length(&self) -> f64 {
        (self.stations.len().max(1) - 1) as f64 * SPACING
    }
}

/// Lengths of the shortest paths within the mask from a pixel (px).
fn distances(mask: &Mask, from: usize) -> Vec<f64> {
    let mut length = vec![f64::INFINITY; mask.set.len()];
    length[from] = 0.0;
    // Lengths are not negative, so their bits order them.
    let mut open = BinaryHeap::from([Reverse((0_u64, from))]);
    while let Some(Reverse((bits, i))) = open.pop() {
        let here = f64::from_bits(bits);
        if here > length[i] {
            continue;
        }
        let (u, v) = ((i % mask.width) as i64, (i / mask.width) as i64);
        for (du, dv) in [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)] {
            let (x, y) = (u + du, v + dv);
            if x < 0 || y < 0 || x >= mask.width as i64 || y >= mask.height as i64 {
                continue;
            }
            let k = y as usize * mask.width + x as usize;
            let next = here + if du != 0 && dv != 0 { std::f64::consts::SQRT_2 } else { 1.0 };
            if mask.set[k] && next < length[k] {
                length[k] = next;
                open.push(Reverse((next.to_bits(), k)));
            }
        }
    }
    length
}

/// Centroids of the pixels within steps of [`BIN`] along the mask, smoothed.
fn gathered(mask: &Mask, from_end: &[f64], whole: f64) -> Vec<DVec2> {
    let count = (whole / BIN).floor() as usize + 1;
    let mut sums = vec![(DVec2::ZERO, 0.0); count];
    for (i, length) in from_end.iter().enumerate().filter(|(_, l)| l.is_finite()) {
        let bin = &mut sums[((length / BIN) as usize).min(count - 1)];
        bin.0 += DVec2::new((i % mask.width) as f64, (i / mask.width) as f64);
        bin.1 += 1.0;
    }
    let centres: Vec<DVec2> = sums.iter().filter(|s| s.1 > 0.0).map(|s| s.0 / s.1).collect();
    averaged(&centres)
}

/// The line moved to the middle between both edges of the mask: pixel, across, half width. Near its
/// ends, where steps are not across, it is left out.
fn centred(mask: &Mask, line: &[DVec2]) -> Vec<(DVec2, DVec2, f64)> {
    let inside = |p: DVec2| {
        let (u, v) = (p.x.round(), p.y.round());
        let fits = u >= 0.0 && v >= 0.0 && u < mask.width as f64 && v < mask.height as f64;
        fits && mask.set[v as usize * mask.width + u as usize]
    };
    let reach = |from: DVec2, along: DVec2| {
        let mut way = 0.0;
        while inside(from + along * (way + 0.5)) && way < 200.0 {
            way += 0.5;
        }
        way
    };
    let direction = |points: &[DVec2], i: usize| {
        let (a, b) = (i.saturating_sub(SMOOTHING), (i + SMOOTHING).min(points.len() - 1));
        (points[b] - points[a]).normalize_or(DVec2::X)
    };
    let width = |i: usize| {
        let across = direction(line, i).perp();
        reach(line[i], across) + reach(line[i], -across)
    };
    let mut widths: Vec<f64> = (0..line.len()).map(width).collect();
    widths.sort_by(f64::total_cmp);
    let skipped = (0.5 * widths.get(widths.len() / 2).copied().unwrap_or(0.0) / BIN).ceil() as usize;
    if line.len() <= 2 * skipped + 2 {
        return Vec::new();
    }
    let mut centred = line[skipped..line.len() - skipped].to_vec();
    for _ in 0..CENTRING_ROUNDS {
        let middle = |i: usize| {
            let across = direction(&centred, i).perp();
            centred[i] + across * (0.5 * (reach(centred[i], across) - reach(centred[i], -across)))
        };
        centred = averaged(&(0..centred.len()).map(middle).collect::<Vec<_>>());
    }
    (0..centred.len())
        .map(|i| {
            let across = direction(&centred, i).perp();
            (centred[i], across, 0.5 * (reach(centred[i], across) + reach(centred[i], -across)))
        })
        .collect()
}

/// Moving averages over [`SMOOTHING`] neighbours to each side; fewer at the ends.
fn averaged(points: &[DVec2]) -> Vec<DVec2> {
    let mean = |i: usize| {
        let by = SMOOTHING.min(i).min(points.len() - 1 - i);
        points[i - by..=i + by].iter().sum::<DVec2>() / (2 * by + 1) as f64
    };
    (0..points.len()).map(mean).collect()
}

/// Places evenly spaced along the front over the line.
fn stations(line: &[(DVec2, DVec2, f64)], depth: &DepthImage, camera: &Camera) -> Vec<Station> {
    let measured: Vec<Option<f64>> = line.iter().map(|(p, ..)| depth_at(depth, None, *p)).collect();
    let Some(depths) = crate::smooth::smooth(&measured) else { return Vec::new() };
    // Depth is not continued beyond the last place that has it.
    let known = |side: Option<usize>| side.unwrap_or(0);
    let (first, last) =
        (known(measured.iter().position(Option::is_some)), known(measured.iter().rposition(Option::is_some)));
    let points: Vec<DVec3> = (first..=last).map(|i| camera.ray(line[i].0.x, line[i].0.y) * depths[i]).collect();
    let mut stations = Vec::new();
    let mut left = 0.0;
    for k in 1..points.len() {
        let (a, b) = (line[first + k - 1], line[first + k]);
        let step = points[k - 1].distance(points[k]);
        while left <= step && step > 0.0 {
            let t = left / step;
            stations.push(Station {
                pixel: a.0.lerp(b.0, t),
                across: a.1.lerp(b.1, t).normalize_or(a.1),
                half_width: a.2 + (b.2 - a.2) * t,
                point: points[k - 1].lerp(points[k], t),
            });
            left += SPACING;
        }
        left -= step;
    }
    stations
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An arc of 60 mm radius and 12 mm width at a depth of 0.2 m, and its mask.
    fn arc() -> (Mask, DepthImage, Camera) {
        let camera = Camera::centred(400, 300, 1.0);
        let (mut mask, mut depth) = (Mask::new(400, 300), DepthImage::new(400, 300));
        depth.depth.fill(0.2);
        for i in 0..mask.set.len() {
            let p = camera.ray((i % 400) as f64, (i / 400) as f64) * 0.2 - DVec3::new(0.0, 0.04, 0.2);
            let (radius, angle) = (p.truncate().length(), (-p.y).atan2(p.x));
            mask.set[i] = (radius - 0.06).abs() < 6e-3 && (0.6..2.4).contains(&angle);
        }
        (mask, depth, camera)
    }

    #[test]
    fn the_centreline_of_an_arc_has_its_radius_and_length() {
        let (mask, depth, camera) = arc();
        let click = camera.project(DVec3::new(0.0, -0.02, 0.2)).unwrap();
        let line = Centreline::of(&mask, &depth, &camera, click, Some(DVec2::new(400.0, 150.0))).unwrap();
        for station in &line.stations {
            let radius = (station.point - DVec3::new(0.0, 0.04, 0.2)).length();
            assert!((radius - 0.06).abs() < 0.5e-3, "{radius} m at {}", station.pixel);
            assert!((station.half_width * 0.2 / camera.fx - 6e-3).abs() < 0.8e-3, "{}", station.half_width);
        }
        // 1.8 rad of 60 mm, less half a width at each end.
        assert!((line.length() - 0.096).abs() < 4e-3, "{}", line.length());
        assert!(line.stations[0].point.x > 0.03, "it begins at the right");
        let steps = line.stations.windows(2).map(|s| s[0].point.distance(s[1].point));
        assert!(steps.into_iter().all(|d| (d - SPACING).abs() < 0.1e-3));
    }

    #[test]
    fn a_click_beside_the_organ_is_refused() {
        let (mask, depth, camera) = arc();
        let error = Centreline::of(&mask, &depth, &camera, DVec2::new(2.0, 2.0), None).unwrap_err();
        assert_eq!(error, "the click [2, 2] is not on the organ's mask");
    }
}
