//! The viewer on a small scene: what clients see, what an operator does, and that no client changes
//! the simulation, whatever it sends.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::{Field, Row};
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use trocar_core::Silent;
use trocar_scene::{Scene, SpecimenSource};
use trocar_task::{Episode, EpisodeFile, Recording, policy, run};
use trocar_testing::tube::{ONE_END, resection, two_tubes};
use trocar_view::client::{Client, Received};
use trocar_view::{Building, Options, Server, Source};

const SECONDS: Duration = Duration::from_secs(60);

/// A scene file around a small tube.
fn scene_in(folder: &Path) -> PathBuf {
    two_tubes(ONE_END, 3e-3).write(&folder.join("tube")).unwrap();
    let mut scene: Scene = resection();
    scene.specimen = SpecimenSource::folder(&folder.join("tube").display().to_string());
    let file = folder.join("scene.toml");
    std::fs::write(&file, scene.to_toml().unwrap()).unwrap();
    file
}

fn start(source: &Path, policy: &str, record: Option<PathBuf>, speed: f64) -> Server {
    let building = Building { phantoms: PathBuf::from("none"), threads: 1, variation: None };
    let source = Source::of(&source.display().to_string());
    let policy = policy.to_owned();
    let options = Options { source, building, policy, seed: 3, port: 0, record, playing: false, speed };
    Server::start(options).unwrap()
}

fn ready(server: &Server) -> Client {
    let mut client = Client::connect(&server.wire()).unwrap();
    status(&mut client, |s| s["phase"] == "ready");
    client.ask(json!({"type": "seats", "take": ["controls", "left", "right"]}), 1).unwrap();
    client
}

fn status(client: &mut Client, wanted: impl Fn(&Value) -> bool) -> Value {
    client.wait(SECONDS, |m| m.kind() == "status" && wanted(&m.header)).unwrap().header
}

/// The numbers of an array of a message.
fn floats(got: &Received, name: &str) -> Vec<f32> {
    let array = &got.header["arrays"][name];
    let length = u32::from_le_bytes(got.bytes[..4].try_into().unwrap()) as usize;
    let at = 4 + length + array["offset"].as_u64().unwrap() as usize;
    let count: u64 = array["shape"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).product();
    assert_eq!(array["dtype"], "f32");
    let bytes = &got.bytes[at..at + 4 * count as usize];
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

/// Where the tip of the left arm is commanded to be (m).
fn place(frame: &Received) -> Vec<f32> {
    floats(frame, "arms")[9..12].to_vec()
}

/// A column of a file of channels.
fn column(file: &Path, name: &str) -> Vec<f64> {
    let reader = SerializedFileReader::new(std::fs::File::open(file).unwrap()).unwrap();
    let number = |row: &Row| {
        row.get_column_iter().find_map(|(own, field)| match field {
            Field::Double(x) if own == name => Some(*x),
            _ => None,
        })
    };
    reader.get_row_iter(None).unwrap().map(|row| number(&row.unwrap()).unwrap()).collect()
}

/// The scripted episode without a viewer.
fn plain(file: &Path, seed: u64) -> Recording {
    let scene = Scene::read(&file.display().to_string()).unwrap();
    let specimen = trocar_workflow::scene_specimen(&scene, Path::new("none"), &Silent).unwrap();
    let mut episode = Episode::new(&scene, &specimen, 1).unwrap();
    run(&mut episode, policy::named("scripted").unwrap().as_mut(), seed, &mut |_| true).unwrap()
}

fn connect(server: &Server) -> TcpStream {
    let stream = TcpStream::connect(("127.0.0.1", server.port())).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    stream
}

/// The status of the answer to a request with these header lines.
fn answered(server: &Server, line: &str, headers: &str) -> String {
    let mut stream = connect(server);
    let _ = write!(stream, "{line} HTTP/1.1\r\n{headers}\r\n\r\n");
    let mut got = [0; 12];
    let _ = stream.read_exact(&mut got);
    String::from_utf8_lossy(&got[9..]).into_owned()
}

const UPGRADE: &str = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
     Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==";

fn handshake(server: &Server, host: &str, origin: &str, token: &str) -> String {
    let headers = format!("Host: {host}\r\n{UPGRADE}\r\nOrigin: {origin}");
    answered(server, &format!("GET /wire/1?token={token}"), &headers)
}

/// A connection whose handshake is done.
fn opened(server: &Server) -> TcpStream {
    let mut stream = connect(server);
    let token = server.token();
    write!(stream, "GET /wire/1?token={token} HTTP/1.1\r\nHost: 127.0.0.1\r\n{UPGRADE}\r\n\r\n").unwrap();
    let mut got = [0; 12];
    stream.read_exact(&mut got).unwrap();
    assert_eq!(&got[9..], b"101");
    stream
}

/// A client's frame, masked with zeros, that says it has `length` bytes.
fn masked(opcode: u8, length: u64, bytes: &[u8]) -> Vec<u8> {
    let mut all = vec![opcode, 0xff];
    all.extend(length.to_be_bytes());
    all.extend([0; 4]);
    all.extend(bytes);
    all
}

#[test]
fn no_client_changes_the_simulation() {
    let folder = tempfile::tempdir().unwrap();
    let file = scene_in(folder.path());
    let expected = plain(&file, 3);
    let server = start(&file, "scripted", Some(folder.path().join("kept")), 0.0);
    let mut client = ready(&server);

    // Whoever is not meant gets nothing.
    let (own, token) = (format!("127.0.0.1:{}", server.port()), server.token().to_owned());
    let origin = format!("http://{own}");
    assert_eq!(handshake(&server, &own, &origin, &token), "101");
    assert_eq!(handshake(&server, "localhost:1", "http://localhost:1", &token), "101", "through a tunnel");
    assert_eq!(handshake(&server, &own, "http://evil.example", &token), "403");
    assert_eq!(handshake(&server, "evil.example", "http://evil.example", &token), "403");
    assert_eq!(handshake(&server, &own, &origin, "0123"), "401");
    assert_eq!(handshake(&server, &own, &origin, &"f".repeat(token.len())), "401");
    assert_eq!(answered(&server, "GET /../Cargo.toml", &format!("Host: {own}")), "404");
    assert_eq!(answered(&server, "POST /", &format!("Host: {own}")), "405");
    assert_eq!(answered(&server, "\x16\x03\x01 \0", ""), "400");

    // A second operator is refused, and told by whom.
    let mut second = Client::connect(&server.wire()).unwrap();
    let refused = second.ask(json!({"type": "seats", "take": ["left"]}), 5).unwrap_err().to_string();
    assert!(refused.contains("the left arm is driven by client 1"), "{refused}");
    assert!(second.ask(json!({"type": "pause"}), 6).is_err());
    second.send(&json!({"type": "servo_jaw", "arm": "left", "seq": 1, "time_s": 0, "opening": 1})).unwrap();
    second.send(&json!({"type": "release", "arm": "left"})).unwrap();

    let wish = json!({"type": "subscribe", "frames_hz": 240, "value": "energy", "contacts": true, "held": true});
    client.ask(wish.clone(), 7).unwrap();
    client.ask(json!({"type": "play"}), 8).unwrap();

    // Garbage, giants, halves and wrong words: each ends its own connection at most.
    let mut garbage = opened(&server);
    let _ = garbage.write_all(&[0x5a; 4000]);
    let mut giant = opened(&server);
    let _ = giant.write_all(&masked(0x81, 1 << 40, b"{"));
    let mut half = opened(&server);
    let _ = half.write_all(&masked(0x01, 4, b"{\"ty"));
    let mut words = opened(&server);
    let bad: [&[u8]; 8] = [
        b"{}",
        b"[1]",
        b"{\"type\":\"reset\",\"seed\":-1}",
        b"{\"type\":\"nothing\"}",
        b"{\"type\":\"subscribe\",\"frames_hz\":1e300}",
        b"{\"type\":\"servo_cp\",\"arm\":\"left\",\"seq\":-1}",
        b"{\"type\":\"picture\",\"camera\":\"x\",\"width\":99999,\"height\":1}",
        b"\xff\xfe",
    ];
    for text in bad.iter().cycle().take(80) {
        let _ = words.write_all(&masked(0x81, text.len() as u64, text));
    }
    // One that reads nothing, with frames as often as they come.
    let (mut slow, wish) = (opened(&server), wish.to_string());
    slow.write_all(&masked(0x81, wish.len() as u64, wish.as_bytes())).unwrap();
    // A hundred at once that never end their requests.
    let many: Vec<TcpStream> = (0..100).map(|_| connect(&server)).collect();
    for mut stream in &many {
        let _ = write!(stream, "GET /wire/1?token={token} HTTP/1.1\r\nHost: {own}\r\n");
    }
    let refused = refused_of(&many, many.len() - 32);
    assert!(refused >= many.len() - 32, "{refused}");
    drop(many);

    let mut frames = 0;
    let ended = client.wait(SECONDS, |m| {
        frames += u32::from(m.kind() == "frame");
        m.kind() == "status" && m.header["mode"] == "ended"
    });
    let end = ended.unwrap().header;
    assert!(end["passed"] == true && frames > 20, "{end} {frames}");

    // What was simulated is what is simulated without a viewer, to the bit.
    let done = client.ask(json!({"type": "record", "action": "keep"}), 9).unwrap().header;
    let got = EpisodeFile::read(&PathBuf::from(done["path"].as_str().unwrap()).join("episode.trocar")).unwrap();
    assert!(got.steps == expected.file.steps, "other actions or states");
    assert!(got.header.policy == "scripted" && done["passed"] == true);
    server.stop().unwrap();
}

/// How many of the connections were answered with "too many", once there are `enough`.
fn refused_of(many: &[TcpStream], enough: usize) -> usize {
    let clock = Instant::now();
    let mut refused = vec![false; many.len()];
    while refused.iter().filter(|r| **r).count() < enough && clock.elapsed() < SECONDS {
        std::thread::sleep(Duration::from_millis(20));
        for (mut stream, refused) in many.iter().zip(&mut refused) {
            stream.set_nonblocking(true).unwrap();
            let mut got = [0; 12];
            *refused |= stream.read(&mut got).is_ok_and(|n| n == 12 && &got[9..] == b"503");
        }
    }
    refused.iter().filter(|r| **r).count()
}

#[test]
fn an_operator_moves_an_arm_and_the_episode_replays() {
    let folder = tempfile::tempdir().unwrap();
    let file = scene_in(folder.path());
    let kept = folder.path().join("kept");
    let server = start(&file, "operator", Some(kept.clone()), 1.0);
    let mut client = ready(&server);
    client.ask(json!({"type": "subscribe", "frames_hz": 120, "measured_hz": 60, "haptic": true}), 2).unwrap();
    let begin = place(&client.wait(SECONDS, |m| m.kind() == "frame").unwrap());
    client.ask(json!({"type": "play"}), 3).unwrap();

    // Half of 12 mm along the cell's x.
    let there = |at: &[f32]| (at[0] - begin[0] - 0.006).abs() < 3e-4;
    let (mut seq, mut at, mut felt, clock) = (0, begin.clone(), false, Instant::now());
    while !(there(&at) && felt) && clock.elapsed() < Duration::from_secs(20) {
        seq += 1;
        let command = json!({"type": "servo_cr", "arm": "left", "seq": seq, "time_s": 0.1, "clutch": 1,
            "frame": "world", "scale": 0.5, "translation_m": [0.012, 0, 0], "jaw": 0.7});
        client.send(&command).unwrap();
        let until = Instant::now() + Duration::from_millis(30);
        while Instant::now() < until {
            let Some(got) = client.receive(until.saturating_duration_since(Instant::now())).unwrap() else { break };
            if got.kind() == "frame" {
                at = place(&got);
                let command = &got.header["commands"]["left"];
                assert!(command.is_null() || command["seq"].as_u64().unwrap() <= seq);
            }
            felt |= got.kind() == "haptic" && got.header["stiffness"].as_array().unwrap().len() == 36;
        }
    }
    assert!(there(&at) && felt, "{begin:?} {at:?} {felt}");
    // A command lives a moment; then the arm holds its place, and says so.
    let held = status(&mut client, |s| s["actors"]["left"] == "hold");
    assert_eq!(held["actors"]["right"], "policy");
    let measured = client.wait(SECONDS, |m| m.kind() == "measured").unwrap().header;
    assert!((measured["arms"]["left"]["jaw_setpoint_js"].as_f64().unwrap() - 0.7).abs() < 1e-9, "{measured}");
    client.ask(json!({"type": "hand_back", "arm": "left"}), 4).unwrap();
    status(&mut client, |s| s["actors"]["left"] == "policy");
    let done = client.ask(json!({"type": "record", "action": "keep"}), 5).unwrap().header;
    let path = PathBuf::from(done["path"].as_str().unwrap());
    assert_eq!(done["passed"], false);
    for name in ["channels.parquet", "result.json", "input.jsonl", "actors.csv", "surfaces.trocar"] {
        assert!(path.join(name).is_file(), "{name}");
    }
    let actors = std::fs::read_to_string(path.join("actors.csv")).unwrap();
    assert!(actors.contains(",operator,policy\n") && actors.contains(",hold,policy\n"), "{actors}");
    let codes = actors.lines().skip(1).map(|line| match line.split(',').nth(1) {
        Some("policy") => 0.0,
        Some("operator") => 1.0,
        _ => 2.0,
    });
    assert_eq!(column(&path.join("channels.parquet"), "left_actor"), codes.collect::<Vec<f64>>());
    // An operator that is gone pauses the simulation, and whoever comes next is told.
    client.ask(json!({"type": "pause"}), 6).unwrap();
    client.send(&json!({"type": "servo_jaw", "arm": "right", "seq": 1, "time_s": 0, "opening": 0.5})).unwrap();
    client.ask(json!({"type": "play"}), 7).unwrap();
    status(&mut client, |s| s["actors"]["right"] != "policy");
    drop(client);
    let mut next = Client::connect(&server.wire()).unwrap();
    let told = status(&mut next, |s| s["note"].is_string());
    assert_eq!(told["playing"], false);
    drop(next);
    server.stop().unwrap();
    // The demonstration is an episode file.
    let verdict = trocar_workflow::replay(&path, None, Path::new("none"), 1, &Silent).unwrap();
    assert!(verdict.same && verdict.steps > 5, "{verdict:?}");

    // It can be watched, and every time of it is exact.
    let server = start(&kept, "scripted", None, 0.0);
    let mut client = ready(&server);
    let table = client.ask(json!({"type": "table"}), 2).unwrap().header;
    assert_eq!(table["episodes"][0]["id"], "000001");
    let length = status(&mut client, |_| true)["length_s"].as_f64().unwrap();
    let mut seek = |time_s: f64, number: i64| {
        // The frame may come before the reply.
        client.send(&json!({"type": "seek", "time_s": time_s, "request": number})).unwrap();
        let near = |m: &Received| m.kind() == "frame" && (m.header["time_s"].as_f64().unwrap() - time_s).abs() < 1e-6;
        place(&client.wait(SECONDS, near).unwrap())
    };
    let last = seek(length, 3);
    assert!(last != begin && seek(0.0, 4) == begin && seek(length, 5) == last);
    assert_eq!(status(&mut client, |s| s["mode"] == "ended")["exact"], true);
}

#[test]
fn an_end_that_the_policy_chose_is_kept_and_replayed() {
    let folder = tempfile::tempdir().unwrap();
    let specimen = folder.path().join("tube");
    two_tubes(ONE_END, 3e-3).write(&specimen).unwrap();
    // The lift of a specimen goes on after it is passed, until its script is done.
    let server = start(&specimen, "scripted", Some(folder.path().join("kept")), 0.0);
    let mut client = ready(&server);
    client.ask(json!({"type": "play"}), 2).unwrap();
    let ended = status(&mut client, |s| s["mode"] == "ended");
    assert!(ended["end"]["kind"] == "passed" || ended["end"]["kind"] == "finished", "{ended}");
    assert!(ended["time_s"].as_f64() < ended["length_s"].as_f64(), "{ended}");
    // It is the same after a look at what came before.
    client.ask(json!({"type": "seek", "time_s": 0.5}), 3).unwrap();
    status(&mut client, |s| s["mode"] == "review" && s["seeking"] == false);
    let done = client.ask(json!({"type": "record", "action": "keep"}), 4).unwrap().header;
    let path = PathBuf::from(done["path"].as_str().unwrap());
    let file = EpisodeFile::read(&path.join("episode.trocar")).unwrap();
    assert_eq!(json!(file.header.end.as_ref().map(trocar_task::End::name)), ended["end"]["kind"]);
    server.stop().unwrap();
    let verdict = trocar_workflow::replay(&path, None, Path::new("none"), 1, &Silent).unwrap();
    assert!(verdict.same, "{verdict:?}");
}
