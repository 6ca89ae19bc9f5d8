//! The composite: per-pixel medians over a window of frames without the instruments (paper section
//! III, "Instrument removal").

use crate::error::{Error, Result};
use crate::masks::instruments;
use crate::motion::moves;
use crate::settings::Settings;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;
use trocar_camera::{ColorImage, DepthImage, Mask};
use trocar_core::Progress;
use trocar_recording::{LiftInfo, Packet, Recording, RgbdFrame};
use xxhash_rust::xxh3::Xxh3;

/// The scene behind the instruments, from a window of frames.
#[derive(Clone, Debug)]
pub struct Composite {
    /// The centre frame's colour.
    pub input: ColorImage,
    /// The centre frame's instruments.
    pub instruments: Mask,
    /// Median colour; black where `colored` is not set.
    pub color: ColorImage,
    /// Pixels with enough samples of colour.
    pub colored: Mask,
    /// Median depth (m); 0 with too few samples.
    pub depth: DepthImage,
    /// Frames used.
    pub frames_used: usize,
    /// Share of the image under the centre frame's instruments that has depth here.
    pub recovered_share: f64,
    /// Share of the image with depth.
    pub coverage: f64,
    /// Median over pixels of the 10th to 90th percentile range of depth (m).
    pub depth_range_median: f64,
    /// Pixels whose depth changes by more than the sensor's noise.
    pub moving: Mask,
    /// Hash of the bytes of all used frames.
    pub hash: u64,
    /// Times of its parts.
    pub times: CompositeTimes,
}

/// Times of the parts of a composite.
#[derive(Clone, Copy, Debug, Default)]
pub struct CompositeTimes {
    /// Wall time of reading and decoding the frames (s).
    pub frames: f64,
    /// Time that all threads together decode images (s).
    pub decoding: f64,
    /// Wall time of the medians (s).
    pub medians: f64,
}

/// One frame in compact form, because the whole window is in memory at once.
struct Sample {
    frame: usize,
    color: Vec<[u8; 3]>,
    /// Depth in units of the recording; 0 is invalid.
    depth: Vec<u16>,
    instruments: Vec<bool>,
    hash: u64,
}

/// The medians of one pixel.
#[derive(Clone, Copy, Default)]
struct Pixel {
    color: Option<[u8; 3]>,
    /// Median and 10th to 90th percentile range, in units of the recording.
    depth: Option<(f64, f64)>,
    /// Whether its depth changes by more than the sensor's noise.
    moving: bool,
}

/// Buffers for the samples of one pixel, reused from pixel to pixel.
#[derive(Default)]
struct Scratch {
    /// Red, green, blue, depth; sorted.
    sorted: [Vec<u16>; 4],
    /// Depth in the order of time.
    depths: Vec<u16>,
    differences: Vec<u16>,
}

/// Builds the composite. It takes 6 bytes per pixel and frame of the window. Broken frames are left
/// out, with a note.
pub fn composite(
    recording: &Recording,
    settings: &Settings,
    notes: &mut Vec<String>,
    progress: &dyn Progress,
) -> Result<Composite> {
    let scale = recording.depth_scale();
    let centre = settings.centre.unwrap_or_else(|| still_middle(&recording.info.lifts, recording.len()));
    let mut times = CompositeTimes::default();
    let window = window(recording, settings, centre)?;
    let samples = read_window(recording, &window, settings, &mut times, notes, progress)?;
    let clock = Instant::now();

    let (width, height) = (recording.camera().width, recording.camera().height);
    let needed = settings.min_samples.clamp(1, samples.len());
    let mut pixels = vec![Pixel::default(); width * height];
    pixels.par_chunks_mut(width).enumerate().for_each(|(row, out)| {
        let mut scratch = Scratch::default();
        for (column, pixel) in out.iter_mut().enumerate() {
            *pixel = medians(&samples, row * width + column, needed, scale, &mut scratch);
        }
    });

    times.medians = clock.elapsed().as_secs_f64();
    let mut hash = Xxh3::new();
    samples.iter().for_each(|s| hash.update(&s.hash.to_le_bytes()));
    let frames_used = samples.len();
    let Some(centre) = samples.into_iter().min_by_key(|s| s.frame.abs_diff(centre)) else {
        return Err(Error::Setting("the window holds no frame".into()));
    };
    let mut color = ColorImage::new(width, height, [0; 3]);
    let (mut colored, mut depth) = (Mask::new(width, height), DepthImage::new(width, height));
    let mut moving = Mask::new(width, height);
    let (mut ranges, mut recovered) = (Vec::new(), 0usize);
    for (i, pixel) in pixels.iter().enumerate() {
        if let Some(c) = pixel.color {
            color.pixels[i] = c;
            colored.set[i] = true;
        }
        if let Some((median, range)) = pixel.depth {
            depth.depth[i] = (median * scale) as f32;
            ranges.push(range * scale);
            recovered += usize::from(centre.instruments[i]);
        }
        moving.set[i] = pixel.moving;
    }
    let all = (width * height) as f64;
    ranges.sort_by(f64::total_cmp);
    Ok(Composite {
        input: ColorImage { width, height, pixels: centre.color },
        instruments: Mask { width, height, set: centre.instruments },
        color,
        colored,
        depth,
        frames_used,
        recovered_share: recovered as f64 / all,
        coverage: ranges.len() as f64 / all,
        depth_range_median: ranges.get(ranges.len() / 2).copied().unwrap_or(0.0),
        moving,
        hash: hash.digest(),
        times,
    })
}

/// Reads and decodes the frames of `window`, in its order.
fn read_window(
    recording: &Recording,
    window: &[usize],
    settings: &Settings,
    times: &mut CompositeTimes,
    notes: &mut Vec<String>,
    progress: &dyn Progress,
) -> Result<Vec<Sample>> {
    let scale = recording.depth_scale();
    let clock = Instant::now();
    let decoding = AtomicU64::new(0);
    progress.begin("frames", window.len() as u64);
    let read = |packet: Packet| {
        if progress.interrupted() {
            return (packet.frame, Err(Error::Interrupted));
        }
        let sample = packet.parts.map_err(Error::from).and_then(|parts| {
            let clock = Instant::now();
            let frame = recording.decode(packet.frame, &parts)?;
            decoding.fetch_add(clock.elapsed().as_nanos() as u64, Ordering::Relaxed);
            let found = instruments(recording.info.instruments, &frame, &recording.frame_name(packet.frame))?;
            let RgbdFrame { color, depth, instruments } = frame;
            let instruments = found.unwrap_or(instruments);
            Ok(Sample {
                frame: packet.frame,
                depth: depth.depth.iter().map(|z| units(*z, scale)).collect(),
                color: color.pixels,
                instruments: instruments.set,
                hash: parts.hash(),
            })
        });
        progress.advance(1);
        (packet.frame, sample)
    };
    // One thread reads while the others decode. A packet is decoded at once, so at most one per
    // thread waits.
    let mut read: Vec<(usize, Result<Sample>)> = recording.packets(window).par_bridge().map(read).collect();
    progress.end();
    if progress.interrupted() {
        return Err(Error::Interrupted);
    }
    times.frames = clock.elapsed().as_secs_f64();
    times.decoding = 1e-9 * decoding.into_inner() as f64;
    read.sort_by_key(|(frame, _)| *frame);
    let (mut samples, mut broken) = (Vec::with_capacity(read.len()), Vec::new());
    for (_, sample) in read {
        match sample {
            Ok(sample) => samples.push(sample),
            Err(e) => broken.push(e),
        }
    }
    let count = broken.len();
    if let Some(first) = broken.into_iter().next() {
        if samples.len() < settings.min_samples.min(window.len()) {
            return Err(first);
        }
        notes.push(format!("{count} of {} frames are broken and were left out (first: {first}).", window.len()));
    }
    Ok(samples)
}

/// A depth (m) in whole units of `scale` (m); 0, which is invalid, beyond 16 bits.
fn units(depth: f32, scale: f64) -> u16 {
    let units = (f64::from(depth) / scale).round();
    if units <= f64::from(u16::MAX) { units as u16 } else { 0 }
}

/// Indices of the window's frames.
fn window(recording: &Recording, settings: &Settings, centre: usize) -> Result<Vec<usize>> {
    let wrong = |reason: String| Error::Input { path: recording.dir().to_owned(), reason };
    if centre >= recording.len() {
        return Err(wrong(format!(
            "the window's centre is frame {centre}; the recording has {} frames (--centre)",
            recording.len()
        )));
    }
    if settings.stride == 0 {
        return Err(wrong("the window's stride is 0; it must be at least 1".into()));
    }
    let longest = recording.len().max(Settings::default().window);
    if settings.window > longest {
        let reason = format!(
            "the window is {} frames on each side of its centre; the recording has {} frames in all (--window)",
            settings.window,
            recording.len()
        );
        return Err(wrong(reason));
    }
    let first = centre - settings.window.min(centre) / settings.stride * settings.stride;
    let last = centre.saturating_add(settings.window).min(recording.len() - 1);
    let all: Vec<usize> = (first..=last).step_by(settings.stride).collect();
    // Tissue that is lifted does not lie still. A centre within a lift is the user's own choice.
    let lifts = &recording.info.lifts;
    let still: Vec<usize> = all.iter().copied().filter(|f| !lifts.iter().any(|lift| lift.holds(*f))).collect();
    Ok(if still.contains(&centre) { still } else { all })
}

/// The middle of the longest run of `frames` frames outside of all lifts; of all frames if there is
/// none.
fn still_middle(lifts: &[LiftInfo], frames: usize) -> usize {
    let (mut best, mut start) = (0..0, 0);
    for frame in 0..=frames {
        if frame == frames || lifts.iter().any(|lift| lift.holds(frame)) {
            if frame - start > best.len() {
                best = start..frame;
            }
            start = frame + 1;
        }
    }
    if best.is_empty() { frames / 2 } else { best.start + best.len() / 2 }
}

/// Medians over V(u,v): colour over the frames in which no instrument covers the pixel, depth over
/// those of them that measured it.
fn medians(samples: &[Sample], i: usize, needed: usize, scale: f64, scratch: &mut Scratch) -> Pixel {
    let Scratch { sorted, depths, differences } = scratch;
    sorted.iter_mut().for_each(Vec::clear);
    for sample in samples.iter().filter(|s| !s.instruments[i]) {
        for (v, c) in sorted.iter_mut().zip(sample.color[i]) {
            v.push(u16::from(c));
        }
        if sample.depth[i] > 0 {
            sorted[3].push(sample.depth[i]);
        }
    }
    depths.clone_from(&sorted[3]);
    sorted.iter_mut().for_each(|v| v.sort_unstable());
    let enough = |v: &[u16]| v.len() >= needed;
    let [r, g, b, depth] = sorted;
    let color = enough(r).then(|| [&*r, g, b].map(|v| percentile(v, 0.5).round() as u8));
    let depth = enough(depth).then(|| (percentile(depth, 0.5), percentile(depth, 0.9) - percentile(depth, 0.1)));
    let moving = depth.is_some_and(|(_, range)| moves(depths, range, scale, differences));
    Pixel { color, depth, moving }
}

/// Percentile `p` in [0, 1] of sorted values, linear between neighbours.
fn percentile(sorted: &[u16], p: f64) -> f64 {
    let at = p * (sorted.len() - 1) as f64;
    let (low, high) = (sorted[at.floor() as usize], sorted[at.ceil() as usize]);
    f64::from(low) + (f64::from(high) - f64::from(low)) * at.fract()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_leave_instruments_and_holes_out() {
        let sample = |color: u8, depth: u16, masked: bool| Sample {
            frame: 0,
            color: vec![[color; 3]],
            depth: vec![depth],
            instruments: vec![masked],
            hash: 0,
        };
        let samples = [
            sample(10, 100, false),
            sample(20, 0, false),
            sample(250, 50, true),
            sample(30, 104, false),
            sample(40, 102, false),
        ];
        let pixel = medians(&samples, 0, 3, 1e-3, &mut Scratch::default());
        assert_eq!(pixel.color, Some([25; 3]));
        let (median, range) = pixel.depth.unwrap();
        assert_eq!(median, 102.0);
        assert!((range - 3.2).abs() < 1e-12);
        assert!(medians(&samples, 0, 4, 1e-3, &mut Scratch::default()).depth.is_none());
        assert!(medians(&samples, 0, 4, 1e-3, &mut Scratch::default()).color.is_some());
    }

    #[test]
    fn the_window_is_centred_where_no_tissue_is_lifted() {
        let lift = |rest, last| LiftInfo { force_n: None, rest, first: rest + 1, last, click: [0.0; 2] };
        assert_eq!(still_middle(&[], 100), 50);
        assert_eq!(still_middle(&[lift(60, 79), lift(80, 99)], 100), 30);
        assert_eq!(still_middle(&[lift(0, 9), lift(20, 29)], 100), 65);
        assert_eq!(still_middle(&[lift(0, 99)], 100), 50);
    }
}
