//! One episode by any policy that a campaign knows: a controller of the program, a server, or a Python
//! callable.

use crate::plan;
use crate::remote::Remote;
use crate::served::serve_all;
use crate::source::PolicySpec;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use trocar_core::Progress;
use trocar_workflow::{EpisodeMade, EpisodeRun, Error, Result};

/// Interval at which an interruption is looked for while a policy of another process is waited for.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Runs the episode `run` into the folder `output`. Its policy may be whatever [`PolicySpec::parse`] reads;
/// a Python policy is loaded before anything is built.
///
/// # Errors
/// As [`EpisodeRun::run`]; a policy that is not known or cannot be loaded. `output` is then left as it was.
pub fn run_episode(run: &EpisodeRun, output: &Path, progress: &dyn Progress) -> Result<EpisodeMade> {
    let spec = PolicySpec::parse(&run.policy)?;
    plan::check(std::slice::from_ref(&spec), 1, run.seed, None)?;
    if !spec.is_remote() {
        return EpisodeRun { policy: spec.source, ..run.clone() }.run(output, progress);
    }
    run.check(output)?;
    let mut served = serve_all(&[&spec], progress)?;
    let (stop, done) = (Arc::new(AtomicBool::new(false)), AtomicBool::new(false));
    let made = std::thread::scope(|scope| {
        // A reply is waited for without a look at the progress: this thread looks.
        scope.spawn(|| {
            while !done.load(Ordering::Relaxed) && !progress.interrupted() {
                std::thread::sleep(POLL_INTERVAL);
            }
            stop.store(true, Ordering::Relaxed);
        });
        let made = run.run_policy(output, progress, |specimen, episode| {
            let served = served.remove(&spec.name);
            Ok(Box::new(Remote::new(&spec, specimen, episode, Arc::clone(&stop), None, served)?))
        });
        done.store(true, Ordering::Relaxed);
        made
    });
    match made {
        Err(_) if progress.interrupted() => Err(Error::Interrupted),
        made => made,
    }
}
