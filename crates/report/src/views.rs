//! Rendered views: poses of cameras, and sections of bodies.

use glam::DVec3;
use std::collections::BTreeMap;
use trocar_camera::{Camera, ColorImage};
use trocar_core::Pose;
use trocar_geometry::{TetMesh, TriMesh};
use trocar_render::phong::PhongScene;

/// Rays per side of a pixel.
const SAMPLES: usize = 2;

/// A camera and its pose.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// The camera.
    pub camera: Camera,
    /// Camera to world.
    pub pose: Pose,
}

impl View {
    /// The closest view along `-from` (a direction to the eye) that shows all `points` with a
    /// margin.
    pub fn framing(points: &[DVec3], from: DVec3, up: DVec3, (width, height): (usize, usize)) -> Self {
        const HALF_ANGLE: f64 = 0.26;
        const MARGIN: f64 = 1.08;
        let camera = Camera::centred(width, height, 2.0 * HALF_ANGLE);
        let f = camera.fx;
        let (tan_x, tan_y) = (width as f64 / 2.0 / f / MARGIN, height as f64 / 2.0 / f / MARGIN);
        let from = from.normalize_or(DVec3::Z);
        let turned = Pose::look_at(DVec3::ZERO, -from, up);
        let local: Vec<DVec3> =
            points.iter().filter(|p| p.is_finite()).map(|p| turned.inverse().transform(*p)).collect();
        // Four planes through the eye bound the view. Along x and along y the eye is where the
        // outermost planes meet.
        let most = |f: &dyn Fn(&DVec3) -> f64| local.iter().map(f).fold(f64::NEG_INFINITY, f64::max);
        let (right, left) = (most(&|p| p.x - tan_x * p.z), most(&|p| -p.x - tan_x * p.z));
        let (down, above) = (most(&|p| p.y - tan_y * p.z), most(&|p| -p.y - tan_y * p.z));
        let z = -((right + left) / (2.0 * tan_x)).max((down + above) / (2.0 * tan_y));
        let eye = DVec3::new((right - left) / 2.0, (down - above) / 2.0, z);
        let eye = if eye.is_finite() { eye - 1e-3 * DVec3::Z } else { DVec3::ZERO };
        Self { camera, pose: Pose { translation: turned.transform(eye), ..turned } }
    }

    /// Renders `scene` with anti-aliasing, lit from above the viewer's left shoulder.
    pub fn picture(&self, scene: &PhongScene) -> ColorImage {
        let light = self.pose.rotation * DVec3::new(-0.45, -0.8, -0.9);
        scene.render_lit(&self.camera, &self.pose, SAMPLES, Some(light)).color
    }
}

/// Surface of a body, or of the half behind a plane through its centre: `skin` is the colour of the
/// outer surface, `inside` that of the section. Faces of different colours share no vertices.
pub fn shell(body: &TetMesh, cut: Option<DVec3>, skin: [u8; 3], inside: [u8; 3]) -> TriMesh {
    let Some(normal) = cut else {
        let mut surface = body.boundary().0;
        surface.colors = vec![skin; surface.vertices.len()];
        return surface;
    };
    let centre = body.vertices.iter().sum::<DVec3>() / body.vertices.len().max(1) as f64;
    let half = body.cut_away(centre, normal);
    let mut mesh = TriMesh::default();
    let mut index: BTreeMap<(u32, bool), u32> = BTreeMap::new();
    for (triangle, bared) in half.surface.triangles.iter().zip(half.bared) {
        mesh.triangles.push(triangle.map(|vertex| {
            *index.entry((vertex, bared)).or_insert_with(|| {
                mesh.vertices.push(half.surface.vertices[vertex as usize]);
                mesh.colors.push(if bared { inside } else { skin });
                (mesh.vertices.len() - 1) as u32
            })
        }));
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn framing_shows_everything_and_fills_the_picture() {
        let points: Vec<DVec3> = (0..200)
            .map(|i| {
                let t = f64::from(i);
                DVec3::new(0.08 * (1.3 * t).sin(), 0.03 * (0.7 * t).cos(), 0.3 + 0.02 * (2.1 * t).sin())
            })
            .collect();
        for from in [DVec3::Z, DVec3::new(1.0, 0.4, 0.3), DVec3::new(-0.2, -1.0, 0.5)] {
            let view = View::framing(&points, from, DVec3::Z, (480, 300));
            let pixels: Vec<_> =
                points.iter().map(|p| view.camera.project(view.pose.inverse().transform(*p)).unwrap()).collect();
            let reach = |f: &dyn Fn(&glam::DVec2) -> f64| pixels.iter().map(f).fold(f64::NEG_INFINITY, f64::max);
            let (x1, x0, y1, y0) = (reach(&|p| p.x), -reach(&|p| -p.x), reach(&|p| p.y), -reach(&|p| -p.y));
            assert!(x0 >= 0.0 && x1 < 480.0 && y0 >= 0.0 && y1 < 300.0, "{x0} {x1} {y0} {y1}");
            assert!(x1 - x0 > 0.8 * 480.0 || y1 - y0 > 0.8 * 300.0, "small: {x0} {x1} {y0} {y1}");
        }
    }

    #[test]
    fn framing_no_points_is_a_view() {
        let view = View::framing(&[], DVec3::Z, DVec3::Z, (48, 30));
        assert!(view.pose.translation.is_finite());
    }

    #[test]
    fn a_cut_face_is_the_face_to_the_removed_element() {
        let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, 1.0, 1.0)];
        let body = TetMesh { vertices, tets: vec![[0, 1, 2, 3], [1, 4, 2, 3]] };
        let (skin, inside) = ([1; 3], [2; 3]);
        let whole = shell(&body, None, skin, inside);
        assert_eq!((whole.triangles.len(), whole.colors.contains(&inside)), (6, false));
        let half = shell(&body, Some(DVec3::ONE), skin, inside);
        assert_eq!(half.triangles.len(), 4);
        let cut: Vec<_> = half.triangles.iter().filter(|t| half.colors[t[0] as usize] == inside).collect();
        assert_eq!(cut.len(), 1);
        let [a, b, c] = cut[0].map(|v| half.vertices[v as usize]);
        assert!((b - a).cross(c - a).dot(DVec3::ONE) > 0.0, "outward is away from the kept element");
    }
}
