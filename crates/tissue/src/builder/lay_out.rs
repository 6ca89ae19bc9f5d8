//! Lays out a checked body: vertices in the order of the sweeps, with their masses, elements and
//! edges.

use super::{BodyDescription, MassFloor};
use crate::assembly::{SEEN_FROM, shape_gradients};
use crate::body::coloring::color;
use crate::body::element_lanes::ElementLanes;
use crate::body::groups::Groups;
use crate::body::strip::{Push, strip};
use crate::body::surface::Surface;
use crate::body::{BodyData, Corner, Edge, Vertex};
use crate::{Body, ConstitutiveModel, StableNeoHookean};
use glam::{DVec3, Vec3A};
use trocar_geometry::{TetMesh, TetQuality};

/// Factor of the dashpots: along edges of all directions they dissipate 2/15 of (strain rate)^2
/// under shear, a viscous body 2.
const DASHPOTS: f64 = 15.0;

/// Where the masses of a body's nodes come from.
pub(crate) enum NodeMasses<'a> {
    /// From the volume around each node, raised to a floor; and masses (kg) that are added.
    Lumped { floor: MassFloor, added: &'a [(u32, f64)] },
    /// From the body that it is a piece of.
    Inherited(Inherited),
}

/// Quantities that a piece of a body inherits from the whole, in order to keep every bit of its
/// positions and masses.
pub(crate) struct Inherited {
    /// World position of the whole body's own origin (m).
    pub origin: DVec3,
    /// Mass of each node (kg).
    pub masses: Vec<f64>,
    /// Number of nodes whose mass was raised.
    pub raised: usize,
}

/// Lays out a checked body for the sweeps.
pub(crate) fn lay_out(description: BodyDescription<'_>, contact_stiffness: f64, masses: NodeMasses<'_>) -> Body {
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
    // Pinned vertices are never swept and have no colour. Vertices of a colour are sorted by their
    // amount of work, so that adjacent ones are alike.
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
    let (masses, raised_masses, origin) = match masses {
        NodeMasses::Inherited(whole) => (whole.masses, whole.raised, whole.origin),
        NodeMasses::Lumped { floor, added } => {
            let (mut masses, raised) = lumped_masses(&share, material.density, floor);
            added.iter().for_each(|(node, kg)| masses[*node as usize] += kg);
            (masses, raised, mesh.vertices.iter().sum::<DVec3>() / nodes as f64)
        }
    };

    let (surface, areas) = Surface::of(mesh, &internal);
    let mut body = BodyData {
        material,
        supports,
        tethers: Vec::new(),
        contact_stiffness,
        raised_masses,
        parts: count_parts(&neighbours),
        rest: mesh.clone(),
        pinned,
        median_edge: TetQuality::of(mesh).median_edge,
        origin,
        areas,
        surface,
        collision: None,
        bound: Vec::new(),
        bound_stiffness: Vec::new(),
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
        lattice: None,
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
            contact_stiffness: (contact_stiffness * material.young_modulus * libm::cbrt(share[i])) as f32,
        };
        body.vertices.push(vertex);
        add_corners(&mut body, &incident[i]);
        let laplacian = add_edges(&mut body, i, &neighbours[i], &incident[i]);
        if let Some(v) = body.vertices.last_mut() {
            v.laplacian = laplacian;
        }
    }
    body.elements = ElementLanes::new(&body.tets, &body.volumes, |i| body.vertices[i as usize].pinned, nodes);
    let mut body = Body::from(body);
    if material.model == ConstitutiveModel::StableNeoHookean {
        let inside = |push: &Push| Push { to: body.internal[push.to as usize], ..*push };
        let strips: Vec<Vec<Push>> = order.iter().map(|i| strips[*i as usize].iter().map(inside).collect()).collect();
        let groups = Groups::new(&body.vertex_table(), &strips, material.viscosity > 0.0);
        body.groups = groups;
    }
    body
}

/// Masses lumped from the nodes' shares of the volume, none below the floor; and the number of
/// raised ones.
fn lumped_masses(share: &[f64], density: f64, floor: MassFloor) -> (Vec<f64>, usize) {
    let mut sorted = share.to_vec();
    sorted.sort_by(f64::total_cmp);
    let least = match floor {
        MassFloor::None => 0.0,
        MassFloor::MedianShare(part) => part * sorted[sorted.len() / 2],
    };
    let raised = share.iter().filter(|v| **v < least).count();
    (share.iter().map(|v| density * v.max(least)).collect(), raised)
}

/// Number of pieces that are connected by shared nodes.
fn count_parts(neighbours: &[Vec<u32>]) -> usize {
    let mut seen = vec![false; neighbours.len()];
    let mut parts = 0;
    let mut open = Vec::new();
    for first in 0..neighbours.len() {
        if std::mem::replace(&mut seen[first], true) {
            continue;
        }
        parts += 1;
        open.push(first as u32);
        while let Some(i) = open.pop() {
            let new = neighbours[i as usize].iter().filter(|j| !std::mem::replace(&mut seen[**j as usize], true));
            open.extend(new);
        }
    }
    parts
}

/// The faces opposite a node in its elements, oriented as its corners are.
fn faces(mesh: &TetMesh, incident: &[(usize, usize)]) -> Vec<[u32; 3]> {
    incident.iter().map(|(t, k)| SEEN_FROM[*k].map(|c| mesh.tets[*t][c])).collect()
}

fn add_corners(body: &mut BodyData, incident: &[(usize, usize)]) {
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
fn add_edges(body: &mut BodyData, i: usize, neighbours: &[u32], incident: &[(usize, usize)]) -> f32 {
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
            // See `Material::viscosity`; the edge's share of the volume is a sixth of each element.
            damping: (DASHPOTS * body.material.viscosity * volume[at] / (length * length)) as f32,
            length: length as f32,
        });
    }
    diagonal as f32
}
