//! Reads and writes the folder of a specimen.

use crate::document::Document;
use crate::error::{Error, Result};
use crate::specimen::Specimen;
use crate::staged::StagedFolder;
use crate::strict_toml::read_toml;
use std::path::Path;
use trocar_camera::ColorImage;
use trocar_geometry::io::{Unit, read_msh, read_surface, write_msh, write_ply};
use trocar_geometry::{TetMesh, TriMesh};

/// The file whose presence makes a folder a specimen.
const MARKER: &str = "specimen.toml";

impl Specimen {
    /// Stages the specimen folder `dir`, so that an unwritable place is found before long work; see
    /// [`StagedFolder::create`].
    ///
    /// # Errors
    /// When `dir` exists and is not a specimen folder, or cannot be written.
    pub fn stage(dir: &Path) -> Result<StagedFolder> {
        StagedFolder::create(dir, MARKER)
    }

    /// Writes the folder `dir`, which must not exist or be an earlier specimen folder (with a
    /// `specimen.toml`), which is replaced. The files are written beside it first and moved into
    /// place, so a failure leaves nothing half-written.
    ///
    /// # Errors
    /// When `dir` is another kind of folder, a file cannot be written, or the reader would refuse
    /// the specimen.
    pub fn write(&self, dir: &Path) -> Result<()> {
        let folder = Self::stage(dir)?;
        self.write_into(folder.path())?;
        folder.commit()
    }

    /// Writes the specimen's files into an existing folder.
    ///
    /// # Errors
    /// When a file cannot be written, or the reader would refuse the specimen.
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
    /// As [`read`](Self::read), apart from the meshes.
    pub fn organ_names(dir: &Path) -> Result<Vec<String>> {
        Ok(read_document(dir)?.organs.into_iter().map(|organ| organ.name).collect())
    }

    /// Reads and checks a specimen folder and its meshes. The error for an unknown key names a
    /// similar known one.
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

/// Reads and checks `specimen.toml` in `dir`.
fn read_document(dir: &Path) -> Result<Document> {
    let path = dir.join(MARKER);
    if !path.is_file() {
        let reason = "the file does not exist; a specimen is a folder with a specimen.toml".into();
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
        return Err("it has no tetrahedra".into());
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
        Err(format!("the surface encloses {volume} m3; it must be closed and face outward"))
    }
}
