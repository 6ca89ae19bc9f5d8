//! Convex polyhedra from points, and their exact signed distance.
//!
//! The hull grows from a tetrahedron by the point farthest outside of it, so that every added point
//! is a corner and the faces stay well shaped. Points within rounding of a face belong to it.

use super::nearest::{MAX_SHAPE_SIZE, Nearest};
use glam::DVec3;
use trocar_geometry::TriMesh;

/// Greatest number of points of a hull. Every query visits all faces.
const MAX_HULL_POINTS: usize = 256;

/// Least extent of a hull (m).
const MIN_HULL_EXTENT: f64 = 1e-5;

/// Thickness over extent below which points lie in a plane or on a line.
const FLAT: f64 = 1e-4;

/// Share of the extent within which a point belongs to a face: 10 nm for an instrument of 10 cm. A
/// face this narrow still has its normal to a hundredth of it.
const ON_FACE: f64 = 1e-7;

/// Rounding of a distance over the extent: a shorter offset has no direction.
const ROUNDING: f64 = 1e-14;

/// A convex polyhedron. A query costs a dot product for each face, and some twenty more for each
/// face that faces the point.
#[derive(Clone, Debug, PartialEq)]
pub struct Hull {
    surface: TriMesh,
    faces: Vec<Face>,
    /// Diagonal of the box around it (m).
    extent: f64,
}

/// A triangle of the hull.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Face {
    corners: [DVec3; 3],
    /// Unit, outwards.
    normal: DVec3,
}

impl Hull {
    /// The convex hull of at most 256 `points` (m). Points inside are left out.
    ///
    /// # Errors
    /// Too few or too many points, coordinates that are not finite or beyond 10 m, points in a
    /// plane or on a line, or all within 0.01 mm.
    pub fn of(points: &[DVec3]) -> Result<Self, String> {
        if !(4..=MAX_HULL_POINTS).contains(&points.len()) {
            return Err(format!("a hull of {} points; it takes 4 to {MAX_HULL_POINTS}", points.len()));
        }
        // NaN fails every comparison.
        if let Some(i) = points.iter().position(|p| !(p.is_finite() && p.abs().max_element() <= MAX_SHAPE_SIZE)) {
            return Err(format!(
                "point {i} of a hull is {} m; coordinates must be finite and within {MAX_SHAPE_SIZE} m",
                points[i]
            ));
        }
        let (low, high) = points.iter().fold((points[0], points[0]), |(l, h), p| (l.min(*p), h.max(*p)));
        let extent = (high - low).length();
        if extent < MIN_HULL_EXTENT {
            return Err(format!("a hull's points lie within {extent:.1e} m; must be {MIN_HULL_EXTENT:.0e} m or more"));
        }
        let mut triangles = first_tetrahedron(points, extent)?.to_vec();
        while let Some(p) = farthest_outside(points, &triangles, ON_FACE * extent) {
            // Each round adds a point, so the loop ends.
            if triangles.iter().flatten().any(|i| *i == p) {
                return Err(too_close(p));
            }
            add_corner(points, &mut triangles, p, ON_FACE * extent)?;
        }
        Ok(Self::from_triangles(points, triangles, extent))
    }

    fn from_triangles(points: &[DVec3], mut triangles: Vec<[usize; 3]>, extent: f64) -> Self {
        // The result does not depend on the order of growth: each triangle begins with its lowest
        // corner, and triangles are sorted.
        for t in &mut triangles {
            let least = (0..3).fold(0, |a, b| if t[b] < t[a] { b } else { a });
            t.rotate_left(least);
        }
        triangles.sort_unstable();
        let mut used: Vec<usize> = triangles.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        // `used` holds every corner.
        let number = |i: usize| used.binary_search(&i).unwrap_or(0) as u32;
        let faces = triangles.iter().map(|t| Face { corners: t.map(|i| points[i]), normal: normal(points, *t) });
        Self {
            faces: faces.collect(),
            surface: TriMesh {
                vertices: used.iter().map(|i| points[*i]).collect(),
                triangles: triangles.iter().map(|t| t.map(number)).collect(),
                colors: Vec::new(),
            },
            extent,
        }
    }

    /// Its corners (m), in the order of the points it was made of.
    pub fn corners(&self) -> &[DVec3] {
        &self.surface.vertices
    }

    /// Its faces in triangles, outwards; closed.
    pub fn surface(&self) -> &TriMesh {
        &self.surface
    }

    /// Smallest and largest coordinates (m).
    pub(super) fn aabb(&self) -> (DVec3, DVec3) {
        self.surface.bounds().unwrap_or_default()
    }

    /// Centre and radius (m) of a ball around it.
    pub(super) fn ball(&self) -> (DVec3, f64) {
        let (low, high) = self.aabb();
        let centre = 0.5 * (low + high);
        (centre, self.corners().iter().fold(0.0, |r, p| p.distance(centre).max(r)))
    }

    /// The nearest point of the surface to `p` (m).
    pub fn nearest(&self, p: DVec3) -> Nearest {
        let mut top = Nearest { distance: f64::NEG_INFINITY, normal: DVec3::Z };
        for face in &self.faces {
            let height = face.height(p);
            if height > top.distance {
                top = Nearest { distance: height, normal: face.normal };
            }
        }
        // Inside, the nearest plane is the answer. Outside, the nearest point lies on a face that
        // is seen from `p`, no nearer than its plane. Where triangles share a plane, rounding may
        // hide the right one.
        let hidden = -2.0 * ON_FACE * self.extent;
        if top.distance <= 0.0 {
            return top;
        }
        let mut best = f64::INFINITY;
        let mut near = top;
        for face in &self.faces {
            let height = face.height(p);
            if height <= hidden || height * height >= best {
                continue;
            }
            let found = match face.offset(p) {
                None => Nearest { distance: height, normal: face.normal },
                Some(off) => {
                    let distance = off.length();
                    let direction = if distance > ROUNDING * self.extent { off / distance } else { top.normal };
                    Nearest { distance, normal: direction }
                }
            };
            if found.distance * found.distance < best {
                best = found.distance * found.distance;
                near = found;
            }
        }
        near
    }
}

impl Face {
    fn height(&self, p: DVec3) -> f64 {
        (p - self.corners[0]).dot(self.normal)
    }

    /// From the nearest point of the triangle's edges to `p`; None where `p` is above the triangle
    /// (Ericson 2005, "Real-Time Collision Detection", 5.1.5).
    fn offset(&self, p: DVec3) -> Option<DVec3> {
        let [a, b, c] = self.corners;
        let mut beyond = false;
        let mut near = DVec3::INFINITY;
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let (edge, off) = (to - from, p - from);
            if edge.cross(off).dot(self.normal) < 0.0 {
                beyond = true;
                let share = (off.dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
                let off = off - share * edge;
                if off.length_squared() < near.length_squared() {
                    near = off;
                }
            }
        }
        beyond.then_some(near)
    }
}

fn normal(points: &[DVec3], [a, b, c]: [usize; 3]) -> DVec3 {
    (points[b] - points[a]).cross(points[c] - points[a]).normalize_or_zero()
}

/// The index for which `size` is largest; the first of equals.
fn largest(count: usize, size: impl Fn(usize) -> f64) -> usize {
    (1..count).fold(0, |best, i| if size(i) > size(best) { i } else { best })
}

/// Four points that are far from a plane, as triangles that face outwards.
fn first_tetrahedron(points: &[DVec3], extent: f64) -> Result<[[usize; 3]; 4], String> {
    let n = points.len();
    let a = largest(n, |i| points[i].distance_squared(points[0]));
    let b = largest(n, |i| points[i].distance_squared(points[a]));
    let axis = (points[b] - points[a]).normalize_or_zero();
    let c = largest(n, |i| (points[i] - points[a]).cross(axis).length());
    let width = (points[c] - points[a]).cross(axis).length();
    if width < FLAT * extent {
        return Err(format!("a hull's points lie on a line: they are {width:.1e} m off it and {extent:.1e} m apart"));
    }
    let across = normal(points, [a, b, c]);
    let height = |i: usize| (points[i] - points[a]).dot(across);
    let d = largest(n, |i| height(i).abs());
    if height(d).abs() < FLAT * extent {
        let off = height(d).abs();
        return Err(format!("a hull's points lie in a plane: they are {off:.1e} m off it and {extent:.1e} m apart"));
    }
    let (b, c) = if height(d) > 0.0 { (c, b) } else { (b, c) };
    Ok([[a, b, c], [a, d, b], [b, d, c], [c, d, a]])
}

/// The point that is farthest outside of any triangle's plane, if one is farther than `rounding`.
fn farthest_outside(points: &[DVec3], triangles: &[[usize; 3]], rounding: f64) -> Option<usize> {
    let mut best = rounding;
    let mut farthest = None;
    for t in triangles {
        let across = normal(points, *t);
        for (i, p) in points.iter().enumerate() {
            let height = (p - points[t[0]]).dot(across);
            if height > best {
                best = height;
                farthest = Some(i);
            }
        }
    }
    farthest
}

/// Replaces the triangles that are seen from point `p` by those between it and their outline.
fn add_corner(points: &[DVec3], triangles: &mut Vec<[usize; 3]>, p: usize, rounding: f64) -> Result<(), String> {
    let seen = |t: &[usize; 3]| (points[p] - points[t[0]]).dot(normal(points, *t)) > rounding;
    let (gone, mut kept): (Vec<[usize; 3]>, Vec<[usize; 3]>) = triangles.iter().partition(|t| seen(t));
    let sides: Vec<[usize; 2]> = gone.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]).collect();
    let outline: Vec<[usize; 2]> = sides.iter().filter(|[a, b]| !sides.contains(&[*b, *a])).copied().collect();
    // The outline is one closed line that meets every corner once, and no triangle is without area.
    // Otherwise points are too close to be told apart.
    let once = outline.iter().all(|[a, _]| outline.iter().filter(|[b, _]| a == b).count() == 1);
    let follows = |start: usize| outline.iter().find(|[a, _]| *a == start).map(|[_, b]| *b);
    let mut length = 0;
    let mut at = outline.first().map(|[a, _]| *a);
    while let Some(i) = at.filter(|_| length < outline.len()) {
        at = follows(i);
        length += 1;
        if at == outline.first().map(|[a, _]| *a) {
            break;
        }
    }
    let new = outline.iter().map(|[a, b]| [*a, *b, p]);
    if !once || length != outline.len() || new.clone().any(|t| normal(points, t) == DVec3::ZERO) {
        return Err(too_close(p));
    }
    kept.extend(new);
    *triangles = kept;
    Ok(())
}

fn too_close(p: usize) -> String {
    format!(
        "point {p} of a hull is too close to others, or to the line between them; leave it out, or move it by more than rounding"
    )
}
