//! The stages of the reconstruction in order.

use crate::body::fill_with_tets;
use crate::composite::{Composite, composite};
use crate::masks::OrganSegmenters;
use crate::motion::WARN_SHARE;
use crate::organ::{Closed, View, close};
use crate::{Error, Result, Settings};
use trocar_camera::Mask;
use trocar_core::{Pose, Progress};
use trocar_recording::{OrganInfo, Recording};
use trocar_specimen::{Organ, Provenance, Specimen};
use xxhash_rust::xxh3::Xxh3;

/// One organ in the composite, for the report.
#[derive(Clone, Debug)]
pub struct OrganView {
    /// Its name.
    pub name: String,
    /// Its mask in the composite.
    pub mask: Mask,
    /// Surface depth minus measured depth on the compared pixels (m); 0 elsewhere.
    pub depth_error: Vec<f32>,
    /// The compared pixels.
    pub compared: Mask,
    /// Share of its pixels with depth that move during the window.
    pub moving_share: f64,
}

/// A specimen and its intermediate results.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// The result.
    pub specimen: Specimen,
    /// The scene behind the instruments.
    pub composite: Composite,
    /// Per organ, in the specimen's order.
    pub organs: Vec<OrganView>,
    /// Warnings that the result may be wrong (organs that move during the window), one sentence
    /// each.
    pub warnings: Vec<String>,
    /// Notes for the user (dropped frames, filled holes, clipped organs), one sentence each.
    pub notes: Vec<String>,
}

/// The program's name and version, for the provenance.
pub(crate) fn program() -> String {
    format!("trocar {}", env!("CARGO_PKG_VERSION"))
}

/// Reconstructs every organ of a recording.
///
/// # Errors
/// A setting out of range, a broken recording, an organ that cannot be closed or filled, or an
/// interruption.
///
/// ```no_run
/// use trocar_core::Silent;
/// use trocar_reconstruct::{Settings, reconstruct};
/// use trocar_recording::Recording;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let recording = Recording::open("recording".as_ref())?;
/// let made = reconstruct(&recording, &Settings::default(), &Silent)?;
/// made.specimen.write("specimen".as_ref())?;
/// # Ok(())
/// # }
/// ```
pub fn reconstruct(recording: &Recording, settings: &Settings, progress: &dyn Progress) -> Result<Reconstruction> {
    settings.validate()?;
    if recording.info.organs.is_empty() {
        return Err(Error::Input {
            path: recording.toml().to_owned(),
            reason: "there is no [[organ]]; add at least one, with a mask in masks/, a polygon or points (`trocar inspect --template` writes an example)".into(),
        });
    }
    let segmenters = OrganSegmenters::open(recording, settings)?;
    let mut notes = recording.notes().to_vec();
    let background = composite(recording, settings, &mut notes, progress)?;
    let organs = &recording.info.organs;
    let masks = organs.iter().map(|o| segmenters.mask(o, &background.color)).collect::<Result<Vec<_>>>()?;
    if background.frames_used < settings.min_samples {
        let frames = if background.frames_used == 1 { "frame" } else { "frames" };
        notes.push(format!("The window holds only {} {frames}.", background.frames_used));
    }

    let view = View {
        background: &background,
        camera: recording.camera(),
        depth_scale: recording.depth_scale(),
        back: settings.back,
        surface: settings.surface,
    };
    let (mut organs, mut views) = (Vec::new(), Vec::new());
    progress.begin("organs", masks.len() as u64);
    for (info, mask) in recording.info.organs.iter().zip(masks) {
        let made = if progress.interrupted() {
            Err(Error::Interrupted)
        } else {
            close(info, mask, &view, &mut notes).and_then(|closed| with_body(info, closed, &background, settings))
        };
        match made {
            Ok((organ, view)) => {
                organs.push(organ);
                views.push(view);
            }
            Err(e) => {
                progress.end();
                return Err(e);
            }
        }
        progress.advance(1);
    }
    progress.end();

    let specimen = Specimen {
        name: recording.info.name.clone(),
        up: recording.info.up.into(),
        placement: Pose::IDENTITY,
        camera: Some(view.camera),
        organs,
        background: Some(background.color.clone()),
        provenance: Provenance {
            source: recording.info.name.clone(),
            input_hash: format!("{:016x}", input_hash(recording, &background, &views)?),
            program: program(),
            settings: settings.list(),
        },
    };
    Ok(Reconstruction {
        specimen,
        composite: background,
        warnings: motion_warning(&views, settings.window).into_iter().collect(),
        organs: views,
        notes,
    })
}

/// The organ and its view, from its closed surface.
fn with_body(
    info: &OrganInfo,
    closed: Closed,
    background: &Composite,
    settings: &Settings,
) -> Result<(Organ, OrganView)> {
    let Closed { surface, mask, base, check } = closed;
    let moving_share = moving_share(&mask, background);
    let (body, mut facts) = fill_with_tets(&info.name, &surface, settings)?;
    facts.depth_error_median_mm = Some(1e3 * check.median_absolute);
    facts.depth_error_signed_mm = Some(1e3 * check.median_signed);
    facts.covered = Some(check.covered);
    let name = info.name.clone();
    let view = OrganView { name: name.clone(), mask, depth_error: check.error, compared: check.compared, moving_share };
    Ok((
        Organ {
            name,
            body,
            surface,
            material: info.material,
            pins: info.pins,
            threads: None,
            posterior: None,
            base,
            facts,
        },
        view,
    ))
}

/// Share of the pixels of `mask` with depth that move.
fn moving_share(mask: &Mask, background: &Composite) -> f64 {
    let measured = |i: &usize| mask.set[*i] && background.depth.depth[*i] > 0.0;
    let measured: Vec<usize> = (0..mask.set.len()).filter(measured).collect();
    let moving = measured.iter().filter(|i| background.moving.set[**i]).count();
    moving as f64 / measured.len().max(1) as f64
}

/// A warning about the organs that move, with the remedy.
fn motion_warning(views: &[OrganView], window: usize) -> Option<String> {
    let moving: Vec<String> = views
        .iter()
        .filter(|v| v.moving_share > WARN_SHARE)
        .map(|v| format!("{} ({:.0}% of its pixels)", v.name, 100.0 * v.moving_share))
        .collect();
    (!moving.is_empty()).then(|| {
        format!(
            "Tissue moves during the window: {}. A composite blurs what moves, and the shapes below are wrong there. \
             Choose frames in which it is still: --centre FRAME and a --window below {window}.",
            moving.join(", ")
        )
    })
}

/// Hash of everything that the result depends on: the recording's facts, the used frames, the
/// masks.
fn input_hash(recording: &Recording, background: &Composite, views: &[OrganView]) -> Result<u64> {
    let mut hash = Xxh3::new();
    let said = toml::to_string(&recording.info).map_err(|e| Error::Setting(format!("the recording's facts: {e}")))?;
    hash.update(said.as_bytes());
    // The cameras that a log describes are not part of the recording's facts.
    let cameras = (recording.camera(), recording.depth_scale(), recording.registration());
    hash.update(format!("{cameras:?}").as_bytes());
    hash.update(&background.hash.to_le_bytes());
    for view in views {
        hash.update(&view.mask.set.iter().map(|s| u8::from(*s)).collect::<Vec<u8>>());
    }
    Ok(hash.digest())
}
