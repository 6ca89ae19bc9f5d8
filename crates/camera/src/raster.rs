//! Rasterisation of triangles.

use glam::DVec3;

/// Calls `draw` with index (row by row) and depth (m) of every pixel of a `width` x `height` image
/// whose centre lies in the triangle or on its edges. A corner is (u, v, 1/z): pixel and inverse
/// depth (1/m). Inverse depth is linear over the image of a plane.
pub fn draw_triangle(corners: [DVec3; 3], width: usize, height: usize, mut draw: impl FnMut(usize, f64)) {
    let [a, b, c] = corners;
    let edge = |p: DVec3, q: DVec3, u: f64, v: f64| (q.x - p.x) * (v - p.y) - (q.y - p.y) * (u - p.x);
    let area = edge(a, b, c.x, c.y);
    if area == 0.0 || !area.is_finite() {
        return;
    }
    // Tolerance that keeps a pixel whose centre is a corner despite rounding.
    const SLACK: f64 = 1e-7;
    let (low, high) = (a.min(b).min(c) - SLACK, a.max(b).max(c) + SLACK);
    let range = |low: f64, high: f64, size: usize| {
        let last = high.floor().min(size as f64 - 1.0);
        if last < 0.0 || low > last { 0..0 } else { low.ceil().max(0.0) as usize..last as usize + 1 }
    };
    for v in range(low.y, high.y, height) {
        for u in range(low.x, high.x, width) {
            let (x, y) = (u as f64, v as f64);
            let (wa, wb) = (edge(b, c, x, y) / area, edge(c, a, x, y) / area);
            let wc = 1.0 - wa - wb;
            if wa.min(wb).min(wc) >= -SLACK {
                draw(v * width + u, 1.0 / (wa * a.z + wb * b.z + wc * c.z));
            }
        }
    }
}
