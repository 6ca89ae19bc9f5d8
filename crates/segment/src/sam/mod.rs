//! SAM 2.1 through ONNX Runtime: an organ from a few clicks.
//!
//! Two networks in one folder: an image encoder and a prompt decoder, as public exporters write
//! them (see [`wanted_files`]). Trocar has no weights of its own. The runtime is a shared library
//! that is opened when it is first needed; the rest of Trocar works without it.

mod files;
mod network;
mod prompt;
mod resample;
mod runtime;
mod tracker;

pub use files::{WantedFile, wanted_files};
pub use tracker::Tracker;

use crate::{Error, Picture, Result, Segmenter, Target};
use network::{Kind, Network, Tensor};
use prompt::{Logits, Prompt};
use resample::{bilinear, encoder_input};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use trocar_camera::{ColorImage, Mask};

/// Limit of SAM's mask logits; SAM's own predictor clamps them to it before it feeds them back.
const LOGIT_LIMIT: f32 = 32.0;
/// Input side of SAM 2.1's encoder where the file does not fix it (px).
const DEFAULT_SIDE: usize = 1024;
/// Largest side of an encoder's input (px).
const MAX_SIDE: usize = 4096;

/// SAM 2.1 from two ONNX files. Prompts are points on and off the target and a box, or else the
/// outline, as a box and its innermost point. SAM returns several masks, and the one with the best
/// predicted IoU is used.
#[derive(Debug)]
pub struct Sam2 {
    folder: PathBuf,
    encoder: Network,
    decoder: Network,
    /// Encoder input: width and height (px).
    input: [usize; 2],
    /// The role of each decoder input.
    parts: Vec<(String, Part)>,
    /// The picture that was encoded last, so that several targets in one picture cost one encoding.
    last: Mutex<Option<(ColorImage, std::sync::Arc<Features>)>>,
}

/// The role of a decoder input or encoder output. SAM's names are not standard; those of public
/// exporters are recognised.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Part {
    Embedding,
    Fine,
    Middle,
    Coordinates,
    Labels,
    Mask,
    HasMask,
    Size,
}

/// An encoded picture.
#[derive(Debug)]
struct Features {
    embedding: Tensor,
    fine: Option<Tensor>,
    middle: Option<Tensor>,
}

impl Part {
    fn of(name: &str) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_str() {
            "image_embed" | "image_embedding" | "image_embeddings" => Self::Embedding,
            "high_res_feats_0" | "image_features_0" => Self::Fine,
            "high_res_feats_1" | "image_features_1" => Self::Middle,
            "point_coords" => Self::Coordinates,
            "point_labels" => Self::Labels,
            "mask_input" | "input_masks" => Self::Mask,
            "has_mask_input" | "has_input_masks" => Self::HasMask,
            "orig_im_size" | "original_image_size" => Self::Size,
            _ => return None,
        })
    }
}

impl Sam2 {
    /// Opens the two networks in `folder`. ONNX Runtime's library is looked for in
    /// `ORT_DYLIB_PATH`, then at `runtime`: the library itself, or a folder with a Python
    /// `onnxruntime` (a virtual environment, `site-packages`, the package). The first opened
    /// library stays for the whole process.
    ///
    /// # Errors
    /// Names the file that is missing, is not a network, or has other inputs and outputs than SAM
    /// 2.1; without a library the error says how to get it.
    pub fn open(folder: &Path, runtime: Option<&Path>) -> Result<Self> {
        let (encoder, decoder) = (files::encoder(folder)?, files::decoder(folder)?);
        let environment = runtime::load(runtime)?;
        let encoder = Network::open(&environment, &encoder)?;
        let decoder = Network::open(&environment, &decoder)?;
        let input = encoder_size(&encoder)?;
        let mut parts = Vec::new();
        for port in &decoder.inputs {
            let Some(part) = Part::of(&port.name) else {
                let text = format!(
                    "input '{}' is unknown; a SAM 2.1 decoder takes image_embed, high_res_feats_0, high_res_feats_1, \
                     point_coords, point_labels, mask_input, has_mask_input",
                    port.name
                );
                return Err(Error::file(&decoder.path, text));
            };
            let rank = match part {
                Part::Embedding | Part::Fine | Part::Middle | Part::Mask => 4,
                Part::Coordinates => 3,
                Part::Labels => 2,
                Part::HasMask | Part::Size => 1,
            };
            if port.shape.len() != rank {
                let text = format!("input '{}' has shape {:?}; it must have {rank} dimensions", port.name, port.shape);
                return Err(Error::file(&decoder.path, text));
            }
            parts.push((port.name.clone(), part));
        }
        for (part, name) in
            [(Part::Embedding, "image_embed"), (Part::Coordinates, "point_coords"), (Part::Labels, "point_labels")]
        {
            if !parts.iter().any(|(_, p)| *p == part) {
                return Err(Error::file(
                    &decoder.path,
                    format!("it has no input '{name}'; is this a SAM 2.1 prompt decoder?"),
                ));
            }
        }
        let sam = Self { folder: folder.to_owned(), encoder, decoder, input, parts, last: Mutex::new(None) };
        sam.check_pair()?;
        Ok(sam)
    }

    /// Refuses an encoder and a decoder of different SAM sizes, which would fail later with an
    /// unclear message.
    fn check_pair(&self) -> Result<()> {
        for given in &self.encoder.outputs {
            let Some(part) = Part::of(&given.name) else { continue };
            let Some((name, _)) = self.parts.iter().find(|(_, p)| *p == part) else { continue };
            let Some(wanted) = self.decoder.inputs.iter().find(|p| p.name == *name) else { continue };
            let fits = given.shape.len() == wanted.shape.len()
                && given.shape.iter().zip(&wanted.shape).all(|(g, w)| *g < 0 || *w < 0 || g == w);
            if !fits {
                let text = format!(
                    "takes {name} of shape {:?}, but {} gives {:?}; export both from one model",
                    wanted.shape,
                    self.encoder.path.display(),
                    given.shape
                );
                return Err(Error::file(&self.decoder.path, text));
            }
        }
        Ok(())
    }

    /// The picture's features, computed or cached.
    fn features(&self, color: &ColorImage) -> Result<std::sync::Arc<Features>> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((known, features)) = &*last
            && known == color
        {
            return Ok(features.clone());
        }
        let [width, height] = self.input;
        let image = Tensor { shape: vec![1, 3, height, width], data: encoder_input(color, width, height)? };
        let names: Vec<&str> = self.encoder.outputs.iter().map(|o| o.name.as_str()).collect();
        let mut outputs = self.encoder.run(&[(&self.encoder.inputs[0].name, &image)], &names)?;
        outputs.retain(|(_, t)| t.shape.len() == 4);
        let mut take = |part| {
            let at = outputs.iter().position(|(name, _)| Part::of(name) == Some(part))?;
            Some(outputs.remove(at).1)
        };
        let (mut embedding, mut fine, mut middle) = (take(Part::Embedding), take(Part::Fine), take(Part::Middle));
        if embedding.is_none() && fine.is_none() && middle.is_none() {
            // Unknown names: the three levels differ in size, in whatever order they come.
            outputs.sort_by_key(|(_, t)| std::cmp::Reverse(t.shape[2] * t.shape[3]));
            let mut levels = outputs.into_iter().map(|(_, t)| t);
            (fine, middle, embedding) = (levels.next(), levels.next(), levels.next());
        }
        let embedding = embedding.ok_or_else(|| {
            let text =
                format!("its outputs are {names:?}; they must be image_embed, high_res_feats_0 and high_res_feats_1");
            Error::file(&self.encoder.path, text)
        })?;
        let features = std::sync::Arc::new(Features { embedding, fine, middle });
        *last = Some((color.clone(), features.clone()));
        Ok(features)
    }

    /// The best mask for a prompt, as logits at the decoder's resolution.
    fn decode(&self, color: &ColorImage, prompt: &Prompt) -> Result<Logits> {
        let features = self.features(color)?;
        let [width, height] = self.input;
        let n = prompt.points.len();
        // A pixel's centre maps to a centre; SAM's prompt encoder adds the half pixel itself.
        let scaled = |x: f64, from: usize, to: usize| ((x + 0.5) * to as f64 / from as f64 - 0.5) as f32;
        let place = |[x, y]: [f64; 2]| [scaled(x, color.width, width), scaled(y, color.height, height)];
        let coordinates =
            Tensor { shape: vec![1, n, 2], data: prompt.points.iter().flat_map(|(p, _)| place(*p)).collect() };
        let labels = Tensor { shape: vec![1, n], data: prompt.points.iter().map(|(_, l)| *l).collect() };
        let [mask_width, mask_height] = self.mask_size();
        let mask = match &prompt.mask {
            Some(m) => bilinear(&m.values, [m.width, m.height], [mask_width, mask_height]),
            None => vec![0.0; mask_width * mask_height],
        };
        let mask = mask.into_iter().map(|l| l.clamp(-LOGIT_LIMIT, LOGIT_LIMIT)).collect();
        let mask = Tensor { shape: vec![1, 1, mask_height, mask_width], data: mask };
        let has_mask = Tensor { shape: vec![1], data: vec![f32::from(u8::from(prompt.mask.is_some()))] };
        let size = Tensor { shape: vec![2], data: vec![color.height as f32, color.width as f32] };

        let mut feeds = Vec::new();
        for (name, part) in &self.parts {
            let tensor = match part {
                Part::Embedding => Some(&features.embedding),
                Part::Fine => features.fine.as_ref(),
                Part::Middle => features.middle.as_ref(),
                Part::Coordinates => Some(&coordinates),
                Part::Labels => Some(&labels),
                Part::Mask => Some(&mask),
                Part::HasMask => Some(&has_mask),
                Part::Size => Some(&size),
            };
            let tensor = tensor.ok_or_else(|| {
                Error::file(
                    &self.encoder.path,
                    format!("it has no output for the decoder's input '{name}'; export both networks together"),
                )
            })?;
            feeds.push((name.as_str(), tensor));
        }
        self.best_mask(&feeds)
    }

    fn best_mask(&self, feeds: &[(&str, &Tensor)]) -> Result<Logits> {
        let bad = |text: String| Error::file(&self.decoder.path, text);
        let outputs = &self.decoder.outputs;
        // Masks of low resolution are always logits.
        let masks = outputs
            .iter()
            .find(|o| o.name.contains("low_res"))
            .or_else(|| outputs.iter().find(|o| o.name.contains("mask")))
            .ok_or_else(|| bad("it has no output 'masks'; is this a SAM 2.1 prompt decoder?".into()))?;
        let scores = outputs.iter().find(|o| o.name.contains("iou") || o.name.contains("score"));
        let names: Vec<&str> = [Some(masks), scores].into_iter().flatten().map(|o| o.name.as_str()).collect();
        let found = self.decoder.run(feeds, &names)?;
        let [(name, masks), scores @ ..] = found.as_slice() else { return Err(bad("it has no output".into())) };
        let &[batch, count, height, width] = masks.shape.as_slice() else {
            return Err(bad(format!("'{name}' has shape {:?}; it must be [1, masks, height, width]", masks.shape)));
        };
        if batch != 1 || count == 0 || width == 0 || height == 0 {
            return Err(bad(format!(
                "'{name}' has shape {:?}; it must be one batch with at least one mask",
                masks.shape
            )));
        }
        let mut best = 0;
        if count > 1 {
            let Some((_, scores)) = scores.first().filter(|(_, s)| s.data.len() == count) else {
                return Err(bad(format!(
                    "it returns {count} masks without 'iou_predictions' for each; every mask needs a score"
                )));
            };
            for (i, score) in scores.data.iter().enumerate() {
                if *score > scores.data[best] || scores.data[best].is_nan() {
                    best = i;
                }
            }
        }
        let values = masks.data[best * width * height..(best + 1) * width * height].to_vec();
        Ok(Logits { width, height, values })
    }

    /// Size of the mask prompt: the decoder's, or a quarter of the encoder's input.
    fn mask_size(&self) -> [usize; 2] {
        let [width, height] = self.input;
        let port = self.decoder.inputs.iter().find(|p| Part::of(&p.name) == Some(Part::Mask));
        let side = |axis: usize, open: usize| match port.and_then(|p| p.shape.get(axis)) {
            Some(s) if (1..=MAX_SIDE as i64).contains(s) => *s as usize,
            _ => open,
        };
        [side(3, width / 4), side(2, height / 4)]
    }

    fn takes_masks(&self) -> bool {
        self.parts.iter().any(|(_, p)| *p == Part::Mask)
    }
}

impl Segmenter for Sam2 {
    fn segment(&self, picture: &Picture<'_>, target: &Target) -> Result<Mask> {
        let logits = self.decode(picture.color, &Prompt::new(picture, target)?)?;
        Ok(logits.mask(picture.color.width, picture.color.height))
    }

    fn describe(&self) -> String {
        format!("SAM 2.1 as ONNX, {} x {} input, from {}", self.input[0], self.input[1], self.folder.display())
    }
}

/// Width and height of the encoder's one input, [1, 3, height, width] as `f32`.
fn encoder_size(encoder: &Network) -> Result<[usize; 2]> {
    let fits = |shape: &[i64]| matches!(shape, [b, c, _, _] if (*b == 1 || *b < 0) && (*c == 3 || *c < 0));
    let [port] = encoder.inputs.as_slice() else {
        return Err(Error::file(
            &encoder.path,
            format!("it has {} inputs; an image encoder has one", encoder.inputs.len()),
        ));
    };
    if !fits(&port.shape) || port.kind != Kind::F32 {
        let text =
            format!("input '{}' is {:?} {:?}; it must be F32 [1, 3, height, width]", port.name, port.kind, port.shape);
        return Err(Error::file(&encoder.path, text));
    }
    let mut size = [0; 2];
    for (side, axis) in size.iter_mut().zip([3, 2]) {
        *side = match port.shape[axis] {
            open if open < 0 => DEFAULT_SIDE,
            s if (16..=MAX_SIDE as i64).contains(&s) => s as usize,
            s => {
                return Err(Error::file(
                    &encoder.path,
                    format!("the input's side is {s} pixels; it must be in [16, {MAX_SIDE}]"),
                ));
            }
        };
    }
    Ok(size)
}
