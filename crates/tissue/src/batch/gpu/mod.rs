//! A batch on a graphics card: the same instances, law and search as in SIMD lanes, an instance in
//! each column of the card's arrays. A prototype, with the feature `gpu`.
//!
//! Columns are innermost in memory, so that neighbouring threads read neighbouring numbers. No
//! atomic operation is used, and every sum has a fixed order: a column has the same bits however
//! many there are and in any run on one card. Other cards and drivers may fuse products and sums,
//! and so have other bits.
//!
//! A Cholesky factor's solve is a long chain of small steps. The card multiplies by the dense
//! inverse instead: a product of matrices for all columns at once, from which it gets most of its
//! speed.

mod device;
mod inverse;
mod layout;

use super::frame::Schedule;
use super::topology::ModulusFactor;
use super::{Batch, InstanceReport, relative};
use crate::registers::BLOCK;
use crate::{Result, ToolMotion};
use device::{Device, Pass};
use layout::{Layout, TILE};

/// Passes from the beginning of a substep to its first round.
const OPENING: [Pass; 8] = [
    Pass::Begin,
    Pass::CellsOfGuess,
    Pass::CheckGuess,
    Pass::CellsOfFlat,
    Pass::GatherGuess,
    Pass::PullGuess,
    Pass::Survey,
    Pass::TurnNodes,
];

/// Passes of a round: a direction, a step along it, and its judgement.
const ROUND: [Pass; 8] = [
    Pass::BeforeSolve,
    Pass::Solve,
    Pass::AfterSolve,
    Pass::CellsOfTrial,
    Pass::GatherTrial,
    Pass::PullTrial,
    Pass::Judge,
    Pass::NextRound,
];

/// Rounds after which the card is first asked whether all columns are done. Asking costs more than
/// a round in which there is nothing to do.
const ROUNDS_AT_ONCE: usize = 2;

/// A [`Batch`] whose instances are on a graphics card.
///
/// Grasps are those that the batch had when it was moved there.
pub struct GpuBatch {
    batch: Batch,
    layout: Layout,
    device: Device,
    /// The column of each instance.
    columns: Vec<usize>,
}

impl GpuBatch {
    /// Moves a batch to the fastest card that has a Vulkan driver.
    ///
    /// # Errors
    /// [`Error::Gpu`] without such a card, and for a batch that is too large for it.
    pub fn new(batch: Batch) -> Result<Self> {
        let (columns, factors) = columns(&batch);
        let springs = batch
            .groups
            .iter()
            .map(|g| g.grasps.lanes.iter().map(|l| l.springs.len()).max())
            .max()
            .flatten()
            .unwrap_or(0)
            .max(1);
        let width = TILE * factors.len();
        let (layout, shared) = Layout::new(&batch.topology, &batch.schedule, width, springs, &factors);
        let inverse = |f: &ModulusFactor| inverse::of(&f.factor, batch.level, batch.topology.len(), layout.padded);
        let inverses: Vec<f32> = batch.pool.install(|| batch.factors.iter().flat_map(inverse).collect());
        let counts = [batch.topology.len(), batch.topology.cells.len()];
        let device = Device::new(&layout, &shared, &inverses, counts)?;
        let gpu = Self { batch, layout, device, columns };
        gpu.write_all();
        gpu.device.run(&[Pass::Respond]);
        Ok(gpu)
    }

    /// Name of the card.
    pub fn card(&self) -> &str {
        &self.device.name
    }

    /// Memory on the card (bytes).
    pub fn bytes(&self) -> u64 {
        self.device.bytes
    }

    /// Advances all instances by a frame, as [`Batch::step`].
    ///
    /// # Errors
    /// [`Error::Model`] for another number of tools than of instances; [`Error::Gpu`] if the card
    /// was lost.
    pub fn step(&mut self, tools: &[ToolMotion]) -> Result<Vec<InstanceReport>> {
        self.batch.check_tools(tools)?;
        let width = self.layout.columns;
        self.device.write(self.layout.offset(self.layout.reports), &vec![0.0; 3 * width]);
        let Schedule { substeps, ends, .. } = self.batch.schedule;
        for substep in 0..substeps {
            self.carry(tools, substep);
            self.device.begin_substep(substep);
            self.device.run(&OPENING);
            let mut rounds = 0;
            while rounds < ends.rounds {
                let more = ROUNDS_AT_ONCE.min(ends.rounds - rounds);
                self.device.run(&ROUND.repeat(more));
                rounds += more;
                if rounds < ends.rounds && self.device.active()? == 0 {
                    break;
                }
            }
            self.device.run(&[Pass::Finish]);
        }
        let numbers = self.device.read(self.layout.offset(self.layout.reports), 3 * width)?;
        let of = |column: &usize| InstanceReport {
            rounds: numbers[*column] as usize,
            unconverged: numbers[width + column] as usize,
            damaged: numbers[2 * width + column] != 0.0,
        };
        Ok(self.columns.iter().map(of).collect())
    }

    /// The batch as it is on the card now.
    ///
    /// # Errors
    /// [`Error::Gpu`] if the card was lost.
    pub fn batch(&mut self) -> Result<&Batch> {
        let rows = 3 * self.batch.topology.len();
        let width = self.layout.columns;
        let u = self.device.read(self.layout.offset(self.layout.displacements), rows * width)?;
        let v = self.device.read(self.layout.offset(self.layout.velocities), rows * width)?;
        for ((group, lane), column) in self.batch.seats.iter().zip(&self.columns) {
            let group = &mut self.batch.groups[*group];
            for (row, (to_u, to_v)) in group.u.as_flattened_mut().iter_mut().zip(group.v.as_flattened_mut()).enumerate()
            {
                to_u.0[*lane] = u[row * width + column];
                to_v.0[*lane] = v[row * width + column];
            }
        }
        Ok(&self.batch)
    }

    /// Carries the grasps' targets to the end of a substep, and says which columns stay.
    fn carry(&mut self, tools: &[ToolMotion], substep: usize) {
        let Batch { schedule, topology, instances, seats, groups, .. } = &mut self.batch;
        let share = (substep + 1) as f64 / schedule.substeps as f64;
        let width = self.layout.columns;
        let mut targets = vec![0.0; 3 * self.layout.springs * width];
        let mut idle = vec![1.0; width];
        for (k, ((group, lane), column)) in seats.iter().zip(&self.columns).enumerate() {
            let grasps = &mut groups[*group].grasps;
            if grasps.holds(*lane) {
                grasps.carry(*lane, &relative(&instances[k].pose, &tools[k].at(share)), topology.cell);
            }
            idle[*column] = f32::from(u8::from(!grasps.is_sound(*lane)));
            let springs = grasps.lanes[*lane].springs.iter().map(|spring| spring.target);
            for (row, number) in springs.flatten().enumerate() {
                targets[row * width + column] = number;
            }
        }
        self.device.write(self.layout.offset(self.layout.idle), &idle);
        let first = self.layout.targets + substep * 3 * self.layout.springs;
        self.device.write(self.layout.offset(first), &targets);
    }

    /// Writes what the host knows of all instances.
    fn write_all(&self) {
        let Batch { topology, seats, groups, .. } = &self.batch;
        let (layout, width) = (&self.layout, self.layout.columns);
        let field = 3 * topology.len();
        let rank = 3 * layout.springs;
        let fill = |first: usize, rows: usize, at: &dyn Fn(usize, usize, usize) -> f32| {
            let mut numbers = vec![0.0; rows * width];
            for ((group, lane), column) in seats.iter().zip(&self.columns) {
                (0..rows).for_each(|row| numbers[row * width + column] = at(*group, *lane, row));
            }
            self.device.write(layout.offset(first), &numbers);
        };
        fill(layout.displacements, field, &|group, lane, row| groups[group].u[row / 3][row % 3].0[lane]);
        fill(layout.velocities, field, &|group, lane, row| groups[group].v[row / 3][row % 3].0[lane]);
        fill(layout.inertia, 1, &|group, lane, _| groups[group].inertia.0[lane]);
        fill(layout.gravity, 3, &|group, lane, row| groups[group].gravity[row].0[lane]);
        let spring = |group: usize, lane: usize, number: usize| groups[group].grasps.lanes[lane].springs.get(number);
        fill(layout.held_nodes, 8 * layout.springs, &|group, lane, row| {
            spring(group, lane, row / 8).map_or(0.0, |spring| spring.nodes[row % 8] as f32)
        });
        fill(layout.held_weights, 8 * layout.springs, &|group, lane, row| {
            spring(group, lane, row / 8).map_or(0.0, |spring| spring.weights[row % 8])
        });
        fill(layout.stiffness, layout.springs, &|group, lane, row| {
            spring(group, lane, row).map_or(0.0, |spring| spring.stiffness)
        });
        fill(layout.resistance, rank * rank, &|group, lane, row| {
            let column = groups[group].grasps.resistance.get(row / rank);
            column.map_or(0.0, |column| column[row % rank].0[lane])
        });
    }
}

/// The column of each instance, and the factor of each tile of columns. Columns of a tile have one
/// factor.
fn columns(batch: &Batch) -> (Vec<usize>, Vec<u32>) {
    let mut factors = Vec::new();
    let mut firsts = Vec::with_capacity(batch.groups.len());
    let mut free = 0;
    for group in &batch.groups {
        if free == 0 || factors.last() != Some(&(group.factor as u32)) {
            factors.push(group.factor as u32);
            free = TILE;
        }
        firsts.push(TILE * factors.len() - free);
        free -= BLOCK;
    }
    let of = |(group, lane): &(usize, usize)| firsts[*group] + lane;
    (batch.seats.iter().map(of).collect(), factors)
}
