//! The stages in their order.

use crate::body::fill_with_tets;
use crate::composite::{Composite, CompositeTimes, composite};
use crate::masks::OrganSegmenters;
use crate::organ::{Closed, View, close};
use crate::{Error, Result, Settings};
use trocar_camera::{ColorImage, DepthImage, Mask};
use trocar_core::{Pose, Progress};
use trocar_recording::{OrganInfo, Recording};
use trocar_specimen::{Organ, Provenance, Specimen};
use xxhash_rust::xxh3::Xxh3;

/// What the camera saw of one organ, for the report.
#[derive(Clone, Debug)]
pub struct OrganView {
    /// Its name.
    pub name: String,
    /// Its mask in the composite.
    pub mask: Mask,
    /// Surface depth minus measured depth on the compared pixels [m]; 0 elsewhere.
    pub depth_error: Vec<f32>,
    /// Which pixels were compared.
    pub compared: Mask,
}

/// A specimen and what was seen on the way to it.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// The result.
    pub specimen: Specimen,
    /// The window's centre frame, as recorded.
    pub input: ColorImage,
    /// Instruments in that frame.
    pub instruments: Mask,
    /// The composite's colour.
    pub background: ColorImage,
    /// The composite's depth.
    pub depth: DepthImage,
    /// Frames the composite used.
    pub frames_used: usize,
    /// Share of the image that only the composite could fill under the instrument masks of the centre frame.
    pub recovered_share: f64,
    /// Share of pixels with composite depth.
    pub coverage: f64,
    /// Median over pixels of the range between the 10th and 90th percentile of depth [m].
    pub depth_range_median: f64,
    /// Where the composite's time went.
    pub times: CompositeTimes,
    /// Per organ, in the specimen's order.
    pub organs: Vec<OrganView>,
    /// Things the user should know (dropped frames, filled holes, clipped organs), a sentence each.
    pub notes: Vec<String>,
}

/// Name and version for the provenance.
pub(crate) fn program() -> String {
    format!("trocar {}", env!("CARGO_PKG_VERSION"))
}

/// Reconstructs every organ of a recording.
///
/// # Errors
/// A setting out of range, a broken recording, an organ that cannot be closed or filled, or an interruption.
pub fn reconstruct(recording: &Recording, settings: &Settings, progress: &dyn Progress) -> Result<Reconstruction> {
    settings.validate()?;
    if recording.info.organs.is_empty() {
        return Err(Error::Input {
            path: recording.toml().to_owned(),
            reason: "no [[organ]]; name at least one, with a mask in masks/, a polygon or points (`trocar inspect` writes a template)".into(),
        });
    }
    let segmenters = OrganSegmenters::open(recording, settings)?;
    let mut notes = recording.notes().to_vec();
    let background = composite(recording, settings, &mut notes, progress)?;
    let organs = &recording.info.organs;
    let masks = organs.iter().map(|o| segmenters.mask(o, &background.color)).collect::<Result<Vec<_>>>()?;
    if background.frames_used < settings.min_samples {
        notes.push(format!("The window holds only {} frames.", background.frames_used));
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
            close(info, mask, &view, &mut notes).and_then(|closed| with_body(info, closed, settings))
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
        input: background.input,
        instruments: background.instruments,
        background: background.color,
        depth: background.depth,
        frames_used: background.frames_used,
        recovered_share: background.recovered_share,
        coverage: background.coverage,
        depth_range_median: background.depth_range_median,
        times: background.times,
        organs: views,
        notes,
    })
}

/// The organ and what was seen of it, from its closed surface.
fn with_body(info: &OrganInfo, closed: Closed, settings: &Settings) -> Result<(Organ, OrganView)> {
    let Closed { surface, mask, base, check } = closed;
    let (body, mut facts) = fill_with_tets(&info.name, &surface, settings)?;
    facts.depth_error_median_mm = Some(1e3 * check.median_absolute);
    facts.depth_error_signed_mm = Some(1e3 * check.median_signed);
    facts.covered = Some(check.covered);
    let name = info.name.clone();
    let view = OrganView { name: name.clone(), mask, depth_error: check.error, compared: check.compared };
    Ok((Organ { name, body, surface, material: info.material, pins: info.pins, base, facts }, view))
}

/// Hash of everything the result depends on: what is known of the recording, the used frames, the masks.
fn input_hash(recording: &Recording, background: &Composite, views: &[OrganView]) -> Result<u64> {
    let mut hash = Xxh3::new();
    let said = toml::to_string(&recording.info).map_err(|e| Error::Setting(format!("the recording's facts: {e}")))?;
    hash.update(said.as_bytes());
    // What a log says of its cameras is not in there.
    let cameras = (recording.camera(), recording.depth_scale(), recording.registration());
    hash.update(format!("{cameras:?}").as_bytes());
    hash.update(&background.hash.to_le_bytes());
    for view in views {
        hash.update(&view.mask.set.iter().map(|s| u8::from(*s)).collect::<Vec<u8>>());
    }
    Ok(hash.digest())
}
