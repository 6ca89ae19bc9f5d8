//! Measures how well instruments are found in a recording with known instrument masks, such as a
//! phantom's: `cargo run --release -p trocar-segment --example metal -- RECORDING [PICTURES]`. With
//! a second folder it also writes pictures there: found in green, missed in red, wrongly included
//! in blue.

#![allow(clippy::print_stdout, reason = "it prints its figures")]

use std::path::Path;
use std::time::Instant;
use trocar_camera::{ColorImage, DepthImage, Mask};
use trocar_segment::{MetalDetector, Picture, Segmenter, Target};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [recording, pictures @ ..] = arguments.as_slice() else {
        return Err("usage: metal RECORDING [PICTURES]".into());
    };
    let recording = Path::new(recording);
    let mut files: Vec<_> = std::fs::read_dir(recording.join("color"))?.collect::<Result<_, _>>()?;
    files.sort_by_key(std::fs::DirEntry::file_name);
    for with_depth in [true, false] {
        let (mut hit, mut missed, mut extra, mut seconds, mut worst) = (0, 0, 0, 0.0, 1.0_f64);
        for file in &files {
            let name = file.file_name().to_string_lossy().into_owned();
            let color = ColorImage::read(&file.path())?;
            let depth = DepthImage::read(&recording.join("depth").join(&name), 0.001).ok().filter(|_| with_depth);
            let truth = Mask::read(&recording.join("masks/instruments").join(&name))?;
            let start = Instant::now();
            let picture = Picture { color: &color, depth: depth.as_ref(), name: &name };
            let found = MetalDetector::default().segment(&picture, &Target::default())?;
            seconds += start.elapsed().as_secs_f64();
            let mut shown = color.clone();
            let before = (hit, missed);
            for (i, p) in shown.pixels.iter_mut().enumerate() {
                let tint = match (found.set[i], truth.set[i]) {
                    (true, true) => [0, 255, 0],
                    (false, true) => [255, 0, 0],
                    (true, false) => [0, 0, 255],
                    _ => continue,
                };
                hit += usize::from(tint[1] > 0);
                missed += usize::from(tint[0] > 0);
                extra += usize::from(tint[2] > 0);
                *p = [0, 1, 2].map(|c| p[c] / 2 + tint[c] / 2);
            }
            worst = worst.min((hit - before.0) as f64 / (hit - before.0 + missed - before.1).max(1) as f64);
            if let (Some(folder), true) = (pictures.first(), with_depth) {
                shown.write_png(&Path::new(folder).join(&name))?;
            }
        }
        let share = |part: usize, whole: usize| part as f64 / whole.max(1) as f64;
        println!(
            "{}: recall {:.4} (worst frame {worst:.4}), precision {:.4}, IoU {:.4}, {:.1} ms a frame",
            if with_depth { "with depth" } else { "colour alone" },
            share(hit, hit + missed),
            share(hit, hit + extra),
            share(hit, hit + missed + extra),
            1000.0 * seconds / files.len().max(1) as f64
        );
    }
    Ok(())
}
