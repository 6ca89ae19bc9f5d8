//! Describes the contents of a recording, and writes a template of its `recording.toml`.

use crate::{Error, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};
use trocar_camera::Camera;
use trocar_recording::{OrganInfo, Recording, RecordingInfo};

/// The contents of a recording.
#[derive(Clone, Debug, Serialize)]
pub struct Inspection {
    /// The recording.
    pub recording: String,
    /// Number of frames, paired.
    pub frames: usize,
    /// The camera to whose pixels everything is registered.
    pub camera: Camera,
    /// The depth camera where it is another; depth is then registered.
    pub depth_camera: Option<Camera>,
    /// Unit of depth (m).
    pub depth_scale_m: f64,
    /// Share of the middle frame's pixels with depth.
    pub coverage: f64,
    /// Nearest and farthest depth of the middle frame without the outermost hundredths (m).
    pub depth_range_m: [f64; 2],
    /// Organs of the `.toml` with a mask, an outline or points.
    pub organs: Vec<String>,
    /// The data that the organs of the `.toml` lack, one sentence each.
    pub missing: Vec<String>,
    /// The topics of a log.
    pub topics: Vec<String>,
    /// Notes on dropped or replaced frames.
    pub notes: Vec<String>,
    /// Files written.
    pub written: Vec<String>,
}

/// Opens `recording` and measures its middle frame. With `template`, writes a template `.toml` and
/// an image of the middle frame beside a log without a `.toml`.
///
/// # Errors
/// As for reading the recording; with `template`, where there already is a `.toml`.
pub fn inspect(recording: &Path, template: bool) -> Result<Inspection> {
    let opened = Recording::open(recording)?;
    let middle = opened.len() / 2;
    // A broken middle frame is replaced by the next whole one.
    let frame = (0..opened.len()).map(|i| opened.frame((middle + i) % opened.len())).find_map(std::result::Result::ok);
    let depths = frame.as_ref().map(|f| f.depth.depth.as_slice()).unwrap_or_default();
    let mut valid: Vec<f64> = depths.iter().filter(|z| **z > 0.0).map(|z| f64::from(*z)).collect();
    valid.sort_by(f64::total_cmp);
    let at = |p: f64| valid.get((p * valid.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(0.0);
    let mut written = Vec::new();
    if template {
        if opened.toml().is_file() {
            let reason = "it exists already and is not overwritten".to_owned();
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
    let (found, without): (Vec<&OrganInfo>, Vec<&OrganInfo>) = opened
        .info
        .organs
        .iter()
        .partition(|o| !o.polygon.is_empty() || !o.points.is_empty() || opened.organ_mask_file(&o.name).is_file());
    Ok(Inspection {
        recording: recording.display().to_string(),
        frames: opened.len(),
        camera: opened.camera(),
        depth_camera: opened.registration().map(|r| r.depth),
        depth_scale_m: opened.depth_scale(),
        coverage: valid.len() as f64 / depths.len().max(1) as f64,
        depth_range_m: [at(0.01), at(0.99)],
        organs: found.iter().map(|o| o.name.clone()).collect(),
        missing: without.iter().map(|o| missing_mask(&opened, o)).collect(),
        topics: opened.describe(),
        notes: opened.notes().to_vec(),
        written: written.iter().map(|p: &PathBuf| p.display().to_string()).collect(),
    })
}

/// Says that an organ cannot be found.
fn missing_mask(recording: &Recording, organ: &OrganInfo) -> String {
    let file = recording.organ_mask_file(&organ.name);
    format!(
        "organ '{}' has no mask: {} does not exist, and there are neither a polygon nor points",
        organ.name,
        file.display()
    )
}

fn write_template(recording: &Recording, written: &mut Vec<PathBuf>) -> Result<()> {
    let camera = recording.camera();
    let (w, h) = (camera.width as f64, camera.height as f64);
    let organ = OrganInfo {
        name: "organ".into(),
        polygon: [(0.4, 0.4), (0.6, 0.4), (0.6, 0.6), (0.4, 0.6)]
            .map(|(x, y)| [(x * w).round(), (y * h).round()])
            .into(),
        ..OrganInfo::default()
    };
    let described = |info: &RecordingInfo| toml::to_string(info).map_err(|e| Error::Format(e.to_string()));
    let text = described(&recording.info)?;
    // The organ is a comment, because an outline that nobody drew must not become an organ.
    let with_organ = described(&RecordingInfo { organs: vec![organ], ..recording.info.clone() })?;
    let example = with_organ.split_once("[[organ]]").map_or(String::new(), |(_, rest)| format!("[[organ]]{rest}"));
    let example: String =
        example.lines().map(|l| if l.is_empty() { "#\n".into() } else { format!("# {l}\n") }).collect();
    let comment = "# Facts of this recording; docs/guides/recordings.md explains every key. Cameras and\n\
                   # depth scale come from the log unless they are given here. Describe each organ below\n\
                   # by its outline in pixels of the colour image, or by a mask.\n";
    let path = recording.toml().to_owned();
    std::fs::write(&path, format!("{comment}{text}\n{example}"))
        .map_err(|source| Error::Io { path: path.clone(), source })?;
    written.push(path);
    Ok(())
}
