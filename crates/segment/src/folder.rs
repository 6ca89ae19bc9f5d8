//! Mask files, drawn or computed elsewhere.

use crate::{Error, Picture, Result, Segmenter, Target};
use std::path::PathBuf;
use trocar_camera::Mask;

/// Reads `<folder>/<target>.png`, whatever the picture shows; the sizes must agree. For organs,
/// which do not move.
#[derive(Clone, Debug)]
pub struct MaskFolder {
    /// The folder, usually a recording's `masks`.
    pub folder: PathBuf,
}

impl Segmenter for MaskFolder {
    fn segment(&self, picture: &Picture<'_>, target: &Target) -> Result<Mask> {
        picture.check()?;
        let name = &target.name;
        // The name is one file in the folder, never a path out of it.
        if name.is_empty() || name.starts_with('.') || name.contains(['/', '\\', ':', '\0']) {
            return Err(target.error("the name must be that of a file in the mask folder, without '.png'"));
        }
        let path = self.folder.join(format!("{name}.png"));
        let mask = Mask::read(&path)?;
        let (width, height) = (picture.color.width, picture.color.height);
        if (mask.width, mask.height) != (width, height) {
            let reason = format!(
                "the mask has {} x {} pixels, but {} is {width} x {height}",
                mask.width, mask.height, picture.name
            );
            return Err(Error::file(&path, reason));
        }
        if mask.count() == 0 {
            return Err(Error::file(&path, "no pixel is set; the target's pixels must be white"));
        }
        Ok(mask)
    }

    fn describe(&self) -> String {
        format!("masks in {}", self.folder.display())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_camera::ColorImage;

    #[test]
    fn files_are_read_and_checked() {
        let dir = tempfile::tempdir().unwrap();
        let folder = MaskFolder { folder: dir.path().to_owned() };
        let color = ColorImage::new(4, 3, [0; 3]);
        let picture = Picture { color: &color, depth: None, name: "composite" };
        let find = |name: &str| folder.segment(&picture, &Target { name: name.into(), ..Target::default() });

        let mut mask = Mask::new(4, 3);
        mask.write_png(&dir.path().join("empty.png")).unwrap();
        mask.set[5] = true;
        mask.write_png(&dir.path().join("liver.png")).unwrap();
        Mask { width: 3, height: 4, ..mask.clone() }.write_png(&dir.path().join("turned.png")).unwrap();
        assert_eq!(find("liver").unwrap(), mask);
        assert!(find("empty").unwrap_err().to_string().contains("empty.png"));
        assert!(find("missing").unwrap_err().to_string().contains("missing.png"));
        let message = find("turned").unwrap_err().to_string();
        assert!(message.contains("3 x 4") && message.contains("composite is 4 x 3"), "{message}");
        for outside in ["../liver", "a/b", "", "c:x", ".."] {
            assert!(find(outside).unwrap_err().to_string().contains("name"), "{outside}");
        }
    }
}
