//! The instances on a graphics card.

use super::{CardRow, InstancesRow, ManyBench, Scene, Truth, WARM_UP, errors_of, of_tissue};
use crate::Result;
use crate::statistics::median;
use std::time::Instant;
use trocar_core::Progress;
use trocar_tissue::{GpuBatch, ToolMotion};
use trocar_workflow::check_interrupted;

impl ManyBench {
    /// Times a number of instances on the card, beside the lanes' `row`, and takes the errors of
    /// the first ones.
    pub(super) fn card_row(
        &self,
        scene: &Scene,
        row: &InstancesRow,
        truths: &[Truth],
        progress: &dyn Progress,
    ) -> Result<CardRow> {
        let count = row.instances;
        let whole = (WARM_UP + self.frames).max(self.judged_frames);
        progress.begin(&format!("{count} instances of {} nodes on the card", row.nodes), whole as u64);
        let mut gpu = GpuBatch::new(self.batch(scene, count)?).map_err(of_tissue)?;
        let judged = truths.len().min(count);
        let (mut times, mut rounds, mut unconverged, mut error) = (Vec::new(), 0, 0, 0.0f64);
        for frame in 0..whole {
            check_interrupted(progress)?;
            let tools: Vec<ToolMotion> = (0..count).map(|k| scene.tool(k, frame)).collect();
            let clock = Instant::now();
            let reports = gpu.step(&tools).map_err(of_tissue)?;
            let took = clock.elapsed().as_secs_f64();
            if (WARM_UP..WARM_UP + self.frames).contains(&frame) {
                times.push(took);
                rounds += reports.iter().map(|r| r.rounds).sum::<usize>();
                unconverged += reports.iter().map(|r| r.unconverged).sum::<usize>();
            }
            if frame + 1 == self.judged_frames {
                let batch = gpu.batch().map_err(of_tissue)?;
                error = errors_of(batch, scene, &truths[..judged]).into_iter().fold(0.0, f64::max);
            }
            progress.advance(1);
        }
        progress.end();
        let rate = 1.0 / median(&mut times);
        Ok(CardRow {
            card: gpu.card().to_owned(),
            instances: count,
            nodes: row.nodes,
            frames_per_s: rate,
            organ_frames_per_s: count as f64 * rate,
            over_lanes: rate / row.frames_per_s,
            error,
            memory_mb: gpu.bytes() as f64 / 1e6,
            rounds: rounds as f64 / (count * self.frames * self.substeps) as f64,
            unconverged,
        })
    }
}
