//! A Python callable as a child process that serves it by openpi's protocol, and ends with this program.

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Longest that an interpreter takes to import a policy.
const START: Duration = Duration::from_secs(120);

/// How often a child that is waited for is looked at.
const GLANCE: Duration = Duration::from_millis(50);

/// Longest line of a child that is kept in one piece [bytes].
const LONGEST: u64 = 4096;

/// A child process that serves a Python callable; it ends with this.
pub(super) struct Served {
    child: Child,
    /// Where it is asked.
    pub url: String,
    /// The last line of its standard error.
    said: Arc<Mutex<String>>,
}

impl Drop for Served {
    fn drop(&mut self) {
        // It may have ended by itself; either way it is gone.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Starts the server of a callable and waits for its address.
///
/// # Errors
/// One that does not start, ends before it serves, or takes too long, in a sentence.
pub(super) fn serve(python: &str, module: &str, stop: &AtomicBool) -> std::result::Result<Served, String> {
    let mut command = Command::new(python);
    // A terminal's Ctrl-C is for this process, which ends the child; one that ended by itself would look like a policy that fails.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    let mut child = command
        .args(["-m", "trocar.serve", module, "--port", "0", "--until-eof"])
        // Nothing is written into it. It closes with this process, however that ends, and so the child ends too.
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|e| format!("python:{module}: {python} cannot be started: {e}"))?;
    let (out, err) = (child.stdout.take(), child.stderr.take());
    let mut served = Served { child, url: String::new(), said: Arc::default() };
    // Both pipes are read for as long as they are open: one that is full would hold the child up. The threads end with the child, or with whoever keeps its pipes.
    let said = Arc::clone(&served.said);
    each_line(err, move |line| {
        if let Ok(mut said) = said.lock() {
            *said = line;
        }
    });
    let (tell, told) = mpsc::channel();
    each_line(out, move |line| {
        // Whatever else is printed first is not the address.
        if line.starts_with("ws://") {
            // Nobody listens any more once it was told.
            let _ = tell.send(line);
        }
    });
    let begun = Instant::now();
    while begun.elapsed() < START {
        match told.recv_timeout(GLANCE) {
            Ok(url) => {
                served.url = url;
                return Ok(served);
            }
            Err(RecvTimeoutError::Timeout) if stop.load(Ordering::Relaxed) => return Err("interrupted".to_owned()),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                let words = served.last_words().unwrap_or_default();
                return Err(format!("python:{module}: cannot be loaded: {words}"));
            }
        }
    }
    Err(format!("python:{module}: was not served within {} s", START.as_secs()))
}

/// Gives every line of a child's output, cut to [`LONGEST`] bytes, to `take`, on a thread of its own.
fn each_line(from: Option<impl Read + Send + 'static>, take: impl Fn(String) + Send + 'static) {
    let Some(from) = from else { return };
    std::thread::spawn(move || {
        let mut lines = BufReader::new(from);
        let mut line = Vec::new();
        while lines.by_ref().take(LONGEST).read_until(b'\n', &mut line).is_ok_and(|n| n > 0) {
            let text = String::from_utf8_lossy(&line).trim().to_owned();
            if !text.is_empty() {
                take(text);
            }
            line.clear();
        }
    });
}

impl Served {
    /// Whether the child has ended.
    pub fn has_ended(&mut self) -> bool {
        self.child.try_wait().ok().flatten().is_some()
    }

    /// The last line that a child which has ended wrote to its standard error; None while it runs.
    pub fn last_words(&mut self) -> Option<String> {
        for _ in 0..20 {
            // The line may come a moment after the end.
            std::thread::sleep(GLANCE);
            if self.has_ended() {
                let said = self.said.lock().map(|s| s.clone()).unwrap_or_default();
                return Some(if said.is_empty() {
                    "it said nothing".to_owned()
                } else {
                    said.chars().take(300).collect()
                });
            }
        }
        None
    }
}
