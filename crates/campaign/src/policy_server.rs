//! A Python policy in a child process that serves it by openpi's protocol. The child ends with this
//! program.

use crate::policy_spec::PolicySpec;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use trocar_core::Progress;
use trocar_workflow::{Error, Result};

/// The interpreter of `python:` policies, unless `$TROCAR_PYTHON` or the caller names another.
const PYTHON: &str = "python3";

/// Maximum time in which a policy must load.
const MAX_LOAD_TIME: Duration = Duration::from_secs(120);

/// Interval at which children and interruptions are checked.
pub(crate) const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Maximum length of a line of a child's output (bytes).
const MAX_LINE: u64 = 4096;

/// Prefix of a policy's source that is a Python callable.
pub(crate) const PYTHON_SOURCE: &str = "python:";

/// A child process that serves a Python policy. Dropping it ends the process.
pub(crate) struct PolicyServer {
    child: Child,
    /// Its address.
    pub url: String,
    /// The last line of its standard error.
    last_line: Arc<Mutex<String>>,
}

impl Drop for PolicyServer {
    fn drop(&mut self) {
        // It may have exited already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The Python interpreter: `$TROCAR_PYTHON`, or `preferred`, or `python3`.
pub fn interpreter(preferred: Option<&str>) -> String {
    std::env::var("TROCAR_PYTHON").ok().or_else(|| preferred.map(str::to_owned)).unwrap_or_else(|| PYTHON.to_owned())
}

/// Starts the servers of all Python policies among `policies`, by the policies' names.
pub(crate) fn start_servers(
    policies: &[&PolicySpec],
    progress: &dyn Progress,
) -> Result<BTreeMap<String, PolicyServer>> {
    let sources = policies.iter().filter_map(|p| Some((&p.name, p.source.strip_prefix(PYTHON_SOURCE)?)));
    let sources: Vec<_> = sources.collect();
    if sources.is_empty() {
        return Ok(BTreeMap::new());
    }
    progress.begin("loading policies", sources.len() as u64);
    let (python, stop) = (interpreter(None), AtomicBool::new(false));
    let loaded = std::thread::scope(|scope| {
        let load = || -> std::result::Result<_, String> {
            let start =
                |&(name, module): &(&String, &str)| Ok((name.clone(), PolicyServer::start(&python, module, &stop)?));
            sources.iter().map(start).collect()
        };
        let loading = scope.spawn(load);
        while !loading.is_finished() {
            if progress.interrupted() {
                stop.store(true, Ordering::Relaxed);
            }
            std::thread::sleep(POLL_INTERVAL);
        }
        loading.join()
    });
    progress.end();
    match loaded {
        _ if stop.load(Ordering::Relaxed) => Err(Error::Interrupted),
        Ok(loaded) => loaded.map_err(Error::Mismatch),
        Err(_) => Err(Error::Mismatch("the policies cannot be loaded: a thread failed".to_owned())),
    }
}

/// Passes every line of a child's output, cut to [`MAX_LINE`] bytes, to `take`, on another thread.
fn each_line(from: Option<impl Read + Send + 'static>, take: impl Fn(String) + Send + 'static) {
    let Some(from) = from else { return };
    std::thread::spawn(move || {
        let mut lines = BufReader::new(from);
        let mut line = Vec::new();
        while lines.by_ref().take(MAX_LINE).read_until(b'\n', &mut line).is_ok_and(|n| n > 0) {
            let text = String::from_utf8_lossy(&line).trim().to_owned();
            if !text.is_empty() {
                take(text);
            }
            line.clear();
        }
    });
}

impl PolicyServer {
    /// Starts the server of a Python policy and waits for its address.
    pub fn start(python: &str, module: &str, stop: &AtomicBool) -> std::result::Result<Self, String> {
        let mut command = Command::new(python);
        // A terminal's Ctrl-C must reach only this process, which then ends the child. Otherwise a
        // child that ended first would look like a policy that fails.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command
            .args(["-m", "trocar.serve", module, "--port", "0", "--until-eof"])
            // It stays empty. It closes when this process ends, for whatever reason; then the child
            // ends.
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| format!("python:{module}: {python} cannot be started: {e}"))?;
        let (out, err) = (child.stdout.take(), child.stderr.take());
        let mut server = Self { child, url: String::new(), last_line: Arc::default() };
        // Both pipes are read as long as they are open: a full pipe would block the child. The
        // threads end with the child.
        let last_line = Arc::clone(&server.last_line);
        each_line(err, move |line| {
            if let Ok(mut last_line) = last_line.lock() {
                *last_line = line;
            }
        });
        let (sender, receiver) = mpsc::channel();
        each_line(out, move |line| {
            // A policy may print other lines first.
            if line.starts_with("ws://") {
                // The receiver no longer exists after the first address.
                let _ = sender.send(line);
            }
        });
        let start = Instant::now();
        while start.elapsed() < MAX_LOAD_TIME {
            match receiver.recv_timeout(POLL_INTERVAL) {
                Ok(url) => {
                    server.url = url;
                    return Ok(server);
                }
                Err(RecvTimeoutError::Timeout) if stop.load(Ordering::Relaxed) => return Err("interrupted".to_owned()),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    let reason = server.error_line().unwrap_or_default();
                    let reason = reason.strip_prefix("error: ").unwrap_or(&reason);
                    let remedy = if reason.contains("No module named 'trocar'") {
                        "; run pip install '.[policies]' with this interpreter, or name another one in $TROCAR_PYTHON"
                    } else {
                        ""
                    };
                    return Err(format!("python:{module}: cannot be loaded: {reason}{remedy}"));
                }
            }
        }
        Err(format!("python:{module}: did not load within {} s", MAX_LOAD_TIME.as_secs()))
    }

    /// Whether the child has ended.
    pub fn has_ended(&mut self) -> bool {
        self.child.try_wait().ok().flatten().is_some()
    }

    /// The last line of an ended child's standard error; `None` while it runs.
    pub fn error_line(&mut self) -> Option<String> {
        for _ in 0..20 {
            // The line may arrive shortly after the end.
            std::thread::sleep(POLL_INTERVAL);
            if self.has_ended() {
                let line = self.last_line.lock().map(|s| s.clone()).unwrap_or_default();
                return Some(if line.is_empty() {
                    "it printed no error".to_owned()
                } else {
                    line.chars().take(300).collect()
                });
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_core::StopAfter;

    #[test]
    fn an_interpreter_that_does_not_start_is_one_line() {
        let stop = AtomicBool::new(false);
        let said = PolicyServer::start("no-such-interpreter", "mine.py:act", &stop).err().unwrap();
        assert!(said.starts_with("python:mine.py:act: no-such-interpreter cannot be started: "), "{said}");
    }

    #[cfg(unix)]
    #[test]
    fn a_process_that_ends_before_it_serves_is_a_policy_that_cannot_be_loaded() {
        let stop = AtomicBool::new(false);
        let said = PolicyServer::start("false", "mine.py:act", &stop).err().unwrap();
        assert_eq!(said, "python:mine.py:act: cannot be loaded: it printed no error");
    }

    #[test]
    fn an_interruption_ends_the_loading() {
        let spec = PolicySpec::parse("python:mine.py:act").unwrap();
        let stopped = start_servers(&[&spec], &StopAfter::new(0)).err();
        assert!(stopped.is_some());
        assert!(start_servers(&[], &StopAfter::new(0)).unwrap().is_empty(), "nothing to load");
    }
}
