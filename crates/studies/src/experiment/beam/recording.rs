//! Motion capture of the beam: a C3D file.

use super::swing::Track;
use crate::{Error, Result};
use c3dio::C3d;
use glam::DVec3;
use std::path::Path;

/// The largest file that is read (bytes).
const MAX_BYTES: u64 = 64 << 20;

/// Markers of the beam's end have names that begin so.
const TIP: &str = "Tip";

/// The part of the recording at its end in which the beam is at rest (s).
const REST_S: f64 = 0.5;

/// Reads how far the mean of the tip's markers is from where the tip is held at the beginning,
/// along the way to where it comes to rest.
///
/// # Errors
/// A file that cannot be read, and what it lacks.
pub(super) fn read(path: &Path) -> Result<Track> {
    let io = |source| Error::Io { path: path.to_owned(), source };
    if std::fs::metadata(path).map_err(io)?.len() > MAX_BYTES {
        return Err(Error::Mismatch(format!("{}: it is longer than {MAX_BYTES} bytes", path.display())));
    }
    let bytes = std::fs::read(path).map_err(io)?;
    let wrong = |why: &str| Error::Mismatch(format!("{}: {why}", path.display()));
    // The library checks most of a file, but not all: what it panics at is no C3D file either.
    let parsed = std::panic::catch_unwind(|| C3d::from_bytes(&bytes).ok()).ok().flatten();
    let points = parsed.ok_or_else(|| wrong("it is no C3D file"))?.points;
    let unit: String = points.units.iter().collect();
    let metres = match unit.trim() {
        "m" => 1.0,
        "mm" => 1e-3,
        unit => return Err(wrong(&format!("its unit is '{unit}'; it must be m or mm"))),
    };
    let (frames, rate) = (points.size().0, f64::from(points.frame_rate));
    let planned = (1 + usize::from(points.last_frame)).saturating_sub(usize::from(points.first_frame));
    if frames < planned {
        return Err(wrong(&format!("it ends after {frames} of {planned} frames")));
    }
    if !(10.0..=10_000.0).contains(&rate) {
        return Err(wrong(&format!("its rate is {rate} Hz; it must be in [10, 10000]")));
    }
    let tips: Vec<usize> = (0..points.labels.len()).filter(|k| points.labels[*k].starts_with(TIP)).collect();
    if tips.is_empty() {
        return Err(wrong(&format!("no marker has a name that begins with '{TIP}'")));
    }
    let tip = |frame: usize| -> Option<DVec3> {
        let markers = tips.iter().map(|marker| points.get(frame, *marker));
        let sum: DVec3 = markers.map(|m| m.map(|m| DVec3::from(m.point.map(f64::from)))).sum::<Option<DVec3>>()?;
        Some(metres * sum / tips.len() as f64)
    };
    let places: Vec<DVec3> = (0..frames).map_while(tip).filter(|p| p.is_finite()).collect();
    let resting = (REST_S * rate) as usize;
    if places.len() < 4 * resting {
        return Err(wrong(&format!("it has {} frames with all markers; {} are needed", places.len(), 4 * resting)));
    }
    let rest = places[places.len() - resting..].iter().sum::<DVec3>() / resting as f64;
    let way = (rest - places[0]).normalize_or_zero();
    // Held until it has gone a twentieth of the way.
    let along: Vec<f64> = places.iter().map(|p| (*p - places[0]).dot(way)).collect();
    let settled = (rest - places[0]).dot(way);
    let begin = along.iter().position(|d| *d > 0.05 * settled).unwrap_or(0);
    let held = &along[..begin.saturating_sub(2).max(1)];
    let zero = held.iter().sum::<f64>() / held.len() as f64;
    Ok(Track { step: 1.0 / rate, places: along[begin.saturating_sub(1)..].iter().map(|d| d - zero).collect() })
}
