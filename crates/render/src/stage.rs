//! What is on stage: shapes, some of which deform, and the bodies that show them, each at its pose.

mod rays;

pub(crate) use rays::Ahead;

use crate::light::{Lamp, Light};
use crate::material::{Look, Material};
use crate::tree::{Bounds, Boxes, Ray, Tree};
use crate::{Error, Result, srgb};
use fearless_simd::Level;
use glam::{DVec3, Mat3A, Quat, Vec3A};
use trocar_core::Pose;
use trocar_geometry::TriMesh;

/// Triangles beyond which a mesh is refused.
const MOST_TRIANGLES: usize = 1 << 27;

/// A body enters the tree over all bodies by one node for so many leaves of its own.
const LEAVES_AN_ENTRY: usize = 32;
/// But by no more than this.
const MOST_ENTRIES: usize = 64;

/// A shape of a [`Stage`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShapeId(usize);

/// A body of a [`Stage`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BodyId(usize);

/// Shapes, bodies and lights, to be rendered through any number of cameras (see [`crate::Settings`]).
///
/// A *shape* is a surface with its search tree; [`Stage::deform`] refits it. A *body* is a shape at a pose with a look and a
/// label; many bodies may show one shape. Positions are metres in one world frame.
#[derive(Clone, Debug)]
pub struct Stage {
    shapes: Vec<Shape>,
    bodies: Vec<Body>,
    top: Boxes,
    /// Body and node of its shape's tree, by leaf of the tree over the bodies.
    entries: Vec<(u32, u32)>,
    lamps: Vec<Lamp>,
    stale: bool,
    level: Level,
    /// Lights, in the world's frame.
    pub lights: Vec<Light>,
    /// Linear radiance that comes from everywhere else.
    pub environment: [f32; 3],
}

#[derive(Clone, Debug)]
struct Shape {
    tree: Tree,
    positions: Vec<Vec3A>,
    triangles: Vec<[u32; 3]>,
    normals: Vec<Vec3A>,
    /// Linear colour per vertex; empty where the mesh has none.
    colors: Vec<Vec3A>,
}

#[derive(Clone, Debug)]
struct Body {
    shape: usize,
    label: u16,
    material: Material,
    /// The same for light that paths carry here after a bounce.
    blunt: Material,
    /// Linear colour where the shape has none.
    color: Vec3A,
    /// The world is the shape's own frame.
    still: bool,
    rotation: Mat3A,
    /// The other way.
    back: Mat3A,
    translation: Vec3A,
}

/// What [`Stage::cast`] found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// The body.
    pub body: BodyId,
    /// Index among its shape's triangles.
    pub triangle: u32,
}

/// Where a ray first meets the stage.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touch {
    /// In units of the ray's direction.
    pub t: f32,
    pub body: u32,
    triangle: u32,
    u: f32,
    v: f32,
}

/// The surface at a place, in the world's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    pub position: Vec3A,
    /// Unit normal of the triangle, towards where the ray came from.
    pub flat: Vec3A,
    /// Unit normal between those of the corners, on the same side.
    pub smooth: Vec3A,
    /// Linear.
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
            top: Boxes::default(),
            entries: Vec::new(),
            lamps: Vec::new(),
            stale: true,
            level: Level::new(),
            lights: Vec::new(),
            environment: [0.0; 3],
        }
    }

    /// Adds a surface. Triangles with a missing or non-finite vertex are not seen; normals are smooth across vertices that
    /// triangles share.
    ///
    /// # Errors
    /// A mesh of more than 2^27 triangles.
    pub fn add_shape(&mut self, mesh: &TriMesh) -> Result<ShapeId> {
        if mesh.triangles.len() > MOST_TRIANGLES {
            return Err(Error::TooLarge(mesh.triangles.len()));
        }
        let positions: Vec<Vec3A> = mesh.vertices.iter().map(|p| p.as_vec3a()).collect();
        let tree = Tree::new(&positions, &mesh.triangles);
        let colored = mesh.colors.len() == mesh.vertices.len();
        let colors =
            if colored { mesh.colors.iter().map(|c| srgb::to_linear(*c).into()).collect() } else { Vec::new() };
        let mut shape = Shape { tree, positions, triangles: mesh.triangles.clone(), normals: Vec::new(), colors };
        shape.update_normals();
        self.shapes.push(shape);
        Ok(ShapeId(self.shapes.len() - 1))
    }

    /// Moves a shape's vertices to `positions` [m]; its tree is refitted, not built anew.
    ///
    /// # Errors
    /// An unknown shape, or another number of positions than it has vertices.
    pub fn deform(&mut self, shape: ShapeId, positions: &[DVec3]) -> Result<()> {
        let count = self.shapes.len();
        let unknown = Error::Unknown { what: "shape", index: shape.0, count };
        let found = self.shapes.get_mut(shape.0).ok_or(unknown)?;
        if positions.len() != found.positions.len() {
            let (has, given) = (found.positions.len(), positions.len());
            return Err(Error::Vertices { shape: shape.0, has, given });
        }
        for (to, from) in found.positions.iter_mut().zip(positions) {
            *to = from.as_vec3a();
        }
        found.tree.refit(&found.positions, &found.triangles);
        found.update_normals();
        self.stale = true;
        Ok(())
    }

    /// Shows `shape` at `pose` (from its own frame to the world's). `label` is what label images say of it; 0 is nothing.
    ///
    /// # Errors
    /// An unknown shape.
    pub fn add_body(&mut self, shape: ShapeId, pose: &Pose, label: u16, look: &Look) -> Result<BodyId> {
        if shape.0 >= self.shapes.len() {
            return Err(Error::Unknown { what: "shape", index: shape.0, count: self.shapes.len() });
        }
        self.bodies.push(Body {
            shape: shape.0,
            label,
            blunt: Material::new(&look.surface.blunt()),
            material: Material::new(&look.surface),
            color: srgb::to_linear(look.color).into(),
            still: true,
            rotation: Mat3A::IDENTITY,
            back: Mat3A::IDENTITY,
            translation: Vec3A::ZERO,
        });
        let id = BodyId(self.bodies.len() - 1);
        self.place(id, pose)?;
        Ok(id)
    }

    /// Moves a body.
    ///
    /// # Errors
    /// An unknown body.
    pub fn place(&mut self, body: BodyId, pose: &Pose) -> Result<()> {
        let unknown = Error::Unknown { what: "body", index: body.0, count: self.bodies.len() };
        let body = self.bodies.get_mut(body.0).ok_or(unknown)?;
        body.still = *pose == Pose::IDENTITY;
        body.rotation = rotation_of(pose);
        body.back = body.rotation.transpose();
        body.translation = pose.translation.as_vec3a();
        self.stale = true;
        Ok(())
    }

    /// Adds a mesh as a shape of its own in the world's frame: [`Self::add_shape`] and [`Self::add_body`].
    ///
    /// # Errors
    /// A mesh that is too large.
    pub fn add_mesh(&mut self, mesh: &TriMesh, label: u16, look: &Look) -> Result<(ShapeId, BodyId)> {
        let shape = self.add_shape(mesh)?;
        Ok((shape, self.add_body(shape, &Pose::IDENTITY, label, look)?))
    }

    /// Number of triangles over all bodies.
    pub fn triangles(&self) -> usize {
        self.bodies.iter().map(|b| self.shapes[b.shape].triangles.len()).sum()
    }

    /// Brings lamps and the tree over the bodies up to date. Large bodies enter it by many of their nodes, so that rays need not
    /// go down into every body whose box they cross (Benthin and others 2017, "Improved Two-Level BVHs using Partial Re-Braiding").
    pub(crate) fn settle(&mut self) {
        self.lamps = self.lights.iter().map(Lamp::new).collect();
        if !self.stale {
            return;
        }
        self.entries.clear();
        let mut bounds = Vec::new();
        for (index, body) in self.bodies.iter().enumerate() {
            let tree = &self.shapes[body.shape].tree;
            for (entry, held) in tree.entries((tree.leaves() / LEAVES_AN_ENTRY).clamp(1, MOST_ENTRIES)) {
                self.entries.push((index as u32, entry));
                bounds.push(body.bounds(held));
            }
        }
        self.top = Boxes::over(&bounds);
        self.stale = false;
    }

    /// The lights, prepared.
    #[inline]
    pub(crate) fn lamps(&self) -> &[Lamp] {
        &self.lamps
    }

    #[inline]
    pub(crate) fn label(&self, touch: &Touch) -> u16 {
        self.bodies[touch.body as usize].label
    }

    #[inline]
    pub(crate) fn material(&self, touch: &Touch) -> &Material {
        &self.bodies[touch.body as usize].material
    }

    /// The material for paths that have bounced before, see [`crate::SurfaceKind`].
    #[inline]
    pub(crate) fn blunt(&self, touch: &Touch) -> &Material {
        &self.bodies[touch.body as usize].blunt
    }

    /// The surface that a ray in `direction` met.
    #[inline]
    pub(crate) fn surface(&self, touch: &Touch, direction: Vec3A) -> Surface {
        let body = &self.bodies[touch.body as usize];
        let shape = &self.shapes[body.shape];
        let corners = shape.triangles[touch.triangle as usize].map(|v| v as usize);
        let (u, v) = (touch.u, touch.v);
        let mixed = |of: &[Vec3A]| {
            let [a, b, c] = corners.map(|i| of[i]);
            a + u * (b - a) + v * (c - a)
        };
        let [a, b, c] = corners.map(|i| shape.positions[i]);
        let mut position = a + u * (b - a) + v * (c - a);
        let mut flat = (b - a).cross(c - a);
        let mut smooth = mixed(&shape.normals);
        if !body.still {
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
        // Between normals there are places that turn away from the eye; these have the triangle's.
        let smooth = smooth.try_normalize().filter(|n| n.dot(direction) < 0.0).unwrap_or(flat);
        let albedo = if shape.colors.is_empty() { body.color } else { mixed(&shape.colors) };
        Surface { position, flat, smooth, albedo }
    }
}

impl Body {
    /// The ray in the shape's frame.
    #[inline(always)]
    fn local(&self, ray: &Ray) -> Ray {
        if self.still {
            return *ray;
        }
        Ray::new(self.back * (ray.origin - self.translation), self.back * ray.direction)
    }

    /// A box of the shape in the world's frame.
    fn bounds(&self, held: Bounds) -> Bounds {
        let Bounds { low, high } = held;
        if self.still || low.x > high.x {
            return Bounds { low, high };
        }
        let corner = |i: usize| {
            let pick = |k: usize| if i >> k & 1 == 0 { low[k] } else { high[k] };
            self.rotation * Vec3A::new(pick(0), pick(1), pick(2)) + self.translation
        };
        let mut bounds = (0..8).map(corner).fold(Bounds::EMPTY, Bounds::with);
        // The turn rounds.
        let margin = 1e-6 * (bounds.high - bounds.low).max_element();
        bounds.low -= margin;
        bounds.high += margin;
        bounds
    }
}

impl Shape {
    /// Area-weighted normals of the vertices.
    fn update_normals(&mut self) {
        self.normals.clear();
        self.normals.resize(self.positions.len(), Vec3A::ZERO);
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|v| v as usize);
            if let (Some(p), Some(q), Some(r)) = (self.positions.get(a), self.positions.get(b), self.positions.get(c)) {
                let normal = (*q - *p).cross(*r - *p);
                if normal.is_finite() {
                    for v in [a, b, c] {
                        self.normals[v] += normal;
                    }
                }
            }
        }
        for normal in &mut self.normals {
            *normal = normal.normalize_or_zero();
        }
    }
}

/// The rotation of a pose in single precision.
pub(crate) fn rotation_of(pose: &Pose) -> Mat3A {
    let q = pose.rotation.normalize();
    Mat3A::from_quat(Quat::from_xyzw(q.x as f32, q.y as f32, q.z as f32, q.w as f32).normalize())
}
