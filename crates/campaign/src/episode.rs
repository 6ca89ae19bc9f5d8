//! One episode by any policy of a campaign: a built-in controller, a server, or a Python callable.

use crate::manifest;
use crate::policy_server::{POLL_INTERVAL, start_servers};
use crate::policy_spec::PolicySpec;
use crate::remote::{RemotePolicy, check_servers};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use trocar_core::Progress;
use trocar_task::{Episode, Policy};
use trocar_workflow::{EpisodeOutput, EpisodeRun, Error, Result};

/// The policy of `spec` for `episode`. One that waits for a reply gives up when `stop` is set.
///
/// # Errors
/// A policy that is unknown, or that cannot be reached or started.
pub fn make_policy(spec: &PolicySpec, episode: &Episode, stop: &Arc<AtomicBool>) -> Result<Box<dyn Policy + Send>> {
    if spec.is_remote() {
        return Ok(Box::new(RemotePolicy::new(spec, episode, Arc::clone(stop), None, None)?));
    }
    Ok(trocar_task::policy::named(&spec.source)?)
}

/// Runs the episode `run` into the folder `output`. Its policy is anything that
/// [`PolicySpec::parse`] accepts. A Python policy is loaded, and a server asked, before
/// anything is built.
///
/// # Errors
/// As [`EpisodeRun::run`]; a policy that is unknown or cannot be loaded. `output` then stays
/// unchanged.
pub fn run_episode(run: &EpisodeRun, output: &Path, progress: &dyn Progress) -> Result<EpisodeOutput> {
    let spec = PolicySpec::parse(&run.policy)?;
    manifest::check_episode(&spec, run.seed)?;
    if !spec.is_remote() {
        return EpisodeRun { policy: spec.source, ..run.clone() }.run(output, progress);
    }
    run.check(output)?;
    check_servers(&[&spec], progress)?;
    let mut servers = start_servers(&[&spec], progress)?;
    let (stop, done) = (Arc::new(AtomicBool::new(false)), AtomicBool::new(false));
    let made = std::thread::scope(|scope| {
        // The policy waits for replies without checking for interruption, so this thread checks.
        scope.spawn(|| {
            while !done.load(Ordering::Relaxed) && !progress.interrupted() {
                std::thread::sleep(POLL_INTERVAL);
            }
            stop.store(true, Ordering::Relaxed);
        });
        let made = run.run_policy(output, progress, |episode| {
            let server = servers.remove(&spec.name);
            Ok(Box::new(RemotePolicy::new(&spec, episode, Arc::clone(&stop), None, server)?))
        });
        done.store(true, Ordering::Relaxed);
        made
    });
    match made {
        Err(_) if progress.interrupted() => Err(Error::Interrupted),
        made => made,
    }
}
