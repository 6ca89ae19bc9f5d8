//! The files that SAM 2.1 needs: how they are recognised, and their sources.

use super::runtime::{self, names};
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// A file that the user provides.
#[derive(Clone, Debug)]
pub struct WantedFile {
    /// Its name, or how it is recognised.
    pub name: &'static str,
    /// Its purpose.
    pub purpose: &'static str,
    /// Where it was found, if it was.
    pub found: Option<PathBuf>,
    /// How to get it, in one line.
    pub how_to_get: &'static str,
}

const EXPORTS: &str = "ready exports: huggingface.co/vietanhdev/segment-anything-2.1-onnx-models (a .zip a size; unpack it); \
     or export Meta's checkpoints (github.com/facebookresearch/sam2) with `samexporter` from PyPI (python -m \
     samexporter.export_sam2) or with onnxruntime's transformers/models/sam2/convert_to_onnx.py; Meta publishes the SAM 2.1 \
     checkpoints and code under Apache-2.0";

/// The files for [`crate::Sam2`], and which of them are present. `folder` is the networks' folder;
/// the library is looked for in `ORT_DYLIB_PATH`.
pub fn wanted_files(folder: Option<&Path>) -> Vec<WantedFile> {
    let variable = std::env::var_os("ORT_DYLIB_PATH").map(PathBuf::from);
    vec![
        WantedFile {
            name: "image_encoder.onnx (or one *encoder*.onnx)",
            purpose: "encodes a picture as features; about 100 MB for the tiny model",
            found: folder.and_then(|f| encoder(f).ok()),
            how_to_get: EXPORTS,
        },
        WantedFile {
            name: "mask_decoder.onnx (or one *decoder*.onnx)",
            purpose: "decodes features and clicks to a mask; about 17 MB; from the same export as the encoder",
            found: folder.and_then(|f| decoder(f).ok()),
            how_to_get: EXPORTS,
        },
        WantedFile {
            name: "ONNX Runtime's library, 1.17 or later",
            purpose: "runs the networks",
            found: runtime::find(variable.as_deref(), None).ok(),
            how_to_get: runtime::HOW_TO_GET,
        },
    ]
}

/// The image encoder. Exporters also write prompt and memory encoders, which are other networks.
pub(super) fn encoder(folder: &Path) -> Result<PathBuf> {
    pick(
        folder,
        "image_encoder.onnx",
        "encoder",
        &["prompt_encoder", "memory_encoder", "text_encoder"],
        "image_encoder",
    )
}

/// The prompt decoder: the whole way from prompts to masks. ONNX Runtime's exporter calls it the
/// image decoder and writes a bare mask decoder beside it.
pub(super) fn decoder(folder: &Path) -> Result<PathBuf> {
    pick(folder, "mask_decoder.onnx", "decoder", &[], "image_decoder")
}

fn pick(folder: &Path, exact: &str, word: &str, not: &[&str], preferred: &str) -> Result<PathBuf> {
    if !folder.is_dir() {
        return Err(Error::file(
            folder,
            "the folder does not exist; it must hold image_encoder.onnx and mask_decoder.onnx",
        ));
    }
    let fits = |name: &String| {
        let name = name.to_ascii_lowercase();
        name.ends_with(".onnx") && name.contains(word) && !not.iter().any(|n| name.contains(n))
    };
    let mut found: Vec<String> = names(folder).into_iter().filter(fits).collect();
    if found.iter().any(|n| n == exact) {
        return Ok(folder.join(exact));
    }
    let best: Vec<&String> = found.iter().filter(|n| n.to_ascii_lowercase().contains(preferred)).collect();
    if let [only] = best.as_slice() {
        return Ok(folder.join(only));
    }
    match found.len() {
        0 => Err(Error::file(folder, format!("it holds neither {exact} nor another *{word}*.onnx"))),
        1 => Ok(folder.join(found.remove(0))),
        _ => Err(Error::file(
            folder,
            format!("several files may be the {word}: {}; name one of them {exact}", found.join(", ")),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_public_exports_are_recognised() {
        let cases: [(&[&str], &str, &str); 4] = [
            (
                &["image_encoder.onnx", "mask_decoder.onnx", "memory_encoder.onnx"],
                "image_encoder.onnx",
                "mask_decoder.onnx",
            ),
            (
                &["sam2.1_hiera_tiny.encoder.onnx", "sam2.1_hiera_tiny.decoder.onnx", "notes.txt"],
                "sam2.1_hiera_tiny.encoder.onnx",
                "sam2.1_hiera_tiny.decoder.onnx",
            ),
            (
                &["s_image_encoder.onnx", "s_prompt_encoder.onnx", "s_mask_decoder.onnx", "s_image_decoder.onnx"],
                "s_image_encoder.onnx",
                "s_image_decoder.onnx",
            ),
            (&["encoder.onnx", "decoder.onnx"], "encoder.onnx", "decoder.onnx"),
        ];
        for (files, first, second) in cases {
            let dir = tempfile::tempdir().unwrap();
            files.iter().for_each(|f| std::fs::write(dir.path().join(f), "").unwrap());
            assert_eq!(encoder(dir.path()).unwrap(), dir.path().join(first));
            assert_eq!(decoder(dir.path()).unwrap(), dir.path().join(second));
            let wanted = wanted_files(Some(dir.path()));
            assert_eq!(wanted[1].found, Some(dir.path().join(second)));
        }
        assert!(wanted_files(None).iter().take(2).all(|w| w.found.is_none() && w.how_to_get.contains("Apache-2.0")));
    }

    #[test]
    fn missing_and_ambiguous_files_are_named() {
        let dir = tempfile::tempdir().unwrap();
        assert!(encoder(dir.path()).unwrap_err().to_string().contains("image_encoder.onnx"));
        for name in ["a.decoder.onnx", "b.decoder.onnx"] {
            std::fs::write(dir.path().join(name), "").unwrap();
        }
        let message = decoder(dir.path()).unwrap_err().to_string();
        assert!(message.contains("a.decoder.onnx, b.decoder.onnx"), "{message}");
        assert!(decoder(&dir.path().join("none")).unwrap_err().to_string().contains("does not exist"));
    }
}
