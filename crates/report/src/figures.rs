//! Pictures as data URIs.

use crate::page;
use crate::{Error, Result};
use base64::{Engine, engine::general_purpose::STANDARD};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, RgbImage, imageops};
use trocar_camera::{ColorImage, jpeg};

/// Maximum width (px): a page shows at most 1100 CSS pixels.
const MAX_WIDTH: u32 = 1280;

/// An `<img>` of `picture`; `alt` is plain text. PNG if it is small, else JPEG.
///
/// # Errors
/// A picture whose number of pixels differs from its size.
pub fn img(picture: &ColorImage, alt: &str) -> Result<String> {
    let rgb = to_rgb(picture)?;
    let rgb = if rgb.width() > MAX_WIDTH {
        let height = (f64::from(rgb.height()) * f64::from(MAX_WIDTH) / f64::from(rgb.width())).round().max(1.0);
        imageops::thumbnail(&rgb, MAX_WIDTH, height as u32)
    } else {
        rgb
    };
    let (width, height) = rgb.dimensions();
    let jpeg =
        jpeg(rgb.as_raw(), width as usize, height as usize).map_err(|wrong| Error::Mismatch(wrong.to_string()))?;
    let (kind, bytes) = small_png(&rgb, jpeg.len())?.map_or(("jpeg", jpeg), |png| ("png", png));
    Ok(img_of_bytes(kind, &bytes, width as usize, height as usize, alt))
}

/// The picture as PNG, if that is no larger than 40 kB or one and a half times its JPEG of `jpeg`
/// bytes. A picture like a photograph is not tried: a PNG of one is several times as large.
fn small_png(rgb: &RgbImage, jpeg: usize) -> Result<Option<Vec<u8>>> {
    let encode = |compression| -> Result<Vec<u8>> {
        let mut png = Vec::new();
        let encoder = PngEncoder::new_with_quality(&mut png, compression, FilterType::Adaptive);
        encoder.write_image(rgb, rgb.width(), rgb.height(), ExtendedColorType::Rgb8)?;
        Ok(png)
    };
    let is_small = |png: &Vec<u8>, times: usize| png.len() < 40_000 * times || 2 * png.len() <= 3 * jpeg * times;
    // Good compression takes most of the time. It hardly halves what the lightest one leaves.
    if is_photograph(rgb) || !is_small(&encode(CompressionType::Level(1))?, 2) {
        return Ok(None);
    }
    Ok(Some(encode(CompressionType::Default)?).filter(|png| is_small(png, 1)))
}

/// Whether most of the pixels of a large picture have colours of their own.
fn is_photograph(rgb: &RgbImage) -> bool {
    const SAMPLES: usize = 8192;
    let pixels = rgb.as_raw().as_chunks::<3>().0;
    let every = pixels.len() / SAMPLES;
    if every < 10 {
        return false;
    }
    let mut colors: Vec<[u8; 3]> = pixels.iter().step_by(every).copied().collect();
    let sampled = colors.len();
    colors.sort_unstable();
    colors.dedup();
    2 * colors.len() > sampled
}

/// A picture above its caption (HTML), as a `<figure>`; `alt` is plain text.
///
/// # Errors
/// As [`img`].
pub fn figure(picture: &ColorImage, alt: &str, caption: &str) -> Result<String> {
    Ok(page::figure(&img(picture, alt)?, caption))
}

/// An `<img>` of an encoded picture of type `image/{kind}`.
pub fn img_of_bytes(kind: &str, bytes: &[u8], width: usize, height: usize, alt: &str) -> String {
    format!(
        "<img src=\"data:image/{kind};base64,{}\" width=\"{width}\" height=\"{height}\" alt=\"{}\">",
        STANDARD.encode(bytes),
        page::escape(alt)
    )
}

fn to_rgb(picture: &ColorImage) -> Result<RgbImage> {
    let mismatch = || {
        Error::Mismatch(format!("a {} x {} picture has {} pixels", picture.width, picture.height, picture.pixels.len()))
    };
    let (Ok(width), Ok(height)) = (u32::try_from(picture.width), u32::try_from(picture.height)) else {
        return Err(mismatch());
    };
    if width == 0 || height == 0 {
        return Err(mismatch());
    }
    RgbImage::from_raw(width, height, picture.pixels.as_flattened().to_vec()).ok_or_else(mismatch)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(html: &str) -> image::DynamicImage {
        let base64 = html.split("base64,").nth(1).unwrap().split('"').next().unwrap();
        image::load_from_memory(&STANDARD.decode(base64).unwrap()).unwrap()
    }

    #[test]
    fn flat_pictures_stay_lossless_and_noise_becomes_jpeg() {
        let mut picture = ColorImage::new(300, 200, [10, 200, 30]);
        let html = img(&picture, "a \"flat\" one").unwrap();
        assert!(html.contains("image/png") && html.contains("a &quot;flat&quot; one"));
        assert_eq!(decoded(&html).into_rgb8().get_pixel(17, 3).0, [10, 200, 30]);

        let mut x = 1_u32;
        for p in &mut picture.pixels {
            x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *p = x.to_le_bytes()[1..].try_into().unwrap();
        }
        let html = img(&picture, "").unwrap();
        assert!(html.contains("image/jpeg"));
        assert_eq!(decoded(&html).width(), 300);
        let large = |colors: usize| {
            let pixels = (0..400 * 300).map(|i| picture.pixels[i % colors]).collect();
            RgbImage::from_raw(400, 300, ColorImage { width: 400, height: 300, pixels }.pixels.concat()).unwrap()
        };
        assert!(is_photograph(&large(50_000)) && !is_photograph(&large(1000)));
    }

    #[test]
    fn large_pictures_are_reduced_and_wrong_ones_refused() {
        let html = img(&ColorImage::new(2560, 1000, [9; 3]), "").unwrap();
        assert_eq!((decoded(&html).width(), decoded(&html).height()), (1280, 500));
        let broken = ColorImage { width: 4, height: 4, pixels: vec![[0; 3]; 5] };
        assert!(img(&broken, "").is_err());
        assert!(img(&ColorImage::new(0, 0, [0; 3]), "").is_err());
    }
}
