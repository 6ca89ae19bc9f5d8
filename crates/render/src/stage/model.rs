//! A stage: shapes, some of which deform, and the bodies that show them at a pose.

use super::vertex::{Vertex, vector};
use crate::background::Memory;
use crate::bvh::{Bounds, BoxTree, Ray, TriangleTree};
use crate::lanes::Vec8;
use crate::light::{Lamp, Light};
use crate::material::{Appearance, Material};
use crate::raster::{Clusters, View};
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
    /// Number of changes of shapes and bodies so far.
    changes: u64,
    /// Memory for previews.
    pub(crate) memory: Memory,
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
    /// Number of its last change.
    change: u64,
    clusters: Clusters,
    positions: Arc<Vec<Vec3A>>,
    triangles: Arc<Vec<[u32; 3]>>,
    pub(super) vertices: Arc<Vec<Vertex>>,
    /// Whether the vertices have colours.
    pub(super) is_colored: bool,
}

#[derive(Clone, Debug)]
pub(super) struct Body {
    pub(super) shape: usize,
    /// Number of its last change of pose.
    change: u64,
    label: u16,
    /// Number of its first triangle among those of all bodies.
    pub(super) first_triangle: u32,
    material: Arc<Material>,
    /// Material for paths that have bounced before.
    path_material: Arc<Material>,
    /// Linear colour, used if the shape has none.
    pub(super) color: Vec3A,
    /// Whether the pose is the identity.
    pub(super) is_identity: bool,
    pub(super) rotation: Mat3A,
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
            changes: 0,
            memory: Memory::default(),
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
        let is_colored = mesh.colors.len() == mesh.vertices.len();
        let mut vertices = vec![Vertex::default(); positions.len()];
        if is_colored {
            for (vertex, color) in vertices.iter_mut().zip(&mesh.colors) {
                let [r, g, b] = srgb::to_linear(*color);
                vertex.color = [r, g, b, 0.0];
            }
        }
        let mut shape = Shape {
            clusters: Clusters::new(mesh, &positions, tree.order()),
            tree: Arc::new(tree),
            tree_stale: false,
            change: 0,
            positions: Arc::new(positions),
            triangles: Arc::new(mesh.triangles.clone()),
            vertices: Arc::new(vertices),
            is_colored,
        };
        shape.update_vertices();
        self.shapes.push(shape);
        Ok(ShapeId(self.shapes.len() - 1))
    }

    /// Moves the vertices of a shape to `positions` (m). The next picture that casts rays refits
    /// the search tree; it is not rebuilt.
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
        found.update_vertices();
        self.changes += 1;
        found.change = self.changes;
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
            change: 0,
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
        self.stale = true;
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
        let (rotation, translation) = (rotation_of(pose), pose.translation.as_vec3a());
        let is_identity = *pose == Pose::IDENTITY;
        if (rotation, translation, is_identity) == (body.rotation, body.translation, body.is_identity) {
            return Ok(());
        }
        (body.rotation, body.translation, body.is_identity) = (rotation, translation, is_identity);
        body.inverse_rotation = rotation.transpose();
        self.changes += 1;
        body.change = self.changes;
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

    /// Frees what is kept of earlier previews, see [`crate::render_into`]. The next ones are made
    /// from nothing and are the same.
    pub fn forget_pictures(&mut self) {
        self.memory = Memory::default();
    }

    /// Updates the lamps.
    pub(crate) fn update_lamps(&mut self) {
        self.lamps.clear();
        self.lamps.extend(self.lights.iter().map(Lamp::new));
    }

    /// Updates the trees over triangles and the tree over bodies. Large bodies enter the tree with
    /// many of their nodes, so that a ray need not descend into every body whose box it crosses
    /// (Benthin and others 2017, "Improved Two-Level BVHs using Partial Re-Braiding").
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

    /// The body that triangle `number` belongs to, and the numbers of its triangles.
    pub(crate) fn body_of(&self, number: u32) -> (usize, std::ops::Range<u32>) {
        let index = self.bodies.partition_point(|b| b.first_triangle <= number).saturating_sub(1);
        let body = &self.bodies[index];
        (index, body.first_triangle..body.first_triangle + self.shapes[body.shape].triangles.len() as u32)
    }

    #[inline]
    pub(crate) fn label_of(&self, body: usize) -> u16 {
        self.bodies[body].label
    }

    #[inline]
    pub(crate) fn material_of(&self, body: usize) -> &Material {
        &self.bodies[body].material
    }

    /// For each body the number of its last change: different numbers, other places.
    pub(crate) fn changes(&self) -> impl Iterator<Item = u64> {
        self.bodies.iter().map(|b| b.change.max(self.shapes[b.shape].change))
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
    pub(super) fn corners(&self, triangle: u32) -> [usize; 3] {
        let [a, b, c] = self.triangles[triangle as usize];
        [a as usize, b as usize, c as usize]
    }

    /// Positions of the vertices and their area-weighted normals.
    fn update_vertices(&mut self) {
        let vertices = Arc::make_mut(&mut self.vertices);
        for (vertex, p) in vertices.iter_mut().zip(self.positions.iter()) {
            vertex.position = [p.x, p.y, p.z, 0.0];
            vertex.normal = [0.0; 4];
        }
        for [a, b, c] in self.triangles.iter() {
            let (a, b, c) = (*a as usize, *b as usize, *c as usize);
            if let (Some(p), Some(q), Some(r)) = (self.positions.get(a), self.positions.get(b), self.positions.get(c)) {
                let normal = (*q - *p).cross(*r - *p);
                if normal.is_finite() {
                    for v in [a, b, c] {
                        let sum = vector(&vertices[v].normal) + normal;
                        vertices[v].normal = [sum.x, sum.y, sum.z, 0.0];
                    }
                }
            }
        }
        for vertex in vertices {
            let normal = vector(&vertex.normal).normalize_or_zero();
            vertex.normal = [normal.x, normal.y, normal.z, 0.0];
        }
    }
}

/// Rotation of a pose in single precision.
pub(crate) fn rotation_of(pose: &Pose) -> Mat3A {
    let q = pose.rotation.normalize();
    Mat3A::from_quat(Quat::from_xyzw(q.x as f32, q.y as f32, q.z as f32, q.w as f32).normalize())
}
