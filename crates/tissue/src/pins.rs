//! Rules that choose which nodes are held.

use glam::DVec3;

/// The lowest `share` (0..=1) of `nodes` along `up`; ties by index. round(share * n) indices, ascending.
pub fn lowest_band(nodes: &[DVec3], up: DVec3, share: f64) -> Vec<u32> {
    let _ = (nodes, up, share);
    todo!()
}
