//! A body: a lattice with a material and pins.

use crate::element::Element;
use crate::{EmbeddedPoint, Error, Lattice, Material, Result};
use glam::DVec3;

/// Stiffness of the spring of a pin, over Young's modulus times the edge of a cell.
const PIN_STIFFNESS: f64 = 100.0;

/// One body to make.
#[derive(Clone, Debug)]
pub struct BodyDescription {
    /// Name, for messages.
    pub name: String,
    /// Its lattice.
    pub lattice: Lattice,
    /// Material.
    pub material: Material,
    /// Points that stay where they rest, as [`Lattice::embed_held`] makes of nodes of the mesh.
    /// Each is held by a spring of 100 times Young's modulus times the edge of a cell. A cell of
    /// which a part of the volume is held is held as a whole: a held end grows by up to a cell.
    pub pins: Vec<EmbeddedPoint>,
    /// Nodes of the lattice that never move.
    pub fixed: Vec<u32>,
}

/// A deformable body. Immutable; what moves is its [`BodyState`].
#[derive(Clone, Debug)]
pub struct Body {
    name: String,
    lattice: Lattice,
    material: Material,
    masses: Vec<f64>,
    pins: Vec<Spring>,
    fixed: Vec<bool>,
}

/// A spring between a point of a body and a point in space: a pin, a grasp, a support.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// The point of the body.
    pub point: EmbeddedPoint,
    /// Where it is drawn to (m).
    pub target: DVec3,
    /// Stiffness (N/m).
    pub stiffness: f64,
}

/// A force on a point of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLoad {
    /// The point of the body.
    pub point: EmbeddedPoint,
    /// The force (N).
    pub force: DVec3,
}

/// The loads on a body from outside.
#[derive(Clone, Copy, Debug, Default)]
pub struct Conditions<'a> {
    /// Gravitational acceleration (m/s2).
    pub gravity: DVec3,
    /// Springs, in addition to the body's pins.
    pub springs: &'a [Spring],
    /// Forces.
    pub loads: &'a [PointLoad],
}

impl Conditions<'_> {
    /// Gravity (m/s2) alone.
    pub fn gravity(gravity: DVec3) -> Self {
        Self { gravity, ..Self::default() }
    }
}

impl Body {
    /// Makes a body.
    ///
    /// # Errors
    /// [`Error::Body`] for a material out of range, and pins and fixed nodes that are not of this
    /// lattice.
    pub fn new(description: BodyDescription) -> Result<Self> {
        let BodyDescription { name, lattice, material, pins, fixed: fixed_nodes } = description;
        let refused = |reason: String| Error::Body { body: name.clone(), reason };
        material.check().map_err(refused)?;
        let count = lattice.nodes().len();
        let mut fixed = vec![false; count];
        for node in fixed_nodes {
            let Some(fixed) = fixed.get_mut(node as usize) else {
                return Err(refused(format!("fixed node {node} does not exist; there are {count} nodes")));
            };
            *fixed = true;
        }
        if let Some(i) = pins.iter().position(|point| !belongs(point, &lattice)) {
            return Err(refused(format!("pin {i} is not embedded in this body's lattice; embed it there")));
        }
        let stiffness = PIN_STIFFNESS * material.young_modulus * lattice.cell();
        let pin = |point: EmbeddedPoint| Spring { point, target: point.interpolate(lattice.nodes()), stiffness };
        let pins = pins.into_iter().map(pin).collect();
        let masses = lattice.shares().iter().map(|share| material.density * share).collect();
        Ok(Self { name, material, masses, pins, fixed, lattice })
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its lattice.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Its material.
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Mass of each node (kg). They sum to the mass of the material.
    pub fn masses(&self) -> &[f64] {
        &self.masses
    }

    /// The springs of its pins.
    pub fn pins(&self) -> &[Spring] {
        &self.pins
    }

    /// Which nodes never move.
    pub fn fixed(&self) -> &[bool] {
        &self.fixed
    }

    /// Least ratio of deformed to rest volume at the integration points, at these positions (m);
    /// below 0 where tissue is inverted.
    pub fn least_volume_ratio(&self, positions: &[DVec3]) -> f64 {
        self.volume_ratios(positions).fold(f64::INFINITY, f64::min)
    }

    /// The least ratio of each hexahedron.
    pub fn volume_ratios(&self, positions: &[DVec3]) -> impl Iterator<Item = f64> {
        let ratio = |hex| self.element(hex).least_volume_ratio(&self.corners(hex, positions));
        (0..self.lattice.hexahedra().len()).map(ratio)
    }

    pub(crate) fn element(&self, hex: usize) -> Element<'_> {
        let fill = self.lattice.options().fill;
        Element { hex: &self.lattice.hexahedra()[hex], cell: self.lattice.cell(), fill, material: &self.material }
    }

    pub(crate) fn corners(&self, hex: usize, positions: &[DVec3]) -> [DVec3; 8] {
        self.lattice.hexahedra()[hex].nodes.map(|node| positions[node as usize])
    }

    /// Refuses conditions that do not fit.
    pub(crate) fn check(&self, conditions: &Conditions<'_>) -> Result<()> {
        let refused = |reason: String| Err(Error::Body { body: self.name.clone(), reason });
        if !conditions.gravity.is_finite() {
            return refused(format!("gravity is {} m/s2; must be finite", conditions.gravity));
        }
        for (i, spring) in conditions.springs.iter().enumerate() {
            let sound = spring.target.is_finite() && (0.0..f64::INFINITY).contains(&spring.stiffness);
            if !(sound && belongs(&spring.point, &self.lattice)) {
                return refused(format!(
                    "spring {i} must be embedded in this body's lattice, with a finite target and a stiffness of 0 or \
                     more"
                ));
            }
        }
        if let Some(i) =
            conditions.loads.iter().position(|load| !(load.force.is_finite() && belongs(&load.point, &self.lattice)))
        {
            return refused(format!("load {i} must be embedded in this body's lattice, with a finite force"));
        }
        Ok(())
    }
}

fn belongs(point: &EmbeddedPoint, lattice: &Lattice) -> bool {
    let hex = lattice.hexahedra().get(point.hexahedron as usize);
    hex.is_some_and(|hex| hex.nodes == point.nodes) && point.weights.iter().all(|w| w.is_finite())
}

/// The changing part of a body: plain data that can be copied, compared and restored exactly.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyState {
    /// Positions of the nodes (m).
    pub positions: Vec<DVec3>,
    /// Velocities of the nodes (m/s).
    pub velocities: Vec<DVec3>,
}

impl BodyState {
    /// A body at rest.
    pub fn new(body: &Body) -> Self {
        let positions = body.lattice.nodes().to_vec();
        Self { velocities: vec![DVec3::ZERO; positions.len()], positions }
    }

    /// Refuses a state of another body, or with numbers that are not finite.
    pub(crate) fn check(&self, body: &Body) -> Result<()> {
        let count = body.masses.len();
        if self.positions.len() != count || self.velocities.len() != count {
            let (x, v) = (self.positions.len(), self.velocities.len());
            return Err(Error::Invalid(format!(
                "the state has {x} positions and {v} velocities; body '{}' has {count} nodes",
                body.name
            )));
        }
        if !self.positions.iter().chain(&self.velocities).all(|p| p.is_finite()) {
            return Err(Error::Invalid(format!("the state of body '{}' is not finite", body.name)));
        }
        Ok(())
    }
}
