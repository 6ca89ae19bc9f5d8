//! Vertex colours by projection into the image.

use trocar_camera::{Camera, ColorImage, Mask, pixel_neighbours};
use trocar_geometry::TriMesh;

/// Colours the vertices of `mesh` with the pixels they project to; the unseen back gets the colour
/// seen in front of it. Only pixels of `mask` that are also `colored` are used; elsewhere the
/// nearest of them is.
pub fn color_vertices(mesh: &mut TriMesh, image: &ColorImage, colored: &Mask, mask: &Mask, camera: &Camera) {
    let (w, h) = (image.width, image.height);
    // Breadth first from the usable pixels over the whole image.
    let mut source: Vec<usize> = vec![usize::MAX; w * h];
    let mut queue: Vec<usize> = (0..w * h).filter(|&i| mask.set[i] && colored.set[i]).collect();
    queue.iter().for_each(|&i| source[i] = i);
    let mut next = 0;
    while next < queue.len() {
        let i = queue[next];
        next += 1;
        for j in pixel_neighbours(i, w, h) {
            if source[j] == usize::MAX {
                source[j] = source[i];
                queue.push(j);
            }
        }
    }
    let color = |p: &glam::DVec3| {
        let pixel = camera.project(*p)?;
        let u = pixel.x.round().clamp(0.0, (w - 1) as f64) as usize;
        let v = pixel.y.round().clamp(0.0, (h - 1) as f64) as usize;
        image.pixels.get(source[v * w + u]).copied()
    };
    mesh.colors = mesh.vertices.iter().map(|p| color(p).unwrap_or(crate::TISSUE_COLOR)).collect();
}
