//! Lists the files of each frame: from `frames.csv`, or by pairing the files of the folders.

use crate::error::{Error, Result};
use crate::pairing::Pairing;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

#[derive(Clone, Debug)]
pub struct FrameFiles {
    /// Colour; absent in a recording of depth alone.
    pub color: Option<PathBuf>,
    /// Depth.
    pub depth: PathBuf,
    /// Instrument mask; absent where the recording has none.
    pub instruments: Option<PathBuf>,
}

/// Frames in recorded order, and notes on dropped ones.
pub struct FrameList {
    /// At least one frame.
    pub frames: Vec<FrameFiles>,
    /// Notes for the user, one sentence each.
    pub notes: Vec<String>,
}

/// One line of `frames.csv`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    index: u64,
    time_s: f64,
    color: String,
    depth: String,
    #[serde(default)]
    instruments: String,
}

/// Lists the frames of the recording folder `dir`.
pub fn list_frames(dir: &Path) -> Result<FrameList> {
    let index = dir.join("frames.csv");
    let list = if index.is_file() { from_csv(dir, &index)? } else { from_folders(dir)? };
    match list.frames.is_empty() {
        true => Err(wrong(dir, "there are no frames; depth images must be in depth/, colour images in color/")),
        false => Ok(list),
    }
}

fn from_csv(dir: &Path, path: &Path) -> Result<FrameList> {
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path).map_err(|e| wrong(path, e.to_string()))?;
    let (mut frames, mut missing) = (Vec::new(), Vec::new());
    let mut previous: Option<u64> = None;
    let mut last_time = f64::NEG_INFINITY;
    let mut maskless = 0;
    for (row, line) in reader.deserialize::<Row>().zip(2..) {
        let row = row.map_err(|e| wrong(path, explain(&e)))?;
        let at = |reason: String| wrong(path, format!("line {line}: {reason}"));
        if !row.time_s.is_finite() || row.time_s < last_time {
            return Err(at(format!(
                "time_s is {}; it must be finite seconds, at least those of the line above",
                row.time_s
            )));
        }
        last_time = row.time_s;
        if previous.is_some_and(|p| p >= row.index) {
            return Err(at(format!("index is {} after {}; indices must ascend", row.index, previous.unwrap_or(0))));
        }
        previous = Some(row.index);
        let file = |column: &str, name: &str| match name {
            "" => Ok(None),
            _ if Path::new(name).components().all(|c| matches!(c, Component::Normal(_))) => Ok(Some(dir.join(name))),
            _ => Err(at(format!("{column} is '{name}'; it must be a path inside the recording folder, without '..'"))),
        };
        let color = file("color", &row.color)?;
        let depth =
            file("depth", &row.depth)?.ok_or_else(|| at("depth is empty; it must name a file of the folder".into()))?;
        let instruments = file("instruments", &row.instruments)?;
        // A frame without its mask file shows no instrument; a note below says so.
        let instruments = instruments.filter(|f| {
            let there = f.is_file();
            maskless += usize::from(!there);
            there
        });
        let absent = [color.as_ref(), Some(&depth)].into_iter().flatten().find(|f| !f.is_file()).cloned();
        match absent {
            Some(absent) => missing.push(absent),
            None => frames.push(FrameFiles { color, depth, instruments }),
        }
    }
    if frames.is_empty() {
        return Err(match missing.first() {
            Some(first) => wrong(first, "no such file, and no frame of frames.csv has all of its files"),
            None => wrong(
                path,
                "there are no frames below the header; add lines, or remove the file to pair images by name",
            ),
        });
    }
    // Masks made later are found by name.
    let masks = dir.join("masks/instruments");
    for frame in frames.iter_mut().filter(|f: &&mut FrameFiles| f.instruments.is_none()) {
        let mask = masks.join(format!("{}.png", stem(frame.color.as_ref().unwrap_or(&frame.depth))));
        frame.instruments = mask.is_file().then_some(mask);
    }
    let with_color = frames.iter().filter(|f| f.color.is_some()).count();
    if with_color != 0 && with_color != frames.len() {
        let reason =
            format!("{with_color} of {} frames have a color file; all of them or none must have one", frames.len());
        return Err(wrong(path, reason));
    }
    let mut notes = Vec::new();
    if maskless > 0 {
        notes.push(format!(
            "{maskless} instrument masks of frames.csv are missing; these frames count as without instruments."
        ));
    }
    if let Some(first) = missing.first() {
        let name = first.strip_prefix(dir).unwrap_or(first).display();
        notes.push(format!(
            "{} frames of frames.csv were dropped because a file is missing (first: {name}).",
            missing.len()
        ));
    }
    Ok(FrameList { frames, notes })
}

/// The CSV reader's error, with line and column.
fn explain(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::Deserialize { pos, err } => {
            let line = pos.as_ref().map_or(1, csv::Position::line);
            let field = err.field().map_or(String::new(), |f| format!("column {}: ", f + 1));
            format!("line {line}: {field}{}; the columns are index,time_s,color,depth,instruments", err.kind())
        }
        _ => error.to_string(),
    }
}

fn from_folders(dir: &Path) -> Result<FrameList> {
    let depth_dir = dir.join("depth");
    if !depth_dir.is_dir() {
        return Err(wrong(&depth_dir, "the folder does not exist; depth images (16-bit PNG) must be in it"));
    }
    let depth = images(&depth_dir)?;
    let mut notes = Vec::new();
    let color_dir = ["color", "rgb"].map(|name| dir.join(name)).into_iter().find(|d| d.is_dir());
    let mut frames: Vec<FrameFiles> = if let Some(color_dir) = color_dir {
        let color = images(&color_dir)?;
        if color.is_empty() {
            return Err(wrong(
                &color_dir,
                "there is no PNG or JPEG in it; remove the folder if the recording has depth alone",
            ));
        }
        pair(&color, &depth, &mut notes)
    } else {
        notes.push("The recording has no colour; a grey shading of its depth replaces it.".into());
        depth.into_iter().map(|depth| FrameFiles { color: None, depth, instruments: None }).collect()
    };
    attach_instruments(&dir.join("masks/instruments"), &mut frames, &mut notes)?;
    Ok(FrameList { frames, notes })
}

/// Pairs files of equal stem; without any, by the times in their names; without times, in order.
fn pair(color: &[PathBuf], depth: &[PathBuf], notes: &mut Vec<String>) -> Vec<FrameFiles> {
    let by_stem: BTreeMap<String, &PathBuf> = depth.iter().map(|d| (stem(d), d)).collect();
    let frame = |c: &PathBuf, d: &PathBuf| FrameFiles { color: Some(c.clone()), depth: d.clone(), instruments: None };
    let mut frames: Vec<_> = color.iter().filter_map(|c| by_stem.get(&stem(c)).map(|d| frame(c, d))).collect();
    if !frames.is_empty() {
        if frames.len() != color.len() || frames.len() != depth.len() {
            notes.push(format!(
                "{} colour and {} depth images were paired by name into {} frames; the rest were dropped.",
                color.len(),
                depth.len(),
                frames.len()
            ));
        }
        return frames;
    }
    if let (Some(color_times), Some(depth_times)) = (times(color), times(depth)) {
        let pairing = Pairing::by_time(&color_times, &depth_times);
        notes.extend(pairing.notes());
        return pairing.pairs.iter().map(|&(c, d)| frame(&color[c], &depth[d])).collect();
    }
    frames = color.iter().zip(depth).map(|(c, d)| frame(c, d)).collect();
    notes.push(format!(
        "No colour and depth images share a name or have times in their names, so {} colour and {} depth images were paired in order \
         into {} frames.",
        color.len(),
        depth.len(),
        frames.len()
    ));
    frames
}

/// Times in the names of all files (s): the last number of the name with a decimal point, as the
/// tools of RealSense and the TUM benchmark write them.
fn times(files: &[PathBuf]) -> Option<Vec<f64>> {
    let time = |file: &PathBuf| {
        let stem = stem(file);
        let number = stem.rsplit(|c: char| !c.is_ascii_digit() && c != '.').find(|part| !part.is_empty())?;
        number.contains('.').then(|| number.parse().ok())?
    };
    files.iter().map(time).collect()
}

/// Assigns each frame the instrument mask of its stem. Where no stem matches and the counts are
/// equal, assigns them in order.
fn attach_instruments(dir: &Path, frames: &mut [FrameFiles], notes: &mut Vec<String>) -> Result<()> {
    if !dir.is_dir() || frames.is_empty() {
        return Ok(());
    }
    let masks = images(dir)?;
    if masks.is_empty() {
        return Ok(());
    }
    let by_stem: BTreeMap<String, &PathBuf> = masks.iter().map(|m| (stem(m), m)).collect();
    for frame in frames.iter_mut() {
        let found = frame.color.iter().chain([&frame.depth]).find_map(|f| by_stem.get(&stem(f)));
        frame.instruments = found.map(|m| (*m).clone());
    }
    let mut without = frames.iter().filter(|f| f.instruments.is_none()).count();
    if without == frames.len() {
        if masks.len() != frames.len() {
            let reason = format!(
                "there are {} masks for {} frames, and no mask has the name of a frame",
                masks.len(),
                frames.len()
            );
            return Err(wrong(dir, reason));
        }
        for (frame, mask) in frames.iter_mut().zip(masks) {
            frame.instruments = Some(mask);
        }
        without = 0;
    }
    if without > 0 {
        notes.push(format!("{without} frames have no instrument mask and count as without instruments."));
    }
    Ok(())
}

/// The image files of a folder, in natural order of their names (2 before 10).
fn images(dir: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(dir).map_err(Error::io(dir))? {
        let path = entry.map_err(Error::io(dir))?.path();
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        if path.is_file() && matches!(extension.as_deref(), Some("png" | "jpg" | "jpeg")) {
            files.push(path);
        }
    }
    files.sort_by_cached_key(|f| (natural(&stem(f)), f.clone()));
    Ok(files)
}

/// The file's name without extension.
pub fn stem(path: &Path) -> String {
    path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
}

/// A sort key that orders numbers by value: runs of digits are padded.
fn natural(name: &str) -> String {
    let (mut key, mut digits) = (String::new(), String::new());
    for c in name.chars().chain(['\0']) {
        if c.is_ascii_digit() {
            digits.push(c);
            continue;
        }
        if !digits.is_empty() {
            key.push_str(&format!("{:0>24}", digits.trim_start_matches('0')));
            digits.clear();
        }
        key.push(c);
    }
    key
}

fn wrong(path: &Path, reason: impl Into<String>) -> Error {
    Error::wrong(path, reason)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_sort_by_value() {
        let mut names = ["frame10", "frame9", "frame009b", "a", "frame100"];
        names.sort_by_key(|n| natural(n));
        assert_eq!(names, ["a", "frame9", "frame009b", "frame10", "frame100"]);
    }

    #[test]
    fn unequal_counts_pair_by_name_then_by_order() {
        let files = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        let mut notes = Vec::new();
        let frames =
            pair(&files(&["0.jpg", "2.jpg", "3.jpg"]), &files(&["0.png", "1.png", "2.png", "3.png"]), &mut notes);
        assert_eq!(frames.iter().map(|f| stem(&f.depth)).collect::<Vec<_>>(), ["0", "2", "3"]);
        assert!(notes[0].contains("by name"));
        let frames = pair(&files(&["c0.jpg", "c1.jpg"]), &files(&["d0.png", "d1.png", "d2.png"]), &mut notes);
        assert_eq!(frames.iter().map(|f| stem(&f.depth)).collect::<Vec<_>>(), ["d0", "d1"]);
        assert!(notes[1].contains("in order"));
        let frames = pair(
            &files(&["c_7.01.jpg", "c_7.04.jpg"]),
            &files(&["d_7.03.png", "d_7.06.png", "d_7.00.png"]),
            &mut notes,
        );
        assert_eq!(frames.iter().map(|f| stem(&f.depth)).collect::<Vec<_>>(), ["d_7.00", "d_7.03"]);
    }
}
