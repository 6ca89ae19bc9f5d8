//! A stable neo-Hookean body's free vertices in groups of sixteen, as the lanes of a sweep read
//! them.
//!
//! The lanes of a group are vertices of one colour, with strips of nearly the same length
//! ([`crate::body::strip`]). Step k of a group moves each lane one point along its vertex's strip.
//! A lane whose strip is over reads its own vertex with weight 0.

use super::strip::Push;
use super::vertex::VertexTable;
use crate::registers::{BLOCK, Block};

/// Sixteen vertices of one colour.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    /// The lanes' own points.
    pub own: Block<u32>,
    /// Masses (kg).
    pub mass: Block<f32>,
    /// Constant diagonals of the elastic blocks (N/m).
    pub laplacian: Block<f32>,
    /// First vertex; the others follow.
    pub first: u32,
    /// Vertices; fewer than sixteen at the end of a colour.
    pub count: u32,
    /// First step; the next group's is its end.
    start: u32,
    end: u32,
}

/// One point along the lanes' strips.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    /// The point that enters.
    pub to: Block<u32>,
    /// 1 / (6 V0) of the element behind the window (1/m3), negative where the window is turned
    /// over, 0 where there is none.
    pub inverse_6v: Block<f32>,
    /// Laplacian of the edge to the point (N/m); 0 after the first time that the strip meets it.
    pub edge: Block<f32>,
}

/// The groups of a body, colour by colour.
#[derive(Clone, Debug, Default)]
pub(crate) struct Groups {
    points: usize,
    groups: Vec<Group>,
    steps: Vec<Step>,
    /// Lanes of each step in which the first point of the window leaves, not the second.
    drops: Vec<u16>,
    /// Dashpots of the edges (N s/m), for each step; empty without viscosity.
    damping: Vec<Block<f32>>,
    /// First group of each colour, and the number of groups.
    color_start: Vec<u32>,
}

impl Groups {
    /// Lays out the vertices of a body. `strips` are those of its free vertices; `viscous`: edges
    /// have dashpots.
    pub fn new(body: &VertexTable<'_>, strips: &[Vec<Push>], viscous: bool) -> Self {
        let mut groups = Self { points: body.vertices.len(), color_start: vec![0], ..Self::default() };
        for color in body.color_start.windows(2) {
            for first in (color[0]..color[1]).step_by(BLOCK) {
                groups.add(body, first, (color[1] - first).min(BLOCK as u32), strips, viscous);
            }
            groups.color_start.push(groups.groups.len() as u32);
        }
        groups
    }

    fn add(&mut self, body: &VertexTable<'_>, first: u32, count: u32, strips: &[Vec<Push>], viscous: bool) {
        let zero = Block([0.0; BLOCK]);
        let own = Block(std::array::from_fn(|lane| first + (lane as u32).min(count - 1)));
        let start = self.steps.len() as u32;
        let mut group = Group { own, mass: zero, laplacian: zero, first, count, start, end: start };
        let strips = &strips[first as usize..(first + count) as usize];
        let longest = strips.iter().map(Vec::len).max().unwrap_or(0);
        group.end += longest as u32;
        // Lanes without a vertex have a mass, so that their system is regular.
        group.mass.0 = [1.0; BLOCK];
        self.steps.resize(self.steps.len() + longest, Step { to: own, inverse_6v: zero, edge: zero });
        self.drops.resize(self.steps.len(), 0);
        if viscous {
            self.damping.resize(self.steps.len(), zero);
        }
        for (lane, strip) in strips.iter().enumerate() {
            let vertex = first as usize + lane;
            let corners = &body.corners[body.corners_of(vertex)];
            group.mass.0[lane] = body.vertices[vertex].mass;
            group.laplacian.0[lane] = body.vertices[vertex].laplacian;
            for (k, push) in strip.iter().enumerate() {
                let at = start as usize + k;
                let step = &mut self.steps[at];
                step.to.0[lane] = push.to;
                if let Some((corner, turned)) = push.triangle {
                    let inverse = corners[corner as usize].inverse_6v;
                    step.inverse_6v.0[lane] = if turned { -inverse } else { inverse };
                }
                self.drops[at] |= u16::from(push.drop_first) << lane;
                let met = strip[..k].iter().any(|before| before.to == push.to);
                if let Some(edge) = body.edges_of(vertex).iter().find(|edge| edge.to == push.to && !met) {
                    step.edge.0[lane] = edge.laplacian;
                    if viscous {
                        self.damping[at].0[lane] = edge.damping;
                    }
                }
            }
        }
        self.groups.push(group);
    }

    /// Whether there are none: the body is of another material.
    pub fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// Points of the body.
    pub fn points(&self) -> usize {
        self.points
    }

    /// All groups.
    pub fn all(&self) -> &[Group] {
        &self.groups
    }

    /// The groups of each colour.
    pub fn colors(&self) -> impl Iterator<Item = &[Group]> {
        self.color_start.windows(2).map(|c| &self.groups[c[0] as usize..c[1] as usize])
    }

    /// A group's steps.
    #[inline(always)]
    pub fn steps_of(&self, group: &Group) -> &[Step] {
        &self.steps[group.start as usize..group.end as usize]
    }

    /// For each of a group's steps, the lanes in which the first point of the window leaves.
    #[inline(always)]
    pub fn drops_of(&self, group: &Group) -> &[u16] {
        &self.drops[group.start as usize..group.end as usize]
    }

    /// The dashpots of a group's steps (N s/m); nothing without viscosity.
    #[inline(always)]
    pub fn damping_of(&self, group: &Group) -> &[Block<f32>] {
        self.damping.get(group.start as usize..group.end as usize).unwrap_or(&[])
    }
}

impl Group {
    /// Lanes whose vertices are free now.
    #[inline(always)]
    pub fn active(&self, fixed: &[bool]) -> u16 {
        let fixed = &fixed[self.first as usize..(self.first + self.count) as usize];
        fixed.iter().enumerate().fold(0, |mask, (lane, fixed)| mask | u16::from(!fixed) << lane)
    }
}
