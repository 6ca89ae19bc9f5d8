//! What all instances of a lattice share: cells, nodes, masses, pins and factors.
//!
//! Lengths are in edges of a cell, and energies in Young's modulus of the instance times the volume
//! of a cell: then elasticity is the same for all instances, and only inertia and springs differ.
//! Nodes are numbered in the order in which the factor eliminates them.

use super::factor::Factor;
use crate::{Error, Result};
use glam::{DMat3, DVec3};
use trocar_lattice::{Body, EmbeddedPoint, Flow, Law, Material};
use trocar_sparse::{BlockMatrix, Cholesky, Level};

/// Ratio of the Young's moduli of neighbouring factors. A lane whose modulus is off that of its
/// factor by up to the root of it converges a little more slowly in its inertial motions.
const FACTOR_RATIO: f64 = 4.0;

/// Least fill of a lattice. Nodes with next to no tissue around them must be held in single
/// precision too.
const MIN_FILL: f64 = 1e-3;

/// Offsets of a point from the middle of its cell over half an edge, and their products.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Place {
    pub x: f32,
    pub y: f32,
    pub z: f32,
    pub xy: f32,
    pub xz: f32,
    pub yz: f32,
}

impl Place {
    /// The point `u` in a cell from 0 to 1.
    pub fn at(u: DVec3) -> Self {
        let p = u * 2.0 - DVec3::ONE;
        let [xy, xz, yz] = [p.x * p.y, p.x * p.z, p.y * p.z].map(|x| x as f32);
        Self { x: p.x as f32, y: p.y as f32, z: p.z as f32, xy, xz, yz }
    }
}

/// One hexahedron.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cell {
    pub nodes: [u32; 8],
    /// Eight points of the deviatoric part, and that of the volumetric part.
    pub points: [Place; 9],
    /// Share of the cell that is tissue.
    pub volume: f32,
    /// Volume of the fictitious tissue over that of the cell, times its stiffness over the
    /// tissue's.
    pub fill: f32,
    /// |F|^2 at any point is at most 2 |F|^2 in the middle and this times the sum of the squares of
    /// the other modes.
    pub reach: f32,
}

/// A spring between two nodes of the pins: both have the same stiffness in all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PinTerm {
    pub to: u32,
    pub from: u32,
    pub stiffness: f32,
}

/// A factor, and the Young's modulus (Pa) that it is for.
pub(super) struct ModulusFactor {
    pub young_modulus: f64,
    pub factor: Factor,
}

/// The shared part.
pub(super) struct Topology {
    pub cells: Vec<Cell>,
    /// Rest positions of the nodes (m), in this crate's order.
    pub rest: Vec<DVec3>,
    /// Masses (kg).
    pub masses: Vec<f32>,
    /// Masses over the whole mass: a step's size is a mean by mass, because nodes with next to no
    /// tissue around them do not matter.
    pub weights: Vec<f32>,
    /// One over the volume of tissue in the cells of each node.
    pub turning: Vec<f32>,
    /// The stiffness of all pins: the gradient is the sum of stiffness times displacement.
    pub pins: Vec<PinTerm>,
    /// Nodes that never move.
    pub fixed: Vec<u32>,
    /// Place of each of the lattice's nodes.
    pub places: Vec<u32>,
    /// Edge of a cell (m).
    pub cell: f64,
    /// Shear modulus and bulk modulus over Young's modulus.
    pub shear: f32,
    pub bulk: f32,
    /// The material with a Young's modulus of 1.
    pub unit: Material,
    /// Young's modulus of the body (Pa).
    young_modulus: f64,
    /// Stiffness at rest with the pins, without inertia, in the lattice's order.
    stiffness: BlockMatrix,
}

impl Topology {
    /// Of a body.
    ///
    /// # Errors
    /// [`Error::Body`] for a law other than stable neo-Hookean and a fill that is too small.
    pub fn new(body: &Body) -> Result<Self> {
        let material = *body.material();
        if material.law != Law::StableNeoHookean {
            let reason = format!("has the law {:?}; instances in lanes need Law::StableNeoHookean", material.law);
            return Err(Error::Body { body: body.name().to_owned(), reason });
        }
        let lattice = body.lattice();
        let fill = lattice.options().fill;
        if fill < MIN_FILL {
            let reason = format!(
                "has a lattice with a fill of {fill}; instances in lanes need {MIN_FILL} or more (LatticeOptions)"
            );
            return Err(Error::Body { body: body.name().to_owned(), reason });
        }
        let stiffness = stiffness(body);
        let cholesky = Cholesky::<f64>::new(&stiffness);
        let order = cholesky.order();
        let mut places = vec![0; order.len()];
        order.iter().enumerate().for_each(|(place, node)| places[*node as usize] = place as u32);
        let unit = Material { young_modulus: 1.0, ..material };
        let cells: Vec<Cell> = lattice.hexahedra().iter().map(|hex| cell(hex, fill, &places)).collect();
        let whole: f64 = body.masses().iter().sum();
        let turning = turning(&cells, places.len());
        let fixed = (0..places.len()).filter(|node| body.fixed()[*node]).map(|node| places[node]).collect();
        Ok(Self {
            cells,
            weights: order.iter().map(|node| (body.masses()[*node as usize] / whole) as f32).collect(),
            turning,
            rest: order.iter().map(|node| lattice.nodes()[*node as usize]).collect(),
            masses: order.iter().map(|node| body.masses()[*node as usize] as f32).collect(),
            pins: pins(body, &places),
            fixed,
            cell: lattice.cell(),
            shear: unit.shear_modulus() as f32,
            bulk: unit.bulk_modulus() as f32,
            unit,
            young_modulus: material.young_modulus,
            stiffness,
            places,
        })
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.rest.len()
    }

    /// Which factor serves a Young's modulus (Pa).
    pub fn factor_of(&self, young_modulus: f64) -> i32 {
        (libm::log(young_modulus / self.young_modulus) / libm::log(FACTOR_RATIO)).round() as i32
    }

    /// Makes a factor for steps of `h` (s).
    ///
    /// # Errors
    /// [`Error::Body`] if the stiffness is singular.
    pub fn factorise(&self, level: Level, which: i32, h: f64, body: &Body) -> Result<ModulusFactor> {
        let young_modulus = self.young_modulus * FACTOR_RATIO.powi(which);
        let inertia = 1.0 / (h * h * young_modulus * self.cell);
        let mut matrix = self.stiffness.clone();
        for (node, mass) in body.masses().iter().enumerate() {
            if !body.fixed()[node] {
                matrix.add(node as u32, node as u32, DMat3::from_diagonal(DVec3::splat(mass * inertia)));
            }
        }
        let mut cholesky = Cholesky::<f64>::new(&matrix);
        if !cholesky.factorise(level, matrix.blocks().map(|(_, _, block)| block.to_cols_array_2d())) {
            let reason = "has a singular stiffness; pin more of it".to_owned();
            return Err(Error::Body { body: body.name().to_owned(), reason });
        }
        Ok(ModulusFactor { young_modulus, factor: Factor::new(level, &cholesky, self.len()) })
    }

    /// The nodes of an embedded point, as places.
    pub fn nodes_of(&self, point: &EmbeddedPoint) -> [u32; 8] {
        point.nodes.map(|node| self.places[node as usize])
    }
}

/// The stiffness at rest over Young's modulus times the edge of a cell, with the pins. Fixed nodes
/// have rows of the unit matrix.
fn stiffness(body: &Body) -> BlockMatrix {
    let mut whole = body.stiffness_pattern();
    body.add_turned_stiffness(&body.rest_stiffness(), body.lattice().nodes(), &Flow::default(), &mut whole);
    for pin in body.pins() {
        for (a, wa) in pin.point.nodes.iter().zip(&pin.point.weights) {
            for (b, wb) in pin.point.nodes.iter().zip(&pin.point.weights) {
                whole.add(*a, *b, DMat3::from_diagonal(DVec3::splat(pin.stiffness * wa * wb)));
            }
        }
    }
    let unit = body.material().young_modulus * body.lattice().cell();
    let fixed = body.fixed();
    let mut matrix = body.stiffness_pattern();
    for (i, j, block) in whole.blocks() {
        if !fixed[i as usize] && !fixed[j as usize] {
            matrix.add(i, j, *block * (1.0 / unit));
        }
    }
    for (node, _) in fixed.iter().enumerate().filter(|(_, fixed)| **fixed) {
        matrix.add(node as u32, node as u32, DMat3::IDENTITY);
    }
    matrix
}

fn cell(hex: &trocar_lattice::Hexahedron, fill: f64, places: &[u32]) -> Cell {
    let mut points = [Place::at(hex.centre); 9];
    let mut reach = 0.0f32;
    for (c, point) in points[..8].iter_mut().enumerate() {
        let sign = |bit: usize| if c >> bit & 1 == 0 { -1.0 } else { 1.0 };
        *point = Place::at(hex.centre + hex.spread * DVec3::new(sign(0), sign(1), sign(2)));
        let [x, y, z] = [point.x * point.x, point.y * point.y, point.z * point.z];
        reach = reach.max(x + y).max(y + z).max(z + x).max(x * y + y * z + z * x);
    }
    Cell {
        nodes: hex.nodes.map(|node| places[node as usize]),
        points,
        volume: hex.fraction as f32,
        fill: (fill * (1.0 - hex.fraction)) as f32,
        reach: 6.0 * reach,
    }
}

/// One over the volume of tissue in the cells of each node.
fn turning(cells: &[Cell], count: usize) -> Vec<f32> {
    let mut volumes = vec![0.0f32; count];
    for cell in cells {
        cell.nodes.iter().for_each(|node| volumes[*node as usize] += cell.volume);
    }
    volumes.iter().map(|volume| 1.0 / volume).collect()
}

/// The pins' stiffness over Young's modulus times the edge of a cell, by pairs of nodes, sorted.
fn pins(body: &Body, places: &[u32]) -> Vec<PinTerm> {
    let unit = body.material().young_modulus * body.lattice().cell();
    let mut parts: Vec<((u32, u32), f64)> = Vec::new();
    for pin in body.pins() {
        for (a, wa) in pin.point.nodes.iter().zip(&pin.point.weights) {
            for (b, wb) in pin.point.nodes.iter().zip(&pin.point.weights) {
                let pair = (places[*a as usize], places[*b as usize]);
                parts.push((pair, pin.stiffness * wa * wb / unit));
            }
        }
    }
    parts.sort_by_key(|(pair, _)| *pair);
    let sums = parts.chunk_by(|a, b| a.0 == b.0).map(|same| (same[0].0, same.iter().map(|part| part.1).sum::<f64>()));
    sums.map(|((to, from), stiffness)| PinTerm { to, from, stiffness: stiffness as f32 }).collect()
}
