//! Picture metrics: intersection over union of silhouettes, and SSIM and PSNR of colours within a
//! mask, with and without exposure matching.
//!
//! Pictures are 8-bit sRGB and compared in sRGB values, as is usual. A mask selects the pixels that
//! count.
//!
//! ```
//! use trocar_camera::metrics::{compare, iou};
//! use trocar_camera::{ColorImage, Mask};
//!
//! let target = ColorImage::new(32, 32, [120, 60, 60]);
//! let darker = ColorImage::new(32, 32, [60, 30, 30]);
//! let mask = Mask { width: 32, height: 32, set: vec![true; 32 * 32] };
//! let metrics = compare(&target, &darker, &mask)?;
//! assert_eq!(metrics.gains, [2.0; 3]);
//! assert!(metrics.psnr_db < 20.0 && metrics.psnr_matched_db.is_infinite());
//! assert_eq!(iou(&mask, &mask)?, Some(1.0));
//! # Ok::<(), trocar_camera::metrics::Error>(())
//! ```

mod compare;
mod error;
mod exposure;
mod silhouette;
mod ssim;

pub use compare::{ImageMetrics, compare, mean_colour, psnr_db};
pub use error::{Error, Result};
pub use exposure::{Matched, match_exposure};
pub use silhouette::{iou, union};
pub use ssim::{Ssim, ssim};
