//! Forces at a tool of the nodes that it carries rigidly.

use super::force::ToolForce;
use crate::assembly::shape_gradients;
use crate::frame::Frame;
use crate::state::BodyState;
use crate::{Body, Grasp, Hyperelastic};
use glam::{DMat3, DVec3};
use trocar_core::Wrench;

/// The constraint forces of a body's rigid grasps: elastic forces of their nodes, and their weight.
/// Dashpots and the nodes' own inertia are left out; they vanish when the tool rests.
pub(crate) struct Reaction {
    psi: Box<dyn Hyperelastic>,
    /// By vertex: the tool that carries it.
    carrier: Vec<Option<usize>>,
    /// The same when the elements and nodes were listed.
    listed: Vec<Option<usize>>,
    /// Elements with a node that is carried, with the gradients of their shape functions (1/m);
    /// and the nodes that are carried.
    elements: Vec<(usize, [DVec3; 4])>,
    nodes: Vec<u32>,
    forces: Vec<ToolForce>,
}

impl Reaction {
    pub fn new(body: &Body) -> Self {
        let none = vec![None; body.len()];
        Self {
            psi: body.material.hyperelastic(),
            carrier: none.clone(),
            listed: none,
            elements: Vec::new(),
            nodes: Vec::new(),
            forces: Vec::new(),
        }
    }

    /// Forces of the body on each tool.
    pub fn forces(&self) -> &[ToolForce] {
        &self.forces
    }

    /// Computes the forces at the end of a frame; of `all` grasps for solvers that hold all of them
    /// rigidly.
    pub fn take(&mut self, frame: &Frame<'_>, body: &Body, state: &BodyState, all: bool) {
        self.forces.clear();
        self.forces.resize(frame.tools.len(), ToolForce::default());
        let rigid = |grasp: &&Grasp| (all || grasp.compliance.is_none()) && grasp.tool < frame.tools.len();
        self.carrier.fill(None);
        if !frame.grasps().any(|grasp| rigid(&grasp)) {
            return;
        }
        let vertex = |node: u32| body.internal[node as usize] as usize;
        for grasp in frame.grasps().filter(rigid) {
            grasp.nodes.iter().for_each(|node| self.carrier[vertex(*node)] = Some(grasp.tool));
        }
        self.list(body);
        let place = |node: u32| state.x[vertex(node)].as_dvec3();
        let mut pull = |node: u32, force: DVec3| {
            if let Some(tool) = self.carrier[vertex(node)] {
                let arm = body.origin + place(node) - frame.tools[tool].to.translation;
                self.forces[tool].constraint += Wrench::at(force, arm);
            }
        };
        for (t, gradients) in &self.elements {
            let (tet, volume) = (&body.rest.tets[*t], body.volumes[*t]);
            let places = tet.map(place);
            let column = |c: usize| (0..4).map(|k| places[k] * gradients[k][c]).sum();
            let stress = self.psi.stress(DMat3::from_cols(column(0), column(1), column(2))) * volume;
            tet.iter().zip(gradients).for_each(|(node, m)| pull(*node, -(stress * *m)));
        }
        for node in &self.nodes {
            pull(*node, body.mass(*node as usize) * frame.gravity);
        }
    }

    /// Lists the elements and nodes at the vertices that are carried, if these are others than
    /// before.
    fn list(&mut self, body: &Body) {
        let Self { carrier, listed, elements, nodes, .. } = self;
        if carrier == listed {
            return;
        }
        let is_carried = |node: &u32| carrier[body.internal[*node as usize] as usize].is_some();
        nodes.clear();
        nodes.extend((0..body.len() as u32).filter(is_carried));
        elements.clear();
        let tets = body.rest.tets.iter().enumerate().filter(|(_, tet)| tet.iter().any(is_carried));
        elements.extend(tets.map(|(t, _)| (t, shape_gradients(&body.rest, t))));
        listed.clone_from(carrier);
    }

    /// Takes the forces over from a solver that knows them. No force of another body is added to
    /// them.
    pub fn set(&mut self, forces: &[ToolForce]) {
        self.carrier.fill(None);
        self.forces.clear();
        self.forces.extend_from_slice(forces);
    }

    /// Adds the force of another body on a vertex (N), if a tool carries it.
    pub fn press(&mut self, frame: &Frame<'_>, body: &Body, state: &BodyState, vertex: usize, force: DVec3) {
        if let Some(tool) = self.carrier[vertex] {
            let arm = body.origin + state.x[vertex].as_dvec3() - frame.tools[tool].to.translation;
            self.forces[tool].constraint += Wrench::at(force, arm);
        }
    }
}
