//! Builds models; everything that can be wrong is found here.

use crate::body::{Corner, Edge, Vertex};
use crate::coloring::color;
use crate::elements::Elements;
use crate::groups::Groups;
use crate::strip::{Push, strip};
use crate::{Body, ConstitutiveModel, Error, Material, Model, Result, StableNeoHookean, SupportPlane};
use glam::{DVec3, Vec3A};
use trocar_geometry::{TetMesh, TetQuality};

/// One body to add.
#[derive(Clone, Debug)]
pub struct BodyDescription<'a> {
    /// Name, for messages.
    pub name: String,
    /// Rest shape [m].
    pub mesh: &'a TetMesh,
    /// Material.
    pub material: Material,
    /// Nodes that never move.
    pub pinned: Vec<u32>,
    /// Planes that support it.
    pub supports: Vec<SupportPlane>,
}

/// Share of the median mass below which a node's mass is raised (SPEC T5).
const MASS_FLOOR: f64 = 0.25;

/// Stiffness of a support against a vertex, over Young's modulus times the vertex's size (the cube root of its share of the volume).
const CONTACT_STIFFNESS: f64 = 20.0;

/// Collects bodies and boundary conditions.
#[derive(Clone, Debug, Default)]
pub struct ModelBuilder {
    bodies: Vec<Body>,
    gravity: DVec3,
}

impl ModelBuilder {
    /// No bodies, no gravity, no support.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the gravitational acceleration [m/s2].
    pub fn gravity(mut self, gravity: DVec3) -> Self {
        self.gravity = gravity;
        self
    }

    /// Adds a body; returns its index.
    ///
    /// # Errors
    /// Refuses, naming the body and the element, node or parameter: zero or negative volumes, isolated nodes, numbers that are not finite, moduli
    /// outside 1 Pa to 1 GPa, Poisson ratios outside 0 to 0.4999, densities outside 1 to 30,000 kg/m3, negative viscosities, pins out of range, planes without
    /// a unit normal.
    pub fn body(&mut self, body: BodyDescription<'_>) -> Result<usize> {
        check(&body).map_err(|reason| Error::Body { body: body.name.clone(), reason })?;
        self.bodies.push(lay_out(body));
        Ok(self.bodies.len() - 1)
    }

    /// Finishes the model.
    ///
    /// # Errors
    /// Refuses a model without bodies, and gravity that is not finite or above 100 m/s2.
    pub fn build(self) -> Result<Model> {
        if self.bodies.is_empty() {
            return Err(Error::Model("a model needs a body".to_owned()));
        }
        if !(self.gravity.is_finite() && self.gravity.length() <= 100.0) {
            return Err(Error::Model(format!("gravity is {} m/s2; the earth's is 9.8", self.gravity)));
        }
        Ok(Model { bodies: self.bodies, gravity: self.gravity })
    }
}

fn check(body: &BodyDescription<'_>) -> std::result::Result<(), String> {
    let (mesh, m) = (body.mesh, body.material);
    let within = |name: &str, value: f64, least: f64, most: f64, unit: &str| {
        if (least..=most).contains(&value) {
            Ok(())
        } else {
            Err(format!("{name} is {value} {unit}; {least} to {most} {unit} make sense (is the unit right?)"))
        }
    };
    within("Young's modulus", m.young_modulus, 1.0, 1e9, "Pa")?;
    within("Poisson's ratio", m.poisson_ratio, 0.0, 0.4999, "")?;
    within("density", m.density, 1.0, 30e3, "kg/m3")?;
    within("viscosity", m.viscosity, 0.0, 1e9, "Pa s")?;
    if mesh.tets.is_empty() {
        return Err("the mesh has no element".to_owned());
    }
    if let Some(i) = mesh.vertices.iter().position(|v| !v.is_finite()) {
        return Err(format!("node {i} is at {}; coordinates are finite numbers", mesh.vertices[i]));
    }
    let nodes = mesh.vertices.len();
    let mut used = vec![false; nodes];
    for (t, tet) in mesh.tets.iter().enumerate() {
        if tet.iter().any(|i| *i as usize >= nodes) {
            return Err(format!("element {t} names nodes {tet:?}; there are {nodes}"));
        }
        let volume = mesh.tet_volume(t);
        // Below the smallest volume whose reciprocal the f32 kernels can hold there is no element either.
        if !(volume > 1e-24 && volume.is_finite()) {
            return Err(format!("element {t} has a volume of {volume:.3e} m3; it must be positive"));
        }
        tet.iter().for_each(|i| used[*i as usize] = true);
    }
    if let Some(i) = used.iter().position(|u| !u) {
        return Err(format!("node {i} belongs to no element"));
    }
    for plane in &body.supports {
        if !(plane.normal.is_normalized() && plane.point.is_finite() && plane.friction >= 0.0) {
            return Err(format!("{plane:?} is no plane: a point, a unit normal, friction of 0 or more"));
        }
    }
    match body.pinned.iter().find(|i| **i as usize >= nodes) {
        Some(i) => Err(format!("node {i} is to be pinned; there are {nodes}")),
        None => Ok(()),
    }
}

/// Lays a checked body out for the sweeps.
fn lay_out(description: BodyDescription<'_>) -> Body {
    let BodyDescription { name, mesh, material, pinned: pinned_nodes, supports } = description;
    let nodes = mesh.vertices.len();
    let mut pinned = vec![false; nodes];
    pinned_nodes.iter().for_each(|i| pinned[*i as usize] = true);

    let edges = mesh.edges();
    let mut neighbours = vec![Vec::new(); nodes];
    for [a, b] in &edges {
        neighbours[*a as usize].push(*b);
        neighbours[*b as usize].push(*a);
    }
    let volumes: Vec<f64> = (0..mesh.tets.len()).map(|t| mesh.tet_volume(t)).collect();
    let mut share = vec![0.0; nodes];
    let mut incident = vec![Vec::new(); nodes];
    for (t, tet) in mesh.tets.iter().enumerate() {
        for (k, i) in tet.iter().enumerate() {
            share[*i as usize] += 0.25 * volumes[t];
            incident[*i as usize].push((t, k));
        }
    }
    // Pinned vertices are never swept and have no colour. Vertices of a colour are sorted by the work they are, so that those next to each other are alike.
    let (colors, color_count) = color(&neighbours, &pinned);
    let strips: Vec<Vec<Push>> = match material.model {
        ConstitutiveModel::StableNeoHookean => {
            (0..nodes).map(|i| if pinned[i] { vec![] } else { strip(&faces(mesh, &incident[i])) }).collect()
        }
        ConstitutiveModel::StVenantKirchhoff | ConstitutiveModel::Corotated => vec![vec![]; nodes],
    };
    let mut order: Vec<u32> = (0..nodes as u32).collect();
    order.sort_by_key(|i| {
        let i = *i as usize;
        (pinned[i], colors[i], std::cmp::Reverse((strips[i].len(), incident[i].len())), i)
    });
    let mut internal = vec![0; nodes];
    for (k, i) in order.iter().enumerate() {
        internal[*i as usize] = k as u32;
    }
    let mut color_start = vec![0; color_count + 1];
    for (c, _) in colors.iter().zip(&pinned).filter(|(_, pinned)| !**pinned) {
        color_start[*c as usize + 1] += 1;
    }
    for c in 0..color_count {
        color_start[c + 1] += color_start[c];
    }
    let (masses, raised_masses) = lumped_masses(&share, material.density);

    let mut body = Body {
        material,
        supports,
        raised_masses,
        rest: mesh.clone(),
        pinned,
        median_edge: TetQuality::of(mesh).median_edge,
        origin: mesh.vertices.iter().sum::<DVec3>() / nodes as f64,
        internal,
        color_start,
        tets: Vec::new(),
        vertices: Vec::with_capacity(nodes),
        corners: Vec::with_capacity(4 * mesh.tets.len()),
        gradients: Vec::new(),
        edges: Vec::with_capacity(2 * edges.len()),
        groups: Groups::default(),
        elements: None,
        volumes,
        name,
    };
    body.tets = mesh.tets.iter().map(|t| t.map(|i| body.internal[i as usize])).collect();
    for i in &order {
        let i = *i as usize;
        let vertex = Vertex {
            mass: masses[i] as f32,
            pinned: body.pinned[i],
            corners: body.corners.len() as u32,
            edges: body.edges.len() as u32,
            laplacian: 0.0,
            contact_stiffness: (CONTACT_STIFFNESS * material.young_modulus * share[i].cbrt()) as f32,
        };
        body.vertices.push(vertex);
        add_corners(&mut body, &incident[i]);
        let laplacian = add_edges(&mut body, i, &neighbours[i], &incident[i]);
        if let Some(v) = body.vertices.last_mut() {
            v.laplacian = laplacian;
        }
    }
    body.elements = Elements::new(&body.tets, &body.volumes, |i| body.vertices[i as usize].pinned, nodes);
    if material.model == ConstitutiveModel::StableNeoHookean {
        let inside = |push: &Push| Push { to: body.internal[push.to as usize], ..*push };
        let strips: Vec<Vec<Push>> = order.iter().map(|i| strips[*i as usize].iter().map(inside).collect()).collect();
        body.groups = Groups::new(&body, &strips);
    }
    body
}

/// Masses lumped from the nodes' shares of the volume, none below a quarter of the median; and how many were raised.
fn lumped_masses(share: &[f64], density: f64) -> (Vec<f64>, usize) {
    let mut sorted = share.to_vec();
    sorted.sort_by(f64::total_cmp);
    let floor = MASS_FLOOR * sorted[sorted.len() / 2];
    let raised = share.iter().filter(|v| **v < floor).count();
    (share.iter().map(|v| density * v.max(floor)).collect(), raised)
}

/// Other corners of an element seen from corner k, so that (b-a)x(c-a).(x-a) is positive.
const SEEN_FROM: [[usize; 3]; 4] = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]];

/// The faces opposite a node in its elements, turned as its corners are.
fn faces(mesh: &TetMesh, incident: &[(usize, usize)]) -> Vec<[u32; 3]> {
    incident.iter().map(|(t, k)| SEEN_FROM[*k].map(|c| mesh.tets[*t][c])).collect()
}

fn add_corners(body: &mut Body, incident: &[(usize, usize)]) {
    for (t, k) in incident {
        let others = SEEN_FROM[*k].map(|c| body.tets[*t][c]);
        let volume = body.volumes[*t];
        body.corners.push(Corner { others, inverse_6v: (1.0 / (6.0 * volume)) as f32, volume: volume as f32 });
        if body.material.model != ConstitutiveModel::StableNeoHookean {
            let gradients = shape_gradients(&body.rest, *t);
            body.gradients.push(SEEN_FROM[*k].map(|c| Vec3A::from(gradients[c].as_vec3())));
        }
    }
}

/// Adds the edges of node `i`; returns the diagonal of its Laplacian.
fn add_edges(body: &mut Body, i: usize, neighbours: &[u32], incident: &[(usize, usize)]) -> f32 {
    let (mu, lambda) = body.material.lame();
    let mu = match body.material.model {
        ConstitutiveModel::StableNeoHookean => StableNeoHookean::new(mu, lambda).mu,
        // Their kernels hold the whole energy.
        ConstitutiveModel::StVenantKirchhoff | ConstitutiveModel::Corotated => 0.0,
    };
    let mut diagonal = 0.0;
    let mut stiffness = vec![0.0; neighbours.len()];
    let mut volume = vec![0.0; neighbours.len()];
    for (t, k) in incident {
        let gradients = shape_gradients(&body.rest, *t);
        let v = body.volumes[*t];
        diagonal += mu * v * gradients[*k].length_squared();
        for (c, j) in body.rest.tets[*t].iter().enumerate().filter(|(c, _)| c != k) {
            // A node of the element is a neighbour.
            if let Some(at) = neighbours.iter().position(|n| n == j) {
                stiffness[at] += mu * v * gradients[*k].dot(gradients[c]);
                volume[at] += v / 6.0;
            }
        }
    }
    for (at, j) in neighbours.iter().enumerate() {
        let length = (body.rest.vertices[*j as usize] - body.rest.vertices[i]).length();
        body.edges.push(Edge {
            to: body.internal[*j as usize],
            laplacian: stiffness[at] as f32,
            // A dashpot that dissipates eta (strain rate along the edge)^2 over the edge's share of the volume, a sixth of each element.
            damping: (body.material.viscosity * volume[at] / (length * length)) as f32,
            length: length as f32,
        });
    }
    diagonal as f32
}

/// Gradients of the four shape functions of element `t` at rest [1/m].
pub(crate) fn shape_gradients(mesh: &TetMesh, t: usize) -> [DVec3; 4] {
    let x = mesh.corners(t);
    let six_v = 6.0 * mesh.tet_volume(t);
    [0, 1, 2, 3].map(|k: usize| {
        let [a, b, c] = SEEN_FROM[k].map(|c| x[c]);
        (b - a).cross(c - a) / six_v
    })
}
