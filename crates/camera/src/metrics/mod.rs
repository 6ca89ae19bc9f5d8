//! How alike two pictures are: silhouettes by intersection over union, colours by SSIM and PSNR
//! within a mask, as they are and after matching the exposure of each channel.
//!
//! Pictures are 8-bit sRGB and compared in those values, as is usual; a mask says which pixels
//! count.

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
