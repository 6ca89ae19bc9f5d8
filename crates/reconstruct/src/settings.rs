//! Settings of the reconstruction; one set serves every recording.

use crate::{Error, Result};
use std::path::PathBuf;

/// Settings of a reconstruction.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Frames on each side of the window's centre (paper: 90).
    pub window: usize,
    /// Step between the used frames of the window (paper: 2).
    pub stride: usize,
    /// Frame at the window's centre; the middle of the recording by default.
    pub centre: Option<usize>,
    /// Least samples of a pixel (paper: 3); a recording of fewer frames needs as many as it has.
    pub min_samples: usize,
    /// Folder with the networks of SAM 2.1, for organs that have only points.
    pub sam: Option<PathBuf>,
    /// ONNX Runtime's library, or a folder with a Python `onnxruntime`; `ORT_DYLIB_PATH` by
    /// default.
    pub onnxruntime: Option<PathBuf>,
    /// The rule for the thickness of an organ behind its front.
    pub back: BackRule,
    /// The rule for the surface from front and back.
    pub surface: SurfaceRule,
    /// The mesher that fills it with tetrahedra.
    pub mesher: MesherRule,
    /// Edge of the elements at the surface (m), and of the triangles that TetGen gets. By default
    /// `finest_cell`, or larger in order to have no more than `max_tets` elements.
    pub element_size: Option<f64>,
    /// Edge of the finest lattice cell where `element_size` is not set (m).
    pub finest_cell: f64,
    /// Approximate largest number of tetrahedra of a body where `element_size` is not set.
    pub max_tets: usize,
}

/// The rule for the thickness of an organ behind its front; no camera saw its back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BackRule {
    /// A round profile of the silhouette's width (paper eq. 1). Flat organs become too thick.
    #[default]
    Rounded,
    /// As high against its width as the front rises above its rim, and the same below; 0.2 to 1.5
    /// times as high as wide. Right for organs that are symmetric above and below their widest
    /// outline. Half is missed of an organ that is sunk in or covered to half its height.
    Fitted,
}

/// The rule for the surface from front and back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SurfaceRule {
    /// From a signed distance: no outward bias.
    #[default]
    SignedDistance,
    /// From a binary occupancy grid, as the paper does.
    BinaryGrid,
}

/// The mesher that fills a surface with tetrahedra.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MesherRule {
    /// Isosurface stuffing: no slivers.
    #[default]
    Lattice,
    /// The TetGen program at the paper's settings.
    Tetgen,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            window: 90,
            stride: 2,
            centre: None,
            min_samples: 3,
            sam: None,
            onnxruntime: None,
            back: BackRule::default(),
            surface: SurfaceRule::default(),
            mesher: MesherRule::default(),
            element_size: None,
            finest_cell: 2.2e-3,
            max_tets: 50_000,
        }
    }
}

impl Settings {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// Names the setting, its value, and what would be right.
    pub fn validate(&self) -> Result<()> {
        let wrong = |reason: String| Err(Error::Setting(reason));
        if self.stride == 0 {
            return wrong("stride is 0; it must be at least 1 frame".into());
        }
        if self.min_samples == 0 {
            return wrong("min_samples is 0; it must be at least 1 frame".into());
        }
        for (name, length) in [("finest cell", Some(self.finest_cell)), ("element size", self.element_size)] {
            if let Some(length) = length
                && !(1e-4..=0.1).contains(&length)
            {
                return wrong(format!("the {name} is {} mm; it must be in [0.1, 100] mm", 1e3 * length));
            }
        }
        if self.max_tets < 100 {
            return wrong(format!("max_tets is {}; it must be at least 100", self.max_tets));
        }
        Ok(())
    }

    /// The settings as `name = value`, in the order of the struct.
    pub(crate) fn list(&self) -> Vec<String> {
        let mut list = vec![
            format!("window = {}", self.window),
            format!("stride = {}", self.stride),
            self.centre.map_or("centre = middle".into(), |c| format!("centre = {c}")),
            format!("min_samples = {}", self.min_samples),
            format!("back = {:?}", self.back),
            format!("surface = {:?}", self.surface),
            format!("mesher = {:?}", self.mesher),
        ];
        if let Some(sam) = &self.sam {
            list.push(format!("sam = {}", sam.display()));
        }
        match self.element_size {
            Some(size) => list.push(format!("element_size_m = {size}")),
            None => {
                list.push(format!("finest_cell_m = {}", self.finest_cell));
                list.push(format!("max_tets = {}", self.max_tets));
            }
        }
        list
    }
}
