//! Tissue that cannot move: the triangles of organs whose three vertices are pinned. Of a collision
//! surface these are vertices whose nodes are all pinned.
//!
//! The tissue's own step finds contacts of vertices that move. It has none for pinned vertices, so
//! such a triangle would let an instrument pass. Here it is a solid for the instrument's axis on
//! its outer side, with no margin: an instrument that lies beside it is not touched. Triangles with
//! a vertex that moves belong to the tissue's contact, so no force counts twice. Tissue at the rim
//! of the pinned part, and not in front of it, is also left to the tissue's contact.

use super::meeting::{Deepest, Meeting, REACH};
use super::rod::Rod;
use crate::World;
use crate::cell::ContactParts;
use glam::DVec3;
use trocar_geometry::{closest_on_triangle, nearest_of_segments};
use trocar_tissue::{CollisionSurface, Hole};

/// Least cosine of the angle between a triangle's normal and the direction in which it pushes.
const LEAST_COSINE: f64 = 0.5;

/// Share of a rod's radius by which it may come into tissue. An axis that came near the surface
/// would get past the edge between two triangles, because a part is pushed by one triangle only.
const ROOM: f64 = 0.5;

/// Most triangles of a leaf.
const LEAF: usize = 4;

/// The pinned triangles of all organs, in a tree of boxes.
#[derive(Clone, Debug, Default)]
pub(in crate::cell) struct PinnedSurface {
    /// In the tree's order.
    triangles: Vec<Pinned>,
    nodes: Vec<Node>,
}

/// A triangle of an organ whose vertices are pinned.
#[derive(Clone, Copy, Debug)]
struct Pinned {
    organ: usize,
    nodes: [u32; 3],
    /// Corners (m), counterclockwise seen from outside.
    corners: [DVec3; 3],
}

impl Pinned {
    /// Whether it is in one of the `holes` that let `tool` through.
    fn lets_through(&self, holes: &[Hole], tool: usize) -> bool {
        let open = |hole: &Hole| self.nodes.iter().any(|node| hole.nodes.binary_search(node).is_ok());
        holes.iter().any(|hole| hole.body == self.organ && hole.tools.contains(&tool) && open(hole))
    }
}

/// A box around triangles. Its first child follows it.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// The triangles of a leaf; empty otherwise.
    leaf: [usize; 2],
    /// The node after its last descendant.
    after: usize,
}

impl PinnedSurface {
    /// The pinned triangles of `world` at their present place, which never changes. None if
    /// instruments do not touch organs.
    pub fn felt(world: &World, contact: ContactParts) -> Self {
        if !contact.instruments {
            return Self::default();
        }
        let mut triangles = Vec::new();
        for (k, body) in world.model.bodies().iter().enumerate() {
            let pinned = body.pinned();
            if !pinned.contains(&true) {
                continue;
            }
            if let Some(surface) = body.collision_surface() {
                triangles.extend(of_surface(world, k, surface));
                continue;
            }
            let (boundary, nodes) = body.rest().boundary();
            for t in &boundary.triangles {
                let nodes = t.map(|i| nodes[i as usize]);
                if nodes.iter().all(|i| pinned[*i as usize]) {
                    let corners = nodes.map(|i| world.state.position(&world.model, k, i as usize));
                    triangles.push(Pinned { organ: k, nodes, corners });
                }
            }
        }
        let mut nodes = Vec::new();
        build(&mut triangles, 0, &mut nodes);
        Self { triangles, nodes }
    }

    /// Adds the meetings of `rods`, which belong to `tool` and pass through its `holes`.
    pub(super) fn meet(&self, rods: &[Rod], holes: &[Hole], tool: usize, found: &mut Deepest) {
        for rod in rods {
            self.for_near(&rod.ends, rod.radius + REACH, |triangle| {
                if let Some(meeting) = meeting(rod, &triangle.corners).filter(|_| !triangle.lets_through(holes, tool)) {
                    found.add(rod.part, Meeting { organ: Some(triangle.organ), ..meeting });
                }
            });
        }
    }

    /// Whether the axis of one of `rods`, which belong to `tool`, goes through a triangle that is
    /// in none of its `holes`.
    pub(super) fn is_crossed(&self, rods: &[Rod], holes: &[Hole], tool: usize) -> bool {
        let mut crossed = false;
        for rod in rods {
            self.for_near(&rod.ends, 0.0, |triangle| {
                crossed |= crosses(&rod.ends, &triangle.corners) && !triangle.lets_through(holes, tool);
            });
        }
        crossed
    }

    /// Calls `found` for the triangles whose boxes are within `reach` (m) of a segment.
    fn for_near(&self, segment: &[DVec3; 2], reach: f64, mut found: impl FnMut(&Pinned)) {
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            if !near_box(segment, reach, node) {
                at = node.after;
                continue;
            }
            self.triangles[node.leaf[0]..node.leaf[1]].iter().for_each(&mut found);
            at += 1;
        }
    }
}

/// The pinned triangles of the collision surface of `organ`. For holes, a corner is the node with
/// the greatest weight.
fn of_surface<'a>(
    world: &'a World,
    organ: usize,
    surface: &'a CollisionSurface,
) -> impl Iterator<Item = Pinned> + use<'a> {
    let pinned = world.model.bodies()[organ].pinned();
    let places = world.state.collision_positions(&world.model, organ);
    let bearing = |vertex: u32| {
        let (nodes, weights) = surface.nodes_of(vertex as usize);
        nodes.into_iter().zip(weights).filter(|(_, weight)| *weight != 0.0)
    };
    let is_pinned = move |vertex: &u32| bearing(*vertex).all(|(node, _)| pinned[node as usize]);
    let node = move |vertex: u32| bearing(vertex).max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(node, _)| node);
    let still = surface.mesh().triangles.iter().filter(move |t| t.iter().all(is_pinned));
    still.map(move |t| Pinned { organ, nodes: t.map(node), corners: t.map(|i| places[i as usize]) })
}

/// Appends the tree over `triangles`, the first of which is number `first`.
fn build(triangles: &mut [Pinned], first: usize, nodes: &mut Vec<Node>) {
    if triangles.is_empty() {
        return;
    }
    let corners = triangles.iter().flat_map(|t| &t.corners);
    let (low, high) =
        corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)));
    let (at, count) = (nodes.len(), triangles.len());
    let leaf = if count <= LEAF { [first, first + count] } else { [first; 2] };
    nodes.push(Node { low, high, leaf, after: 0 });
    if count > LEAF {
        let size = high - low;
        let axis = (0..3).max_by(|a, b| size[*a].total_cmp(&size[*b])).unwrap_or(0);
        let middle = |t: &Pinned| t.corners.iter().map(|p| p[axis]).sum::<f64>();
        // Stable: triangles of equal middles keep their order.
        triangles.sort_by(|a, b| middle(a).total_cmp(&middle(b)));
        let (left, right) = triangles.split_at_mut(count / 2);
        build(left, first, nodes);
        build(right, first + count / 2, nodes);
    }
    nodes[at].after = nodes.len();
}

/// Whether the segment comes into the box grown by `reach` (m) on all sides.
fn near_box([from, to]: &[DVec3; 2], reach: f64, node: &Node) -> bool {
    let (low, high, way) = (node.low - reach, node.high + reach, *to - *from);
    let (mut begin, mut end) = (0.0_f64, 1.0_f64);
    for a in 0..3 {
        let (one, two) = ((low[a] - from[a]) / way[a], (high[a] - from[a]) / way[a]);
        if way[a] == 0.0 {
            if from[a] < low[a] || from[a] > high[a] {
                return false;
            }
        } else {
            (begin, end) = (begin.max(one.min(two)), end.min(one.max(two)));
        }
    }
    begin <= end
}

/// The meeting of a rod with a triangle, if the rod's axis is in front of it.
fn meeting(rod: &Rod, triangle: &[DVec3; 3]) -> Option<Meeting> {
    let [a, b, c] = *triangle;
    let outward = (b - a).cross(c - a).try_normalize()?;
    let mut best: Option<(f64, DVec3, DVec3)> = None;
    let mut add = |p: DVec3, q: DVec3| {
        let distance = p.distance(q);
        if best.is_none_or(|(least, ..)| distance < least) {
            best = Some((distance, p, q));
        }
    };
    // The nearest places are at an end of the axis or at an edge of the triangle, unless the axis
    // goes through it.
    for p in rod.ends {
        add(p, closest_on_triangle(triangle, p));
    }
    for edge in [[a, b], [b, c], [c, a]] {
        let [s, t] = nearest_of_segments(rod.ends, edge);
        add(rod.ends[0].lerp(rod.ends[1], s), edge[0].lerp(edge[1], t));
    }
    let (distance, p, q) = best?;
    if crosses(&rod.ends, triangle) {
        return None;
    }
    let normal = (p - q).try_normalize()?;
    if normal.dot(outward) < LEAST_COSINE {
        return None;
    }
    let gap = distance - rod.radius;
    Some(Meeting { point: q + 0.5 * gap * normal, normal, gap, room: ROOM * rod.radius, organ: None })
}

/// Whether a segment goes through a triangle.
fn crosses(ends: &[DVec3; 2], triangle: &[DVec3; 3]) -> bool {
    let [a, b, c] = *triangle;
    let normal = (b - a).cross(c - a);
    let heights = ends.map(|p| (p - a).dot(normal));
    if heights[0].min(heights[1]) >= 0.0 || heights[0].max(heights[1]) <= 0.0 {
        return false;
    }
    let through = ends[0].lerp(ends[1], heights[0] / (heights[0] - heights[1]));
    closest_on_triangle(triangle, through).distance(through) < 1e-12
}
