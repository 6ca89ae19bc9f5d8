//! Solids for surroundings, arms and instruments: blended primitives and surfaces of revolution.

use glam::{DVec2, DVec3};
use trocar_geometry::{SignedDistance, TriMesh, isosurface, sample_everywhere};

/// A primitive of a [`Solid`].
#[derive(Clone, Copy, Debug)]
pub(crate) enum Part {
    /// A cylinder between two points with a rounded edge (m).
    Cylinder { from: DVec3, to: DVec3, radius: f64, edge: f64 },
    /// The convex hull of two balls (m).
    Cone { from: DVec3, to: DVec3, radii: [f64; 2] },
    /// An axis-aligned box with rounded edges (m).
    Block { centre: DVec3, half: DVec3, edge: f64 },
}

/// Primitives blended over the distance `blend` (m), each with its sRGB colour.
#[derive(Clone, Debug, Default)]
pub(crate) struct Solid {
    pub parts: Vec<(Part, [u8; 3])>,
    pub blend: f64,
}

impl Part {
    /// Signed distance (Quilez, "3D SDFs": capped cylinder, round cone, box).
    pub fn distance(&self, p: DVec3) -> f64 {
        match *self {
            Self::Cylinder { from, to, radius, edge } => {
                let axis = to - from;
                let half = 0.5 * axis.length();
                let u = axis.normalize_or(DVec3::Z);
                let q = p - 0.5 * (from + to);
                let along = q.dot(u);
                let aside = (q - along * u).length();
                let d = DVec2::new(aside - (radius - edge), along.abs() - (half - edge));
                d.max(DVec2::ZERO).length() + d.max_element().min(0.0) - edge
            }
            Self::Cone { from, to, radii: [r1, r2] } => {
                let axis = to - from;
                let l2 = axis.length_squared().max(1e-18);
                let rr = r1 - r2;
                let a2 = l2 - rr * rr;
                let q = p - from;
                let y = q.dot(axis);
                let z = y - l2;
                let x2 = (q * l2 - axis * y).length_squared();
                let (y2, z2) = (y * y * l2, z * z * l2);
                let k = rr.signum() * rr * rr * x2;
                if z.signum() * a2 * z2 > k {
                    (x2 + z2).sqrt() / l2 - r2
                } else if y.signum() * a2 * y2 < k {
                    (x2 + y2).sqrt() / l2 - r1
                } else {
                    ((x2 * a2 / l2).max(0.0).sqrt() + y * rr) / l2 - r1
                }
            }
            Self::Block { centre, half, edge } => {
                let q = (p - centre).abs() - half + edge;
                q.max(DVec3::ZERO).length() + q.max_element().min(0.0) - edge
            }
        }
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        match *self {
            Self::Cylinder { from, to, radius, .. } => (from.min(to) - radius, from.max(to) + radius),
            Self::Cone { from, to, radii: [a, b] } => ((from - a).min(to - b), (from + a).max(to + b)),
            Self::Block { centre, half, .. } => (centre - half, centre + half),
        }
    }
}

impl SignedDistance for Solid {
    fn distance(&self, p: DVec3) -> f64 {
        let k = self.blend;
        self.parts.iter().fold(f64::INFINITY, |d, (part, _)| {
            let e = part.distance(p);
            if k <= 0.0 || !d.is_finite() {
                return d.min(e);
            }
            let h = (k - (d - e).abs()).max(0.0) / k;
            d.min(e) - 0.25 * h * h * k
        })
    }
}

impl Solid {
    /// An empty solid whose primitives blend over the distance `blend` (m).
    pub fn new(blend: f64) -> Self {
        Self { parts: Vec::new(), blend }
    }

    pub fn with(mut self, color: [u8; 3], part: Part) -> Self {
        self.parts.push((part, color));
        self
    }

    /// Surface mesh with cells of `spacing` (m).
    pub fn surface(&self, spacing: f64) -> TriMesh {
        self.carved(spacing, |d, _| d)
    }

    /// Surface mesh after `carve` has changed the distance at each point.
    pub fn carved(&self, spacing: f64, carve: impl Fn(f64, DVec3) -> f64 + Sync) -> TriMesh {
        struct Carved<'a, F>(&'a Solid, F);
        impl<F: Fn(f64, DVec3) -> f64 + Sync> SignedDistance for Carved<'_, F> {
            fn distance(&self, p: DVec3) -> f64 {
                (self.1)(self.0.distance(p), p)
            }
        }
        let all = self.parts.iter().map(|(part, _)| part.bounds());
        let Some(bounds) = all.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))) else { return TriMesh::default() };
        let mut mesh = isosurface(&sample_everywhere(&Carved(self, carve), bounds, spacing), 0.0);
        mesh.colors = mesh
            .vertices
            .iter()
            .map(|p| {
                let nearest = self.parts.iter().min_by(|a, b| a.0.distance(*p).total_cmp(&b.0.distance(*p)));
                nearest.map_or([200; 3], |(_, color)| *color)
            })
            .collect();
        mesh
    }
}

/// Number of segments around the axis of a surface of revolution.
const SIDES: u32 = 40;

/// Revolves a profile of (position along x, radius) pairs (m) around x; closed where the radius is
/// 0. Edges between sections are sharp if they bend by more than about 30 degrees.
pub(crate) fn revolve(profile: &[[f64; 2]]) -> TriMesh {
    let mut mesh = TriMesh::default();
    let ring = |mesh: &mut TriMesh, [x, r]: [f64; 2]| {
        let first = mesh.vertices.len() as u32;
        for k in 0..SIDES {
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * f64::from(k) / f64::from(SIDES));
            mesh.vertices.push(DVec3::new(x, r * cos, r * sin));
        }
        first
    };
    let mut last: Option<(u32, DVec2)> = None;
    for pair in profile.windows(2) {
        let along = DVec2::from(pair[1]) - DVec2::from(pair[0]);
        let smooth = last.filter(|(_, before)| before.angle_to(along).abs() < 0.5);
        let a = smooth.map_or_else(|| ring(&mut mesh, pair[0]), |(first, _)| first);
        let b = ring(&mut mesh, pair[1]);
        for k in 0..SIDES {
            let n = (k + 1) % SIDES;
            if pair[0][1] > 0.0 {
                mesh.triangles.push([a + k, a + n, b + k]);
            }
            if pair[1][1] > 0.0 {
                mesh.triangles.push([a + n, b + n, b + k]);
            }
        }
        last = Some((b, along));
    }
    mesh
}

/// Rotates and translates the mesh so that its x axis runs from `from` towards `to`.
pub(crate) fn align_x(mesh: &TriMesh, from: DVec3, to: DVec3) -> TriMesh {
    let turn = glam::DQuat::from_rotation_arc(DVec3::X, (to - from).normalize_or(DVec3::X));
    TriMesh { vertices: mesh.vertices.iter().map(|p| turn * *p + from).collect(), ..mesh.clone() }
}

/// Appends a mesh to another. Either both or neither have colours.
pub(crate) fn append(into: &mut TriMesh, other: &TriMesh) {
    let first = into.vertices.len() as u32;
    into.vertices.extend(&other.vertices);
    into.colors.extend(&other.colors);
    into.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solids_are_closed_and_have_the_right_volume() {
        let ball = Part::Cone { from: DVec3::ZERO, to: DVec3::new(0.0, 0.0, 1e-9), radii: [0.03, 0.03] };
        let surface = Solid::new(0.0).with([1; 3], ball).surface(0.002);
        assert!(surface.is_watertight());
        let volume = 4.0 / 3.0 * std::f64::consts::PI * 0.03_f64.powi(3);
        assert!((surface.volume() / volume - 1.0).abs() < 0.01, "{}", surface.volume() / volume);
        let can = Part::Cylinder { from: DVec3::ZERO, to: DVec3::new(0.0, 0.1, 0.0), radius: 0.02, edge: 0.001 };
        let surface = Solid::new(0.01).with([1; 3], can).surface(0.002);
        assert!((surface.volume() / (std::f64::consts::PI * 4e-4 * 0.1) - 1.0).abs() < 0.02);
    }

    #[test]
    fn surfaces_of_revolution_face_outward() {
        let mesh = revolve(&[[0.0, 0.0], [0.0, 0.01], [0.1, 0.01], [0.1, 0.0]]);
        assert!((mesh.volume() / (std::f64::consts::PI * 1e-4 * 0.1) - 1.0).abs() < 0.02, "{}", mesh.volume());
    }
}
