//! Builds models. Every error of a model is found here.

mod check;
mod collision;
mod embed;
mod lay_out;

use crate::{Backend, Body, BodyContact, Collider, Error, Material, Model, Result, Support, Tether, ToolContact};
pub(crate) use embed::embed;
use glam::DVec3;
pub(crate) use lay_out::{Inherited, NodeMasses, lay_out};
use trocar_geometry::{TetMesh, TriMesh};

/// One body to add.
#[derive(Clone, Debug)]
pub struct BodyDescription<'a> {
    /// Name, for messages.
    pub name: String,
    /// Rest shape (m).
    pub mesh: &'a TetMesh,
    /// Material.
    pub material: Material,
    /// Nodes that never move.
    pub pinned: Vec<u32>,
    /// Surfaces that it rests on.
    pub supports: Vec<Support>,
}

/// The mass below which a node's mass is raised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MassFloor {
    /// Masses stay the same.
    None,
    /// This share (0..=1) of the body's median mass.
    MedianShare(f64),
}

impl Default for MassFloor {
    /// A quarter of the median.
    fn default() -> Self {
        Self::MedianShare(0.25)
    }
}

/// Stiffness of contacts against a vertex, over Young's modulus times the vertex's size (the cube
/// root of its share of the volume).
const CONTACT_STIFFNESS: f64 = 20.0;

/// Greatest such factor: stiffer contacts exceed `f32`.
const MAX_CONTACT_STIFFNESS: f64 = 1e5;

/// Collects bodies and boundary conditions.
///
/// ```
/// use glam::DVec3;
/// use trocar_geometry::TetMesh;
/// use trocar_tissue::{BodyDescription, ConstitutiveModel, Material, ModelBuilder};
///
/// let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
/// let mesh = &TetMesh { vertices: corners.map(|p| 0.01 * p).to_vec(), tets: vec![[0, 1, 2, 3]] };
/// let model = ConstitutiveModel::StableNeoHookean;
/// let material = Material { model, young_modulus: 5e3, poisson_ratio: 0.45, density: 1050.0, viscosity: 5.0 };
/// let mut builder = ModelBuilder::new().gravity(DVec3::Z * -9.81);
/// builder.body(BodyDescription { name: "organ".to_owned(), mesh, material, pinned: vec![0], supports: vec![] })?;
/// let model = builder.build()?;
/// assert_eq!(model.bodies()[0].len(), 4, "four nodes");
/// # Ok::<(), trocar_tissue::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct ModelBuilder {
    bodies: Vec<Body>,
    gravity: DVec3,
    mass_floor: MassFloor,
    point_masses: Vec<(u32, f64)>,
    contact_stiffness: f64,
    filtered: Vec<[usize; 2]>,
    colliders: Vec<Collider>,
    body_contact: Option<BodyContact>,
    tool_contact: ToolContact,
    backend: Backend,
}

impl Default for ModelBuilder {
    fn default() -> Self {
        Self::new()
    }
}

impl ModelBuilder {
    /// No bodies, no gravity, no support.
    pub fn new() -> Self {
        Self {
            bodies: Vec::new(),
            gravity: DVec3::ZERO,
            mass_floor: MassFloor::default(),
            point_masses: Vec::new(),
            contact_stiffness: CONTACT_STIFFNESS,
            filtered: Vec::new(),
            colliders: Vec::new(),
            body_contact: None,
            tool_contact: ToolContact::default(),
            backend: Backend::default(),
        }
    }

    /// Sets the gravitational acceleration (m/s2).
    pub fn gravity(mut self, gravity: DVec3) -> Self {
        self.gravity = gravity;
        self
    }

    /// Sets the mass floor of the bodies that are added after this; [`MassFloor::default`]
    /// otherwise.
    pub fn mass_floor(mut self, floor: MassFloor) -> Self {
        self.mass_floor = floor;
        self
    }

    /// Hangs masses (kg) on nodes of the bodies that are added after this; none otherwise. They
    /// fall and swing with the node. Tetrahedra only.
    pub fn point_masses(mut self, masses: &[(u32, f64)]) -> Self {
        self.point_masses = masses.to_vec();
        self
    }

    /// Sets the stiffness of contacts against the nodes of the bodies that are added after this,
    /// over Young's modulus times a node's size (the cube root of its share of the volume); 20
    /// otherwise. A contact yields by the pressure over this stiffness.
    pub fn contact_stiffness(mut self, over_tissue: f64) -> Self {
        self.contact_stiffness = over_tissue;
        self
    }

    /// Sets the model of the tissue of all bodies; [`Backend::Tetrahedra`] otherwise. To be called
    /// before bodies are added.
    pub fn backend(mut self, backend: Backend) -> Self {
        self.backend = backend;
        self
    }

    /// Adds a body; returns its index.
    ///
    /// # Errors
    /// The error names the body and the element, node or parameter. Refused are: zero or negative
    /// volumes, elements that are flat beside their edges, isolated nodes, numbers that are not
    /// finite, extents outside 1 mm to 2 m, moduli outside 1 Pa to 1 GPa, Poisson ratios outside 0
    /// to 0.4999, densities outside 1 to 30,000 kg/m3, negative viscosities, pins out of range or
    /// named twice, invalid supports, mass floors outside 0 to 1, and point masses of nodes that
    /// there are not, outside 0 to 100 kg, or on a lattice.
    pub fn body(&mut self, body: BodyDescription<'_>) -> Result<usize> {
        check::check(&body).map_err(|reason| Error::Body { body: body.name.clone(), reason })?;
        if let MassFloor::MedianShare(share) = self.mass_floor
            && !(0.0..=1.0).contains(&share)
        {
            return Err(Error::Model(format!("a mass floor of {share} of the median; must be in [0, 1]")));
        }
        if !(self.contact_stiffness > 0.0 && self.contact_stiffness <= MAX_CONTACT_STIFFNESS) {
            return Err(Error::Model(format!(
                "a contact stiffness of {} times the tissue's; must be in (0, {MAX_CONTACT_STIFFNESS}]",
                self.contact_stiffness
            )));
        }
        let nodes = body.mesh.vertices.len();
        let wrong = |(node, kg): &&(u32, f64)| *node as usize >= nodes || !(0.0..=100.0).contains(kg);
        if let Some((node, kg)) = self.point_masses.iter().find(wrong) {
            let reason = format!("a mass of {kg} kg on node {node}; must be in [0, 100] kg, on one of {nodes} nodes");
            return Err(Error::Body { body: body.name, reason });
        }
        if !self.point_masses.is_empty() && self.backend != Backend::Tetrahedra {
            let reason = "masses on nodes are for tetrahedra".to_owned();
            return Err(Error::Body { body: body.name, reason });
        }
        let masses = NodeMasses::Lumped { floor: self.mass_floor, added: &self.point_masses };
        let mut body = lay_out(body, self.contact_stiffness, masses);
        if let Backend::Lattice(settings) = self.backend {
            body.lattice = embed(&body, settings)?;
        }
        self.bodies.push(body);
        Ok(self.bodies.len() - 1)
    }

    /// Adds threads that hold nodes of the body at `index`. [`crate::Batch`] ignores them, and so
    /// may integrators from outside this crate ([`crate::Integrator`]).
    ///
    /// # Errors
    /// The error names the body and the node. Refused are bodies that have not been added, nodes
    /// that are pinned or not on the surface, and lengths and stiffnesses out of range.
    pub fn tethers(&mut self, index: usize, tethers: &[Tether]) -> Result<()> {
        let bodies = self.bodies.len();
        let Some(body) = self.bodies.get_mut(index) else {
            return Err(Error::Model(format!("threads are to hold body {index}; there are {bodies} so far")));
        };
        let surface = body.surface_vertices();
        for tether in tethers {
            let vertex = body.internal.get(tether.node as usize);
            let reason = match vertex {
                Some(vertex) if surface.binary_search(vertex).is_ok() => tether.check().err(),
                _ => Some(format!("a thread holds node {}; it must be a free node of the surface", tether.node)),
            };
            if let Some(reason) = reason {
                return Err(Error::Body { body: body.name.clone(), reason });
            }
        }
        if !tethers.is_empty() {
            body.tethers.extend_from_slice(tethers);
        }
        Ok(())
    }

    /// Lets the body at `index` touch tools and other bodies with `surface` (m) in the place of the
    /// boundary of its elements. It is bound to the elements as it lies in the rest shape.
    /// Supports, threads and grasps still act on nodes. Stiffness is by area that of the boundary,
    /// so a force does not depend on how fine the surface is. A cut body touches with its boundary
    /// ([`crate::sever`]).
    ///
    /// # Errors
    /// The error names the body. Refused are bodies that have not been added, and surfaces without
    /// triangles, with numbers that are not finite or vertices that there are not, that are open,
    /// face inward, enclose less than half or more than twice the volume of the elements, or have a
    /// vertex farther from the elements than the body's median edge.
    pub fn collision_surface(&mut self, index: usize, surface: &TriMesh) -> Result<()> {
        let bodies = self.bodies.len();
        let Some(body) = self.bodies.get_mut(index) else {
            return Err(Error::Model(format!(
                "body {index} is to have a collision surface; there are {bodies} so far"
            )));
        };
        collision::bind(body, surface).map_err(|reason| Error::Body {
            body: body.name.clone(),
            reason: format!("its collision surface {reason}"),
        })
    }

    /// Makes the bodies touch each other, except for filtered pairs. Without it they pass through
    /// each other. Integrators from outside this crate ([`crate::Integrator`]) ignore it.
    pub fn body_contact(mut self, contact: BodyContact) -> Self {
        self.body_contact = Some(contact);
        self
    }

    /// Sets what of the bodies' surfaces touches tools; [`ToolContact::Vertices`] otherwise.
    pub fn tool_contact(mut self, contact: ToolContact) -> Self {
        self.tool_contact = contact;
        self
    }

    /// Excludes the pair of bodies `a` and `b` from contact. If `a` is `b`, the body does not touch
    /// itself.
    ///
    /// # Errors
    /// Refuses bodies that have not been added.
    pub fn filter_pair(&mut self, a: usize, b: usize) -> Result<()> {
        let bodies = self.bodies.len();
        if a.max(b) >= bodies {
            return Err(Error::Model(format!("bodies {a} and {b} are not to collide; there are {bodies} so far")));
        }
        let pair = [a.min(b), a.max(b)];
        if let Err(at) = self.filtered.binary_search(&pair) {
            self.filtered.insert(at, pair);
        }
        Ok(())
    }

    /// Adds a part of a tool that no body may enter; returns its index.
    ///
    /// # Errors
    /// The error names the collider. Refused are: shapes without extent or with numbers that are
    /// not finite, friction below 0, and rest offsets outside 0 to 10 mm.
    pub fn collider(&mut self, collider: Collider) -> Result<usize> {
        collider.check().map_err(|reason| Error::Model(format!("collider '{}': {reason}", collider.name)))?;
        self.colliders.push(collider);
        Ok(self.colliders.len() - 1)
    }

    /// Finishes the model.
    ///
    /// # Errors
    /// Refused are: a model without bodies, gravity that is not finite or above 100 m/s2, and a
    /// contact between bodies with numbers out of range.
    pub fn build(self) -> Result<Model> {
        if self.bodies.is_empty() {
            return Err(Error::Model("a model needs a body".to_owned()));
        }
        if !(self.gravity.is_finite() && self.gravity.length() <= 100.0) {
            return Err(Error::Model(format!(
                "gravity is {} m/s2; must be finite and at most 100 m/s2 (the earth's is 9.8)",
                self.gravity
            )));
        }
        if let Some(contact) = &self.body_contact {
            contact.check().map_err(|reason| Error::Model(format!("contact between bodies: {reason}")))?;
        }
        Ok(Model {
            bodies: self.bodies,
            gravity: self.gravity,
            filtered: self.filtered,
            colliders: self.colliders,
            body_contact: self.body_contact,
            tool_contact: self.tool_contact,
            backend: self.backend,
        })
    }
}
