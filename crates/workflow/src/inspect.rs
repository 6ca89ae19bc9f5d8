//! What a recording holds, before anything is made of it; and the file to say more of it.

use crate::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};
use trocar_camera::Camera;
use trocar_recording::{OrganInfo, Recording, RecordingInfo};
use trocar_specimen::{Material, Pins};

/// A recording in figures.
#[derive(Clone, Debug, Serialize)]
pub struct Inspection {
    /// The recording.
    pub recording: String,
    /// Frames, paired.
    pub frames: usize,
    /// The camera on whose pixels everything ends up.
    pub camera: Camera,
    /// The depth camera where it is another; depth is then registered.
    pub depth_camera: Option<Camera>,
    /// Metres a unit of depth.
    pub depth_scale_m: f64,
    /// Share of the middle frame's pixels with depth.
    pub coverage: f64,
    /// Nearest and farthest depth of the middle frame, without the outermost hundredths [m].
    pub depth_range_m: [f64; 2],
    /// Organs named in the `.toml`.
    pub organs: Vec<String>,
    /// The topics of a log.
    pub topics: Vec<String>,
    /// What was dropped or replaced.
    pub notes: Vec<String>,
    /// Files written.
    pub written: Vec<String>,
}

/// Opens `recording` and looks at its middle frame. With `template`, a `.toml` to fill in and a still of the middle frame are
/// written beside a log that has no `.toml` yet.
///
/// # Errors
/// As for reading the recording; a template where there is a `.toml` already.
pub fn inspect(recording: &Path, template: bool) -> Result<Inspection> {
    let opened = Recording::open(recording)?;
    let middle = opened.len() / 2;
    // A broken frame in the middle is no reason to say nothing.
    let frame = (0..opened.len()).map(|i| opened.frame((middle + i) % opened.len())).find_map(std::result::Result::ok);
    let depths = frame.as_ref().map(|f| f.depth.depth.as_slice()).unwrap_or_default();
    let mut valid: Vec<f64> = depths.iter().filter(|z| **z > 0.0).map(|z| f64::from(*z)).collect();
    valid.sort_by(f64::total_cmp);
    let at = |p: f64| valid.get((p * valid.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(0.0);
    let mut written = Vec::new();
    if template {
        if opened.toml().is_file() {
            let reason = "is there already; it is not overwritten".to_owned();
            return Err(Error::Exists { path: opened.toml().to_owned(), reason });
        }
        write_template(&opened, &mut written)?;
        if let Some(frame) = &frame {
            let still = opened.toml().with_extension("png");
            if !still.exists() {
                frame.color.write_png(&still)?;
                written.push(still);
            }
        }
    }
    Ok(Inspection {
        recording: recording.display().to_string(),
        frames: opened.len(),
        camera: opened.camera(),
        depth_camera: opened.registration().map(|r| r.depth),
        depth_scale_m: opened.depth_scale(),
        coverage: valid.len() as f64 / depths.len().max(1) as f64,
        depth_range_m: [at(0.01), at(0.99)],
        organs: opened.info.organs.iter().map(|o| o.name.clone()).collect(),
        topics: opened.describe(),
        notes: opened.notes().to_vec(),
        written: written.iter().map(|p: &PathBuf| p.display().to_string()).collect(),
    })
}

fn write_template(recording: &Recording, written: &mut Vec<PathBuf>) -> Result<()> {
    let camera = recording.camera();
    let (w, h) = (camera.width as f64, camera.height as f64);
    let organ = OrganInfo {
        name: "organ".into(),
        polygon: [(0.4, 0.4), (0.6, 0.4), (0.6, 0.6), (0.4, 0.6)]
            .map(|(x, y)| [(x * w).round(), (y * h).round()])
            .into(),
        points: Vec::new(),
        points_outside: Vec::new(),
        base_px: None,
        material: Material::default(),
        pins: Pins::Band { share: 0.42 },
    };
    let described = |info: &RecordingInfo| toml::to_string(info).map_err(|e| Error::Format(e.to_string()));
    let text = described(&recording.info)?;
    // The organ is a comment: an outline that nobody drew must not become an organ.
    let with_organ = described(&RecordingInfo { organs: vec![organ], ..recording.info.clone() })?;
    let example = with_organ.split_once("[[organ]]").map_or(String::new(), |(_, rest)| format!("[[organ]]{rest}"));
    let example: String =
        example.lines().map(|l| if l.is_empty() { "#\n".into() } else { format!("# {l}\n") }).collect();
    let comment = "# What is known of this recording; docs/guides/recordings.md explains every key. Cameras and depth scale come from the log\n\
                   # unless they are said here. Name each organ below, with its outline in pixels of the colour image, or a mask.\n";
    let path = recording.toml().to_owned();
    std::fs::write(&path, format!("{comment}{text}\n{example}"))
        .map_err(|source| Error::Io { path: path.clone(), source })?;
    written.push(path);
    Ok(())
}
