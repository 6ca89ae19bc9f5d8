//! `trocar view`.

use crate::{cli, open, output};
use serde::Serialize;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use trocar_campaign::{PolicySpec, check_servers};
use trocar_core::Progress;
use trocar_view::{Building, Options, Server, Source, build_page};
use trocar_workflow::{Error, Result};

/// Time between looks at whether the viewer is to end.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Where the viewer is.
#[derive(Serialize)]
struct Started {
    /// The page's address.
    address: String,
    /// The wire's address.
    wire: String,
    port: u16,
    token: String,
    /// Whether the page is there.
    page: bool,
}

pub fn run(arguments: &cli::View, json: bool, progress: &dyn Progress) -> Result<()> {
    let wrong = |why: trocar_view::Error| Error::Mismatch(why.to_string());
    let speed = arguments.speed;
    if speed != 0.0 && !(0.125..=8.0).contains(&speed) {
        return Err(Error::Mismatch(format!("--speed {speed}: it must be in [0.125, 8], or 0")));
    }
    let source = Source::of(&arguments.source);
    source.check().map_err(wrong)?;
    if let Ok(policy) = PolicySpec::parse(&arguments.policy) {
        check_servers(&[&policy], progress)?;
    }
    let left = Arc::<AtomicBool>::default();
    if arguments.until_eof {
        let left = Arc::clone(&left);
        std::thread::spawn(move || {
            // What comes is not meant for anyone; an error is an end, too.
            let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
            left.store(true, Ordering::Relaxed);
        });
    }
    progress.begin("the page", 1);
    let missing = build_page();
    progress.end();
    let server = Server::start(Options {
        source,
        building: Building {
            phantoms: arguments.phantoms.clone(),
            threads: arguments.threads,
            variation: arguments.variation,
        },
        policy: arguments.policy.clone(),
        seed: arguments.seed,
        port: arguments.port,
        record: arguments.record.clone(),
        playing: !arguments.paused,
        speed,
    })
    .map_err(wrong)?;
    let started = Started {
        address: server.address(),
        wire: server.wire(),
        port: server.port(),
        token: server.token().to_owned(),
        page: server.has_page(),
    };
    if let Some(line) = missing {
        eprintln!("{line}");
    }
    output::print(json, &started, |s| format!("{}\nCtrl-C ends it", s.address));
    if started.page && !arguments.no_open && !json {
        open::in_browser(&started.address, "the page");
    }
    while !progress.interrupted() && !server.has_ended() && !left.load(Ordering::Relaxed) {
        std::thread::sleep(POLL_INTERVAL);
    }
    server.stop().map_err(wrong)
}
