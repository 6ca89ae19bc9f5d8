//! A stage: shapes, some of which deform, and the bodies that show them at a pose.

use crate::bvh::{Bounds, BoxTree, Ray, TriangleTree};
use crate::light::{Lamp, Light};
use crate::material::{Appearance, Material};
use crate::raster::{Clusters, Vec8, View, Visibility};
use crate::{Error, Result, srgb};
use fearless_simd::{Level, Simd};
use glam::{DVec3, Mat3A, Quat, Vec3A};
use std::sync::Arc;
use trocar_core::Pose;
use trocar_geometry::TriMesh;

/// Maximum number of triangles of a mesh.
const MAX_TRIANGLES: usize = 1 << 27;

/// Leaves of a shape's tree per entry of its body in the tree over all bodies.
const LEAVES_PER_ENTRY: usize = 32;
/// Maximum number of entries per body.
const MAX_ENTRIES_PER_BODY: usize = 64;

/// Identifier of a shape on a [`Stage`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShapeId(usize);

/// Identifier of a body on a [`Stage`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BodyId(pub(super) usize);

/// Shapes, bodies and lights, rendered through any number of cameras (see [`crate::render`]).
///
/// A *shape* is a surface; [`Stage::deform`] moves its vertices. A *body* is a shape at a pose with
/// an appearance and a label; several bodies can share a shape. Positions are in metres in one
/// world frame. A copy of a stage shares its shapes with the original until they deform.
#[derive(Clone, Debug)]
pub struct Stage {
    pub(super) shapes: Vec<Shape>,
    pub(super) bodies: Vec<Body>,
    pub(super) top: BoxTree,
    /// For each leaf of the tree over bodies: the body and the entry node of its shape's tree.
    pub(super) entries: Vec<(u32, u32)>,
    lamps: Vec<Lamp>,
    stale: bool,
    pub(crate) level: Level,
    /// Memory for pictures.
    pub(crate) visibility: Visibility,
    /// Lights, in the world frame.
    pub lights: Vec<Light>,
    /// Linear radiance of the uniform environment.
    pub environment: [f32; 3],
}

#[derive(Clone, Debug)]
pub(super) struct Shape {
    pub(super) tree: Arc<TriangleTree>,
    /// Whether the vertices have moved since the tree was fitted.
    tree_stale: bool,
    clusters: Clusters,
    positions: Arc<Vec<Vec3A>>,
    triangles: Arc<Vec<[u32; 3]>>,
    normals: Arc<Vec<Vec3A>>,
    /// Linear colour per vertex; empty if the mesh has none.
    colors: Arc<Vec<Vec3A>>,
}

#[derive(Clone, Debug)]
pub(super) struct Body {
    pub(super) shape: usize,
    label: u16,
    /// Number of its first triangle among those of all bodies.
    first_triangle: u32,
    material: Arc<Material>,
    /// Material for paths that have bounced before.
    path_material: Arc<Material>,
    /// Linear colour, used if the shape has none.
    color: Vec3A,
    /// Whether the pose is the identity.
    pub(super) is_identity: bool,
    rotation: Mat3A,
    /// Inverse rotation.
    pub(super) inverse_rotation: Mat3A,
    pub(super) translation: Vec3A,
}

/// A body as a camera sees it.
pub(crate) struct BodyView<'a> {
    pub clusters: &'a Clusters,
    /// Number of its first triangle among those of all bodies.
    pub first_triangle: u32,
    /// From the shape to the camera.
    rotation: Mat3A,
    translation: Vec3A,
    /// The eye, in the shape's frame.
    eye: Vec3A,
}

/// First intersection of a ray with the stage.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StageHit {
    /// Ray parameter, in units of the ray's direction.
    pub t: f32,
    pub body: u32,
    pub(super) triangle: u32,
    pub(super) u: f32,
    pub(super) v: f32,
}

/// A point on a surface, in the world frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    pub position: Vec3A,
    /// Unit normal of the triangle, towards the origin of the ray.
    pub flat: Vec3A,
    /// Interpolated unit normal, on the same side.
    pub smooth: Vec3A,
    /// Linear colour.
    pub albedo: Vec3A,
}

impl Default for Stage {
    fn default() -> Self {
        Self::new()
    }
}

impl Stage {
    /// An empty, dark stage.
    pub fn new() -> Self {
        Self {
            shapes: Vec::new(),
            bodies: Vec::new(),
            top: BoxTree::default(),
            entries: Vec::new(),
            lamps: Vec::new(),
            stale: true,
            level: Level::new(),
            visibility: Visibility::default(),
            lights: Vec::new(),
            environment: [0.0; 3],
        }
    }

    /// Adds a surface. Triangles with a missing or non-finite vertex are invisible. Normals are
    /// interpolated across vertices that triangles share.
    ///
    /// # Errors
    /// The mesh has more than 2^27 triangles.
    pub fn add_shape(&mut self, mesh: &TriMesh) -> Result<ShapeId> {
        if mesh.triangles.len() > MAX_TRIANGLES {
            return Err(Error::TooLarge(mesh.triangles.len()));
        }
        let positions: Vec<Vec3A> = mesh.vertices.iter().map(|p| p.as_vec3a()).collect();
        let tree = TriangleTree::new(&positions, &mesh.triangles);
        let colored = mesh.colors.len() == mesh.vertices.len();
        let colors =
            if colored { mesh.colors.iter().map(|c| srgb::to_linear(*c).into()).collect() } else { Vec::new() };
        let mut shape = Shape {
            clusters: Clusters::new(mesh, &positions, tree.order()),
            tree: Arc::new(tree),
            tree_stale: false,
            positions: Arc::new(positions),
            triangles: Arc::new(mesh.triangles.clone()),
            normals: Arc::default(),
            colors: Arc::new(colors),
        };
        shape.update_normals();
        self.shapes.push(shape);
        Ok(ShapeId(self.shapes.len() - 1))
    }

    /// Moves the vertices of a shape to `positions` (m). The next picture that casts rays refits the
    /// search tree; it is not rebuilt.
    ///
    /// # Errors
    /// The shape is unknown, or the number of positions differs from its number of vertices.
    pub fn deform(&mut self, shape: ShapeId, positions: &[DVec3]) -> Result<()> {
        let count = self.shapes.len();
        let unknown = Error::Unknown { what: "shape", index: shape.0, count };
        let found = self.shapes.get_mut(shape.0).ok_or(unknown)?;
        if positions.len() != found.positions.len() {
            let (has, given) = (found.positions.len(), positions.len());
            return Err(Error::Vertices { shape: shape.0, has, given });
        }
        for (to, from) in Arc::make_mut(&mut found.positions).iter_mut().zip(positions) {
            *to = from.as_vec3a();
        }
        found.clusters.follow(&found.positions);
        found.tree_stale = true;
        found.update_normals();
        self.stale = true;
        Ok(())
    }

    /// Adds a body that shows `shape` at `pose` (shape frame to world frame). `label` is its value
    /// in label images; 0 means no body.
    ///
    /// # Errors
    /// The shape is unknown, or the bodies have 2^32 triangles or more.
    pub fn add_body(&mut self, shape: ShapeId, pose: &Pose, label: u16, appearance: &Appearance) -> Result<BodyId> {
        if shape.0 >= self.shapes.len() {
            return Err(Error::Unknown { what: "shape", index: shape.0, count: self.shapes.len() });
        }
        let first_triangle = self.triangles();
        let total = first_triangle + self.shapes[shape.0].triangles.len();
        if total >= u32::MAX as usize {
            return Err(Error::TooMany(total));
        }
        self.bodies.push(Body {
            shape: shape.0,
            label,
            first_triangle: first_triangle as u32,
            path_material: Arc::new(Material::new(&appearance.surface.for_paths())),
            material: Arc::new(Material::new(&appearance.surface)),
            color: srgb::to_linear(appearance.color).into(),
            is_identity: true,
            rotation: Mat3A::IDENTITY,
            inverse_rotation: Mat3A::IDENTITY,
            translation: Vec3A::ZERO,
        });
        let id = BodyId(self.bodies.len() - 1);
        self.place(id, pose)?;
        Ok(id)
    }

    /// Moves a body to `pose`.
    ///
    /// # Errors
    /// The body is unknown.
    pub fn place(&mut self, body: BodyId, pose: &Pose) -> Result<()> {
        let unknown = Error::Unknown { what: "body", index: body.0, count: self.bodies.len() };
        let body = self.bodies.get_mut(body.0).ok_or(unknown)?;
        body.is_identity = *pose == Pose::IDENTITY;
        body.rotation = rotation_of(pose);
        body.inverse_rotation = body.rotation.transpose();
        body.translation = pose.translation.as_vec3a();
        self.stale = true;
        Ok(())
    }

    /// Adds a mesh in world coordinates as its own shape and body: [`Self::add_shape`] and
    /// [`Self::add_body`].
    ///
    /// # Errors
    /// The mesh has more than 2^27 triangles.
    pub fn add_mesh(&mut self, mesh: &TriMesh, label: u16, appearance: &Appearance) -> Result<(ShapeId, BodyId)> {
        let shape = self.add_shape(mesh)?;
        Ok((shape, self.add_body(shape, &Pose::IDENTITY, label, appearance)?))
    }

    /// Number of triangles of all bodies.
    pub fn triangles(&self) -> usize {
        self.bodies.iter().map(|b| self.shapes[b.shape].triangles.len()).sum()
    }

    /// Updates the lamps.
    pub(crate) fn update_lamps(&mut self) {
        self.lamps.clear();
        self.lamps.extend(self.lights.iter().map(Lamp::new));
    }

    /// Updates the trees over triangles and the tree over bodies. Large bodies enter the tree with many of their
    /// nodes, so that a ray need not descend into every body whose box it crosses (Benthin and
    /// others 2017, "Improved Two-Level BVHs using Partial Re-Braiding").
    pub(crate) fn update_acceleration(&mut self) {
        if !self.stale {
            return;
        }
        for shape in self.shapes.iter_mut().filter(|s| s.tree_stale) {
            Arc::make_mut(&mut shape.tree).refit(&shape.positions, &shape.triangles);
            shape.tree_stale = false;
        }
        self.entries.clear();
        let mut bounds = Vec::new();
        for (index, body) in self.bodies.iter().enumerate() {
            let tree = &self.shapes[body.shape].tree;
            for (entry, held) in tree.entries((tree.leaves() / LEAVES_PER_ENTRY).clamp(1, MAX_ENTRIES_PER_BODY)) {
                self.entries.push((index as u32, entry));
                bounds.push(body.world_bounds(held));
            }
        }
        self.top = BoxTree::over(&bounds);
        self.stale = false;
    }

    /// The prepared lights.
    #[inline]
    pub(crate) fn lamps(&self) -> &[Lamp] {
        &self.lamps
    }

    #[inline]
    pub(crate) fn label(&self, hit: &StageHit) -> u16 {
        self.bodies[hit.body as usize].label
    }

    /// The body that triangle `number` belongs to. `guess` is tried first.
    #[inline]
    pub(crate) fn body_of(&self, number: u32, guess: usize) -> usize {
        let body = &self.bodies[guess];
        let inside = number.checked_sub(body.first_triangle);
        if inside.is_some_and(|n| (n as usize) < self.shapes[body.shape].triangles.len()) {
            return guess;
        }
        self.bodies.partition_point(|b| b.first_triangle <= number).saturating_sub(1)
    }

    #[inline]
    pub(crate) fn label_of(&self, body: usize) -> u16 {
        self.bodies[body].label
    }

    #[inline]
    pub(crate) fn material_of(&self, body: usize) -> &Material {
        &self.bodies[body].material
    }

    /// All bodies as a camera sees them.
    pub(crate) fn bodies_seen_from(&self, view: &View<'_>) -> impl Iterator<Item = BodyView<'_>> {
        let to_camera = view.rotation.transpose();
        let origin = view.origin;
        self.bodies.iter().map(move |body| BodyView {
            clusters: &self.shapes[body.shape].clusters,
            first_triangle: body.first_triangle,
            rotation: to_camera * body.rotation,
            translation: to_camera * (body.translation - origin),
            eye: body.inverse_rotation * (origin - body.translation),
        })
    }

    #[inline]
    pub(crate) fn material(&self, hit: &StageHit) -> &Material {
        &self.bodies[hit.body as usize].material
    }

    /// Material for paths that have bounced before, see [`crate::SurfaceKind`].
    #[inline]
    pub(crate) fn path_material(&self, hit: &StageHit) -> &Material {
        &self.bodies[hit.body as usize].path_material
    }

    /// The surface point that a ray in `direction` hit.
    #[inline]
    pub(crate) fn surface(&self, hit: &StageHit, direction: Vec3A) -> Surface {
        let body = &self.bodies[hit.body as usize];
        let shape = &self.shapes[body.shape];
        let corners = shape.corners(hit.triangle);
        let places = Corners::of(&shape.positions, corners);
        self.surface_at(body, shape, corners, places, [hit.u, hit.v], direction)
    }

    /// The surface point of triangle `number` (among those of all bodies) of a body at parameter
    /// `t` of a ray that meets the triangle.
    #[inline]
    pub(crate) fn surface_along(&self, body: usize, number: u32, origin: Vec3A, direction: Vec3A, t: f32) -> Surface {
        let body = &self.bodies[body];
        let shape = &self.shapes[body.shape];
        let corners = shape.corners(number - body.first_triangle);
        let mut p = origin + t * direction;
        if !body.is_identity {
            p = body.inverse_rotation * (p - body.translation);
        }
        let places = Corners::of(&shape.positions, corners);
        let (x, y, p) = (places.1 - places.0, places.2 - places.0, p - places.0);
        let normal = x.cross(y);
        let share = 1.0 / normal.length_squared().max(f32::MIN_POSITIVE);
        let at = [p.cross(y).dot(normal) * share, x.cross(p).dot(normal) * share];
        self.surface_at(body, shape, corners, places, at, direction)
    }

    /// The surface point at barycentric coordinates of the second and third corner.
    #[inline(always)]
    fn surface_at(
        &self,
        body: &Body,
        shape: &Shape,
        corners: [usize; 3],
        places: Corners,
        at: [f32; 2],
        direction: Vec3A,
    ) -> Surface {
        let mut position = places.mixed(at);
        let mut flat = (places.1 - places.0).cross(places.2 - places.0);
        let mut smooth = Corners::of(&shape.normals, corners).mixed(at);
        if !body.is_identity {
            position = body.rotation * position + body.translation;
            flat = body.rotation * flat;
            smooth = body.rotation * smooth;
        }
        flat = flat.normalize_or_zero();
        if flat.dot(direction) > 0.0 {
            flat = -flat;
        }
        if smooth.dot(flat) < 0.0 {
            smooth = -smooth;
        }
        // An interpolated normal can face away from the eye; the triangle's normal replaces it.
        let smooth = smooth.try_normalize().filter(|n| n.dot(direction) < 0.0).unwrap_or(flat);
        let albedo = if shape.colors.is_empty() { body.color } else { Corners::of(&shape.colors, corners).mixed(at) };
        Surface { position, flat, smooth, albedo }
    }
}

/// A vector at each corner of a triangle.
#[derive(Clone, Copy)]
struct Corners(Vec3A, Vec3A, Vec3A);

impl Corners {
    #[inline(always)]
    fn of(all: &[Vec3A], corners: [usize; 3]) -> Self {
        Self(all[corners[0]], all[corners[1]], all[corners[2]])
    }

    #[inline(always)]
    fn mixed(&self, [u, v]: [f32; 2]) -> Vec3A {
        let Self(a, b, c) = *self;
        a + u * (b - a) + v * (c - a)
    }
}

impl BodyView<'_> {
    /// Points of the shape in the camera frame.
    #[inline(always)]
    pub fn to_camera<S: Simd>(&self, _: S, [x, y, z]: Vec8<S>) -> Vec8<S> {
        let Mat3A { x_axis: a, y_axis: b, z_axis: c } = self.rotation;
        let t = self.translation;
        [
            ((x * a.x + y * b.x) + z * c.x) + t.x,
            ((x * a.y + y * b.y) + z * c.y) + t.y,
            ((x * a.z + y * b.z) + z * c.z) + t.z,
        ]
    }

    /// Whether the eye may be inside the shape.
    pub fn holds_eye(&self) -> bool {
        let Bounds { low, high } = self.clusters.bounds();
        !(self.eye.cmplt(low).any() || self.eye.cmpgt(high).any())
    }
}

impl Body {
    /// The ray in the shape's frame.
    #[inline(always)]
    pub(super) fn local(&self, ray: &Ray) -> Ray {
        if self.is_identity {
            return *ray;
        }
        Ray::new(self.inverse_rotation * (ray.origin - self.translation), self.inverse_rotation * ray.direction)
    }

    /// A box of the shape, in the world frame.
    fn world_bounds(&self, bounds: Bounds) -> Bounds {
        let Bounds { low, high } = bounds;
        if self.is_identity || low.x > high.x {
            return Bounds { low, high };
        }
        let corner = |i: usize| {
            let pick = |k: usize| if i >> k & 1 == 0 { low[k] } else { high[k] };
            self.rotation * Vec3A::new(pick(0), pick(1), pick(2)) + self.translation
        };
        let mut bounds = (0..8).map(corner).fold(Bounds::EMPTY, Bounds::with);
        // The margin covers the rounding error of the rotation.
        let margin = 1e-6 * (bounds.high - bounds.low).max_element();
        bounds.low -= margin;
        bounds.high += margin;
        bounds
    }
}

impl Shape {
    #[inline(always)]
    fn corners(&self, triangle: u32) -> [usize; 3] {
        let [a, b, c] = self.triangles[triangle as usize];
        [a as usize, b as usize, c as usize]
    }

    /// Computes area-weighted vertex normals.
    fn update_normals(&mut self) {
        let normals = Arc::make_mut(&mut self.normals);
        normals.clear();
        normals.resize(self.positions.len(), Vec3A::ZERO);
        for triangle in self.triangles.iter() {
            let [a, b, c] = triangle.map(|v| v as usize);
            if let (Some(p), Some(q), Some(r)) = (self.positions.get(a), self.positions.get(b), self.positions.get(c)) {
                let normal = (*q - *p).cross(*r - *p);
                if normal.is_finite() {
                    for v in [a, b, c] {
                        normals[v] += normal;
                    }
                }
            }
        }
        for normal in normals {
            *normal = normal.normalize_or_zero();
        }
    }
}

/// Rotation of a pose in single precision.
pub(crate) fn rotation_of(pose: &Pose) -> Mat3A {
    let q = pose.rotation.normalize();
    Mat3A::from_quat(Quat::from_xyzw(q.x as f32, q.y as f32, q.z as f32, q.w as f32).normalize())
}
