//! A body laid out for the quasi-Newton solver: free nodes in the order of elimination, elements
//! sixteen at a time.

use crate::Body;
use crate::assembly::shape_gradients;
use crate::body::BoundVertex;
use crate::lanes::{LANES, Row};
use glam::{DVec3, Vec3A};

/// Fewest batches that are worth a thread of their own.
pub(super) const MIN_BATCHES: usize = 600;

/// Sixteen elements.
#[derive(Clone)]
#[repr(C, align(64))]
pub(super) struct Batch {
    /// Their nodes, corner by corner.
    pub nodes: [[u32; LANES]; 4],
    /// Rest gradients of the shape functions of corners 1 to 3 (1/m); that of corner 0 is minus
    /// their sum.
    pub gradients: [[[f32; LANES]; 3]; 3],
    /// Rest volumes (m3); 0 for the spare lanes of the last batch.
    pub volumes: [f32; LANES],
}

/// The order and the sizes of a body's data.
pub(super) struct Layout {
    /// Free nodes; pinned ones that share an element with them follow.
    pub free: usize,
    /// All nodes: free, then pinned.
    pub nodes: usize,
    /// Rows of a vector over free nodes: `free` up to a multiple of 16.
    pub rows: usize,
    /// The body's internal vertex of each node.
    pub vertex: Vec<u32>,
    /// Number of each of the body's nodes, in internal order, here.
    pub number: Vec<u32>,
    /// The vertices of a collision surface, with the nodes' numbers here. Their internal numbers
    /// follow those of the nodes.
    bound: Vec<BoundVertex>,
    /// Elements with a free node.
    pub batches: Vec<Batch>,
    /// Per free node, the indices of its corners among all corners of the batches: those of node i
    /// are `corners[first_corner[i]..first_corner[i + 1]]`.
    pub first_corner: Vec<u32>,
    pub corners: Vec<u32>,
    /// Per free node, its neighbours and the weights with which their offsets make its mean
    /// deformation gradient, F = sum (x_j - x_i) w_j'.
    pub first_neighbour: Vec<u32>,
    pub neighbours: Vec<u32>,
    pub weights: Vec<Row>,
    /// Masses of free nodes (kg).
    pub masses: Vec<f32>,
}

impl Layout {
    /// The value of a field at a vertex, from its values by number.
    #[inline(always)]
    pub fn value(&self, vertex: u32, field: impl Fn(usize) -> Vec3A) -> Vec3A {
        match self.number.get(vertex as usize) {
            Some(number) => field(*number as usize),
            None => self.bound[vertex as usize - self.number.len()].sum(|number| field(number as usize)),
        }
    }

    /// Calls `visit(number, share)` for the nodes that bear a `share` of something at a vertex.
    #[inline(always)]
    pub fn for_nodes(&self, vertex: u32, share: f32, mut visit: impl FnMut(usize, f32)) {
        match self.number.get(vertex as usize) {
            Some(number) => visit(*number as usize, share),
            None => {
                let bound = &self.bound[vertex as usize - self.number.len()];
                bound.shares().for_each(|(number, weight)| visit(number as usize, share * weight));
            }
        }
    }

    /// Sum of the magnitudes of a vertex's weights; None for a node.
    #[inline(always)]
    pub fn spread(&self, vertex: u32) -> Option<f32> {
        Some(self.bound.get((vertex as usize).wrapping_sub(self.number.len()))?.spread)
    }

    /// Lays out `body` with its free nodes in the order `order` (original numbers).
    pub fn new(body: &Body, order: &[u32]) -> Self {
        let free = order.len();
        let pinned = (0..body.len() as u32).filter(|i| body.pinned[*i as usize]);
        let nodes: Vec<u32> = order.iter().copied().chain(pinned).collect();
        let mut place = vec![0u32; body.len()];
        nodes.iter().enumerate().for_each(|(k, i)| place[*i as usize] = k as u32);
        let vertex: Vec<u32> = nodes.iter().map(|i| body.internal[*i as usize]).collect();
        let mut number = vec![0u32; body.len()];
        vertex.iter().enumerate().for_each(|(k, v)| number[*v as usize] = k as u32);

        let mut tets: Vec<usize> = (0..body.rest.tets.len())
            .filter(|t| body.rest.tets[*t].iter().any(|i| (place[*i as usize] as usize) < free))
            .collect();
        // Elements near each other in the order of elimination share nodes: their gathers hit the
        // cache.
        tets.sort_by_key(|t| body.rest.tets[*t].iter().map(|i| place[*i as usize]).min());
        let batches: Vec<Batch> = tets.chunks(LANES).map(|chunk| batch(body, &place, chunk)).collect();

        let mut incident = vec![Vec::new(); free];
        let mut around: Vec<Vec<(u32, DVec3)>> = vec![Vec::new(); free];
        let mut volume = vec![0.0; free];
        for (k, t) in tets.iter().enumerate() {
            let tet = body.rest.tets[*t].map(|i| place[i as usize]);
            let gradients = shape_gradients(&body.rest, *t);
            for (c, i) in tet.iter().enumerate().filter(|(_, i)| (**i as usize) < free) {
                incident[*i as usize].push(((k / LANES) * 4 * LANES + c * LANES + k % LANES) as u32);
                volume[*i as usize] += body.volumes[*t];
                for (d, j) in tet.iter().enumerate().filter(|(_, j)| *j != i) {
                    let weight = body.volumes[*t] * gradients[d];
                    let list = &mut around[*i as usize];
                    match list.iter_mut().find(|(n, _)| n == j) {
                        Some((_, w)) => *w += weight,
                        None => list.push((*j, weight)),
                    }
                }
            }
        }
        let (mut first_corner, mut corners) = (vec![0], Vec::new());
        let (mut first_neighbour, mut neighbours, mut weights) = (vec![0], Vec::new(), Vec::new());
        for i in 0..free {
            corners.extend_from_slice(&incident[i]);
            first_corner.push(corners.len() as u32);
            for (j, w) in &around[i] {
                let w = *w / volume[i];
                neighbours.push(*j);
                weights.push([w.x as f32, w.y as f32, w.z as f32, 0.0]);
            }
            first_neighbour.push(neighbours.len() as u32);
        }
        Self {
            free,
            nodes: nodes.len(),
            rows: free.next_multiple_of(LANES),
            masses: order.iter().map(|i| body.mass(*i as usize) as f32).collect(),
            vertex,
            bound: body
                .bound
                .iter()
                .map(|b| BoundVertex { nodes: b.nodes.map(|i| number[i as usize]), ..*b })
                .collect(),
            number,
            batches,
            first_corner,
            corners,
            first_neighbour,
            neighbours,
            weights,
        }
    }
}

fn batch(body: &Body, place: &[u32], tets: &[usize]) -> Batch {
    let mut batch = Batch { nodes: [[0; LANES]; 4], gradients: [[[0.0; LANES]; 3]; 3], volumes: [0.0; LANES] };
    for lane in 0..LANES {
        // The last batch is filled up with its first element, without volume.
        let t = tets.get(lane).copied().unwrap_or(tets[0]);
        let gradients = shape_gradients(&body.rest, t);
        for k in 0..4 {
            batch.nodes[k][lane] = place[body.rest.tets[t][k] as usize];
        }
        for k in 0..3 {
            for (c, g) in gradients[k + 1].to_array().into_iter().enumerate() {
                batch.gradients[k][c][lane] = g as f32;
            }
        }
        batch.volumes[lane] = if lane < tets.len() { body.volumes[t] as f32 } else { 0.0 };
    }
    batch
}
