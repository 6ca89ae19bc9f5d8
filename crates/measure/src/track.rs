//! Tracks of points through a film, in pixels and depth.
//!
//! A point is followed from frame to frame by pyramidal Lucas-Kanade optical flow (Bouguet 2000, by
//! the crate `optical-flow-lk`). It is lost for good where an instrument comes near, where the way
//! back does not lead to where it was, and where depth jumps.

use crate::depth::depth_at;
use crate::film::Film;
use crate::{Error, Result};
use glam::{DVec2, DVec3};
use image::GrayImage;
use optical_flow_lk::{DEFAULT_FB_THRESHOLD, TrackKernel, TrackOptions, TrackParams, TrackStatus, TrackerContext};
use trocar_camera::{Camera, ColorImage, Mask};
use trocar_core::Progress;
use trocar_recording::RgbdFrame;

/// Side of the compared window (px), about half of the width of an appendix seen from 15 cm.
const WINDOW: usize = 15;

/// Levels of the pyramid: motion of up to some 30 px per frame.
const LEVELS: usize = 3;

/// The pixels around a point that must be free of instruments, to each side.
const CLEAR: i64 = 5;

/// Largest change of depth from frame to frame (m).
const JUMP: f64 = 6e-3;

const PARAMETERS: TrackParams = TrackParams { window_size: WINDOW, max_iterations: 40, min_eigen_threshold: 0.5 };

/// The same arithmetic on every machine.
const OPTIONS: TrackOptions = TrackOptions::new().with_kernel(TrackKernel::FixedPoint);

/// Points followed through the frames of a film.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracks {
    /// The frames, the one at rest first.
    pub frames: Vec<usize>,
    /// Per frame and point: where it is in the camera's frame (m); `None` where it is hidden or
    /// lost.
    pub points: Vec<Vec<Option<DVec3>>>,
}

/// What is known about a point from the last frame.
#[derive(Clone, Copy)]
enum Following {
    /// Its pixel, and its depth where it was last measured (m).
    Seen(DVec2, Option<f64>),
    Lost,
}

impl Tracks {
    /// Follows the pixels `points` of frame `rest` through the frames up to `last`.
    ///
    /// # Errors
    /// A film that cannot be read, an interruption.
    pub fn follow(
        film: &mut dyn Film,
        rest: usize,
        last: usize,
        points: &[DVec2],
        progress: &dyn Progress,
    ) -> Result<Self> {
        let camera = film.camera();
        let mut tracks = Self { frames: Vec::new(), points: Vec::new() };
        let mut flow = TrackerContext::new();
        let mut state: Vec<Following> = points.iter().map(|p| Following::Seen(*p, None)).collect();
        film.play(rest..=last, &mut |index, frame| {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
            flow.advance(&gray(&frame.color), LEVELS);
            if index > rest {
                advance(&mut flow, &mut state);
            }
            tracks.frames.push(index);
            tracks.points.push(state.iter_mut().map(|point| measured(point, &frame, &camera)).collect());
            progress.advance(1);
            Ok(())
        })?;
        Ok(tracks)
    }

    /// The row of a frame.
    pub fn row(&self, frame: usize) -> Option<&[Option<DVec3>]> {
        let at = self.frames.iter().position(|f| *f == frame)?;
        self.points.get(at).map(Vec::as_slice)
    }
}

/// Moves the points that are not lost into the next frame.
fn advance(flow: &mut TrackerContext, state: &mut [Following]) {
    let seen: Vec<usize> = (0..state.len()).filter(|i| matches!(state[*i], Following::Seen(..))).collect();
    let from: Vec<(f32, f32)> = seen
        .iter()
        .map(|i| match state[*i] {
            Following::Seen(p, _) => (p.x as f32, p.y as f32),
            Following::Lost => (0.0, 0.0),
        })
        .collect();
    let results = flow.track_fb_with(&from, None, PARAMETERS, DEFAULT_FB_THRESHOLD, OPTIONS);
    for (i, result) in seen.into_iter().zip(results) {
        state[i] = match (state[i], result.status) {
            (Following::Seen(_, depth), TrackStatus::Tracked) => {
                Following::Seen(DVec2::new(f64::from(result.pos.0), f64::from(result.pos.1)), depth)
            }
            _ => Following::Lost,
        };
    }
}

/// Where a point is in space. Loses it near an instrument and where depth jumps.
fn measured(point: &mut Following, frame: &RgbdFrame, camera: &Camera) -> Option<DVec3> {
    let Following::Seen(pixel, before) = *point else { return None };
    if near(&frame.instruments, pixel) {
        *point = Following::Lost;
        return None;
    }
    let depth = depth_at(&frame.depth, Some(&frame.instruments), pixel)?;
    if before.is_some_and(|before| (depth - before).abs() > JUMP) {
        *point = Following::Lost;
        return None;
    }
    *point = Following::Seen(pixel, Some(depth));
    Some(camera.ray(pixel.x, pixel.y) * depth)
}

/// Whether an instrument is within [`CLEAR`] pixels.
fn near(instruments: &Mask, p: DVec2) -> bool {
    let (u, v) = (p.x.round() as i64, p.y.round() as i64);
    (v - CLEAR..=v + CLEAR).any(|y| {
        (u - CLEAR..=u + CLEAR).any(|x| {
            let inside = x >= 0 && y >= 0 && x < instruments.width as i64 && y < instruments.height as i64;
            inside && instruments.set[y as usize * instruments.width + x as usize]
        })
    })
}

/// Brightness by the weights of ITU-R BT.601.
fn gray(color: &ColorImage) -> GrayImage {
    let luma = |[r, g, b]: [u8; 3]| ((77 * u32::from(r) + 150 * u32::from(g) + 29 * u32::from(b) + 128) >> 8) as u8;
    let mut image = GrayImage::new(color.width as u32, color.height as u32);
    image.iter_mut().zip(&color.pixels).for_each(|(out, pixel)| *out = luma(*pixel));
    image
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ops::RangeInclusive;
    use trocar_camera::DepthImage;
    use trocar_core::{Random, Silent};

    /// A textured sheet that moves by `step` (px) and comes nearer by `rise` (m) in each frame; an
    /// instrument covers the left part from frame 5 on; from frame 8 on the lower part is at once
    /// 2 cm farther away.
    struct Sheet {
        step: DVec2,
        rise: f64,
    }

    /// Smooth texture of several pixels, 40 to 200.
    fn texture(p: DVec2) -> f64 {
        let random = Random::new(5);
        let value = |x: f64, y: f64| random.stream(x as i64 as u64).uniform(y as i64 as u64);
        let (q, mut sum) = (p / 5.0, 0.0);
        let (cell, f) = (q.floor(), q - q.floor());
        let w = f * f * (3.0 - 2.0 * f);
        for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let weight = (if dx > 0.0 { w.x } else { 1.0 - w.x }) * (if dy > 0.0 { w.y } else { 1.0 - w.y });
            sum += weight * value(cell.x + dx, cell.y + dy);
        }
        40.0 + 160.0 * sum
    }

    impl Film for Sheet {
        fn camera(&self) -> Camera {
            Camera::centred(160, 120, 1.0)
        }

        fn up(&self) -> DVec3 {
            -DVec3::Z
        }

        fn play(
            &mut self,
            frames: RangeInclusive<usize>,
            show: &mut dyn FnMut(usize, RgbdFrame) -> Result<()>,
        ) -> Result<()> {
            for index in frames {
                let mut color = ColorImage::new(160, 120, [0; 3]);
                let mut depth = DepthImage::new(160, 120);
                let mut instruments = Mask::new(160, 120);
                for i in 0..160 * 120 {
                    let p = DVec2::new((i % 160) as f64, (i / 160) as f64);
                    color.pixels[i] = [texture(p - self.step * index as f64).round() as u8; 3];
                    let far = if index >= 8 && p.y > 80.0 { 0.02 } else { 0.0 };
                    depth.depth[i] = (0.2 - self.rise * index as f64 + far) as f32;
                    instruments.set[i] = index >= 5 && p.x < 40.0;
                }
                show(index, RgbdFrame { color, depth, instruments })?;
            }
            Ok(())
        }
    }

    #[test]
    fn a_shifted_texture_is_followed_to_a_tenth_of_a_pixel() {
        let mut sheet = Sheet { step: DVec2::new(1.3, -0.7), rise: 1e-3 };
        let points: Vec<DVec2> =
            (0..12).map(|i| DVec2::new(60.0 + 6.0 * f64::from(i % 4), 40.0 + 8.0 * f64::from(i / 4))).collect();
        let tracks = Tracks::follow(&mut sheet, 0, 12, &points, &Silent).unwrap();
        let camera = sheet.camera();
        let mut errors: Vec<f64> = Vec::new();
        for (frame, row) in tracks.frames.iter().zip(&tracks.points) {
            for (start, found) in points.iter().zip(row).filter_map(|(p, f)| f.map(|f| (p, f))) {
                let pixel = camera.project(found).unwrap();
                errors.push(pixel.distance(*start + sheet.step * *frame as f64));
                assert!((found.z - (0.2 - 1e-3 * *frame as f64)).abs() < 1e-6);
            }
        }
        errors.sort_by(f64::total_cmp);
        assert!(errors.len() > 130, "{} of 156 points are seen", errors.len());
        assert!(errors[errors.len() / 2] < 0.1, "median {} px", errors[errors.len() / 2]);
        assert!(errors[errors.len() * 95 / 100] < 0.3, "95% {} px", errors[errors.len() * 95 / 100]);
    }

    #[test]
    fn covered_points_and_jumps_of_depth_are_lost() {
        let mut sheet = Sheet { step: DVec2::ZERO, rise: 0.0 };
        let points = [DVec2::new(30.0, 40.0), DVec2::new(100.0, 100.0), DVec2::new(100.0, 40.0)];
        let tracks = Tracks::follow(&mut sheet, 0, 10, &points, &Silent).unwrap();
        let seen = |point: usize| tracks.points.iter().map(|row| row[point].is_some()).collect::<Vec<_>>();
        assert_eq!(seen(0), (0..11).map(|i| i < 5).collect::<Vec<_>>(), "an instrument covers it");
        assert_eq!(seen(1), (0..11).map(|i| i < 8).collect::<Vec<_>>(), "depth jumps");
        assert_eq!(seen(2), vec![true; 11]);
        assert!(tracks.row(10).is_some() && tracks.row(11).is_none());
    }

    #[test]
    fn an_interruption_stops() {
        let mut sheet = Sheet { step: DVec2::ZERO, rise: 0.0 };
        let stop = trocar_core::StopAfter::new(3);
        let stopped = Tracks::follow(&mut sheet, 0, 10, &[DVec2::new(60.0, 60.0)], &stop);
        assert!(matches!(stopped, Err(Error::Interrupted)));
    }
}
