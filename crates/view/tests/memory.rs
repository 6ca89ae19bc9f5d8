//! Clients that read nothing and ask for as much as they can do not fill the memory.

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use serde_json::json;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use trocar_scene::{Scene, SpecimenSource};
use trocar_testing::tube::{ONE_END, resection, two_tubes};
use trocar_view::client::Client;
use trocar_view::{Building, Options, Server, Source};

const SECONDS: Duration = Duration::from_secs(60);
/// Clients that read nothing, with two that do the most that are served.
const HOSTILE: usize = 14;
/// By how much the memory may grow: for each client 8 MiB of replies, and as much again for the
/// scene's message while it is sent, threads and frames.
const BOUND: u64 = HOSTILE as u64 * (16 << 20);
/// How long the hostile ones ask: within the four seconds for which a message is tried to be sent.
const ASKING: Duration = Duration::from_secs(3);

/// Bytes of memory that the process has in use.
fn resident() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    1024 * line.trim().trim_end_matches("kB").trim().parse::<u64>().unwrap()
}

/// A client's text, masked with zeros.
fn text(message: &serde_json::Value) -> Vec<u8> {
    let body = message.to_string().into_bytes();
    let mut all = vec![0x81, 0xff];
    all.extend((body.len() as u64).to_be_bytes());
    all.extend([0; 4]);
    all.extend(body);
    all
}

/// A connection whose handshake is done, and whose answers are never read.
fn deaf(server: &Server) -> TcpStream {
    let mut stream = TcpStream::connect(("127.0.0.1", server.port())).unwrap();
    let token = server.token();
    write!(
        stream,
        "GET /wire/1?token={token} HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    )
    .unwrap();
    stream.read_exact(&mut [0; 12]).unwrap();
    stream.set_nonblocking(true).unwrap();
    stream
}

#[test]
fn hostile_clients_do_not_fill_the_memory() {
    let folder = tempfile::tempdir().unwrap();
    two_tubes(ONE_END, 3e-3).write(&folder.path().join("tube")).unwrap();
    let mut scene: Scene = resection();
    scene.specimen = SpecimenSource::folder(&folder.path().join("tube").display().to_string());
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, scene.to_toml().unwrap()).unwrap();
    let server = Server::start(Options {
        source: Source::of(&file.display().to_string()),
        building: Building { phantoms: PathBuf::from("none"), threads: 1, variation: None },
        policy: "operator".to_owned(),
        seed: 3,
        port: 0,
        record: None,
        playing: true,
        speed: 0.0,
    })
    .unwrap();
    let mut client = Client::connect(&server.wire()).unwrap();
    // Enough is simulated for histories of some size.
    let ready = |m: &trocar_view::client::Received| m.kind() == "status" && m.header["time_s"].as_f64() > Some(5.0);
    client.wait(SECONDS, ready).unwrap();
    let names: Vec<String> = trocar_task::Channels::names();
    let before = resident();

    let mut hostile: Vec<TcpStream> = (0..HOSTILE).map(|_| deaf(&server)).collect();
    let many: Vec<TcpStream> = (0..100).filter_map(|_| TcpStream::connect(("127.0.0.1", server.port())).ok()).collect();
    for mut stream in &many {
        let _ = write!(stream, "GET /wire/1?token=");
    }
    let wish = text(&json!({"type": "subscribe", "frames_hz": 240, "value": "energy", "contacts": true, "held": true,
        "measured_hz": 240, "haptic": true}));
    let history = text(&json!({"type": "history", "channels": names, "from_s": 0, "request": 1}));
    hostile.iter_mut().for_each(|stream| stream.write_all(&wish).unwrap());
    let (clock, mut most) = (Instant::now(), 0);
    while clock.elapsed() < ASKING {
        for stream in &mut hostile {
            // A part of a message that is left out ends the connection, which is none of the
            // others'.
            let _ = stream.write(&history);
        }
        while client.receive(Duration::ZERO).unwrap().is_some() {}
        most = most.max(resident().saturating_sub(before));
        std::thread::sleep(Duration::from_millis(2));
    }
    println!("{:.1} MiB more at most", most as f64 / f64::from(1 << 20));
    assert!(most < BOUND, "{most} bytes more, {BOUND} are allowed");
    // Who behaves is still served.
    client.ask(json!({"type": "ping", "time_s": 0.0}), 5).unwrap();
    server.stop().unwrap();
}
