//! The specimen and its folder.

use crate::document::Document;
use crate::{Error, Organ, Result, StagedFolder, read_toml};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::Path;
use trocar_camera::{Camera, ColorImage};
use trocar_core::Pose;
use trocar_geometry::io::{Unit, read_msh, read_surface, write_msh, write_ply};
use trocar_geometry::{TetMesh, TriMesh};

/// Where a specimen comes from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Name of the recording or surface file (no directories).
    pub source: String,
    /// Hash of the input, hexadecimal.
    pub input_hash: String,
    /// Version of the program.
    pub program: String,
    /// The settings used, `name = value` in a fixed order.
    #[serde(default)]
    pub settings: Vec<String>,
}

/// Organs in their recorded arrangement.
#[derive(Clone, Debug)]
pub struct Specimen {
    /// Name.
    pub name: String,
    /// Unit vector against gravity in the recording frame.
    pub up: DVec3,
    /// From the recording frame to the cell frame; identity until a scene places it.
    pub placement: Pose,
    /// The recording camera; `None` for a specimen from a ready surface.
    pub camera: Option<Camera>,
    /// The organs.
    pub organs: Vec<Organ>,
    /// The composite the surfaces were coloured from.
    pub background: Option<ColorImage>,
    /// Origin.
    pub provenance: Provenance,
}

/// The file that makes a folder a specimen.
const MARKER: &str = "specimen.toml";

impl Specimen {
    /// Stages the specimen folder `dir`, so that an unwritable place is found before long work; see [`StagedFolder::create`].
    ///
    /// # Errors
    /// When `dir` exists and is no specimen folder, or cannot be written.
    pub fn stage(dir: &Path) -> Result<StagedFolder> {
        StagedFolder::create(dir, MARKER)
    }

    /// Writes the folder `dir`, which must not exist or be an earlier specimen folder (one with a `specimen.toml`), which is
    /// then replaced. Written beside it first and moved into place, so that a failure leaves nothing half-written.
    ///
    /// # Errors
    /// When `dir` is another kind of folder, a file cannot be written, or the specimen would not be read again.
    pub fn write(&self, dir: &Path) -> Result<()> {
        let folder = Self::stage(dir)?;
        self.write_into(folder.path())?;
        folder.commit()
    }

    /// Writes the specimen's files into a folder that is there.
    ///
    /// # Errors
    /// When a file cannot be written, or the specimen would not be read again.
    pub fn write_into(&self, folder: &Path) -> Result<()> {
        let file = |name: &str| folder.join(name);
        let invalid = |reason: String| Error::Invalid { path: file(MARKER), reason };
        let mut document = Document::of(self);
        document.validate().map_err(invalid)?;
        let text = toml::to_string(&document).map_err(|e| invalid(format!("cannot be written: {e}")))?;
        for organ in &self.organs {
            write_msh(&file(&format!("{}.msh", organ.name)), &organ.body)?;
            write_ply(&file(&format!("{}.ply", organ.name)), &organ.surface)?;
        }
        if let Some(background) = &self.background {
            background.write_png(&file(BACKGROUND))?;
        }
        let path = file(MARKER);
        std::fs::write(&path, text).map_err(|source| Error::Io { path, source })
    }

    /// The names of a specimen folder's organs, without their meshes.
    ///
    /// # Errors
    /// As [`read`](Self::read), for the meshes aside.
    pub fn organ_names(dir: &Path) -> Result<Vec<String>> {
        Ok(read_document(dir)?.organs.into_iter().map(|organ| organ.name).collect())
    }

    /// Reads and checks a specimen folder. Unknown keys are errors that name the nearest right key; meshes are checked.
    ///
    /// # Errors
    /// Names the file and field that is missing or wrong.
    pub fn read(dir: &Path) -> Result<Self> {
        let invalid = |path: &Path, reason: String| Error::Invalid { path: path.to_owned(), reason };
        let document = read_document(dir)?;
        let mut organs = Vec::with_capacity(document.organs.len());
        for entry in &document.organs {
            let body_file = dir.join(format!("{}.msh", entry.name));
            let body = read_msh(&body_file)?;
            check_body(&body).map_err(|r| invalid(&body_file, r))?;
            let surface_file = dir.join(format!("{}.ply", entry.name));
            let surface = read_surface(&surface_file, Unit::Metre)?;
            check_surface(&surface).map_err(|r| invalid(&surface_file, r))?;
            organs.push(entry.organ(body, surface));
        }
        let mut specimen = document.into_specimen(organs);
        let background = dir.join(BACKGROUND);
        if background.is_file() {
            specimen.background = Some(ColorImage::read(&background)?);
        }
        Ok(specimen)
    }
}

/// `specimen.toml` in `dir`, checked.
fn read_document(dir: &Path) -> Result<Document> {
    let path = dir.join(MARKER);
    if !path.is_file() {
        let reason = "no such file; a specimen is a folder with a specimen.toml".into();
        return Err(Error::Invalid { path, reason });
    }
    let mut document: Document = read_toml(&path)?;
    match document.validate() {
        Ok(()) => Ok(document),
        Err(reason) => Err(Error::Invalid { path, reason }),
    }
}

/// Name of the composite's file.
const BACKGROUND: &str = "background.png";

fn check_body(body: &TetMesh) -> std::result::Result<(), String> {
    if body.tets.is_empty() {
        return Err("no tetrahedra".into());
    }
    if let Some(i) = body.vertices.iter().position(|v| !v.is_finite()) {
        return Err(format!("node {i} is not finite"));
    }
    match body.inverted() {
        0 => Ok(()),
        n => Err(format!("{n} tetrahedra have no positive volume")),
    }
}

fn check_surface(surface: &TriMesh) -> std::result::Result<(), String> {
    let volume = surface.volume();
    if volume > 0.0 {
        Ok(())
    } else {
        Err(format!("the surface encloses {volume} m3; a closed surface, facing outward"))
    }
}
