//! Resamples between a picture's size and a network's.

use crate::Result;
use image::imageops::FilterType;
use image::{ImageBuffer, Rgb};
use trocar_camera::ColorImage;

/// Mean of ImageNet's channels, by which SAM's input is normalised.
const MEAN: [f32; 3] = [0.485, 0.456, 0.406];
/// Standard deviation of ImageNet's channels.
const DEVIATION: [f32; 3] = [0.229, 0.224, 0.225];

/// The encoder's input: the picture resized to width x height, normalised, one plane per channel.
pub(super) fn encoder_input(color: &ColorImage, width: usize, height: usize) -> Result<Vec<f32>> {
    let bytes = color.pixels.as_flattened().to_vec();
    let image: ImageBuffer<Rgb<u8>, Vec<u8>> = ImageBuffer::from_raw(color.width as u32, color.height as u32, bytes)
        .ok_or_else(|| crate::Error::Setting("the picture has fewer pixels than width x height".into()))?;
    let small = image::imageops::resize(&image, width as u32, height as u32, FilterType::Triangle);
    let mut planes = vec![0.0; 3 * width * height];
    for (i, pixel) in small.pixels().enumerate() {
        for c in 0..3 {
            planes[c * width * height + i] = (f32::from(pixel.0[c]) / 255.0 - MEAN[c]) / DEVIATION[c];
        }
    }
    Ok(planes)
}

/// Bilinear resampling between pixel centres, sizes as width and height; the image continues beyond
/// its rim with the rim's values. (`image` clamps `f32` pixels to [0, 1], which logits exceed.)
pub(super) fn bilinear(values: &[f32], from: [usize; 2], to: [usize; 2]) -> Vec<f32> {
    if from == to {
        return values.to_vec();
    }
    let [columns, rows] = [0, 1].map(|axis| {
        let scale = from[axis] as f64 / to[axis].max(1) as f64;
        let tap = |i: usize| {
            let x = ((i as f64 + 0.5) * scale - 0.5).clamp(0.0, from[axis] as f64 - 1.0);
            (x as usize, (x as usize + 1).min(from[axis] - 1), x.fract() as f32)
        };
        (0..to[axis]).map(tap).collect::<Vec<_>>()
    });
    let mut out = Vec::with_capacity(to[0] * to[1]);
    for &(top, bottom, down) in &rows {
        let (above, below) = (&values[top * from[0]..], &values[bottom * from[0]..]);
        for &(left, right, along) in &columns {
            let upper = above[left] + (above[right] - above[left]) * along;
            let lower = below[left] + (below[right] - below[left]) * along;
            out.push(upper + (lower - upper) * down);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_images_stay_linear() {
        let (from, to) = ([8, 6], [20, 9]);
        let value = |x: f64, y: f64| (3.0 * x - 2.0 * y - 7.0) as f32;
        let small: Vec<f32> = (0..48).map(|i| value((i % 8) as f64, (i / 8) as f64)).collect();
        let large = bilinear(&small, from, to);
        for (i, v) in large.iter().enumerate() {
            let place = |i: usize, axis: usize| (i as f64 + 0.5) * from[axis] as f64 / to[axis] as f64 - 0.5;
            let (x, y) = (place(i % 20, 0).clamp(0.0, 7.0), place(i / 20, 1).clamp(0.0, 5.0));
            assert!((v - value(x, y)).abs() < 1e-4, "{v} at {x}, {y}");
        }
        assert_eq!(bilinear(&[4.0], [1, 1], [2, 2]), [4.0; 4]);
    }

    #[test]
    fn colours_are_normalised_by_plane() {
        let planes = encoder_input(&ColorImage::new(30, 20, [255, 0, 128]), 16, 16).unwrap();
        let expected = [(1.0 - 0.485) / 0.229, -0.456 / 0.224, (128.0 / 255.0 - 0.406) / 0.225];
        for (i, p) in planes.iter().enumerate() {
            assert!((p - expected[i / 256]).abs() < 1e-5, "{p} at {i}");
        }
    }
}
