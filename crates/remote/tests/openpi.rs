//! Comparison with openpi's packer, server and client from PyPI. Skipped, with a message, without
//! them.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "helper functions of tests")]

mod common;

use common::observation;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use trocar_remote::{
    Array, Call, Client, Dialect, Endpoint, Error, Loopback, LoopbackOptions, Map, Value, pack, unpack,
};

/// The interpreter with openpi's packages; prints why there is none.
fn python() -> Option<PathBuf> {
    let python = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/tools-openpi/bin/python");
    let imports =
        Command::new(&python).args(["-c", "import openpi_client.websocket_client_policy, openpi_server"]).output();
    if imports.is_ok_and(|o| o.status.success()) {
        return Some(python);
    }
    println!("skipped: no openpi-client and openpi-server in target/tools-openpi; `cargo xtask tools` fetches them");
    None
}

fn peer(python: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(python);
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/oracles/openpi_peer.py")).args(arguments);
    command
}

/// A process that ends with the test.
struct Served(Child);

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn bytes_are_those_of_openpi() {
    let Some(python) = python() else { return };
    let output = peer(&python, &["pack"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(pack(&observation()).unwrap(), output.stdout);
    assert_eq!(unpack(&output.stdout).unwrap(), Value::Map(observation()));
}

#[test]
fn our_client_works_with_their_server() {
    let Some(python) = python() else { return };
    let mut child = peer(&python, &["serve"]).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut port = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut port).unwrap();
    let _served = Served(child);
    let mut endpoint = Endpoint::new(format!("127.0.0.1:{}", port.trim()));
    endpoint.api_key = Some("unused".into());
    endpoint.retry.attempts = 100;
    endpoint.retry.max_pause = Duration::from_millis(200);
    endpoint.actions.dim = Some(3);
    let mut client = Client::connect(&endpoint).unwrap();
    assert_eq!(client.dialect(), Dialect::OpenPi);
    assert_eq!(client.metadata()["name"], "oracle".into());
    assert_eq!(client.metadata()["horizon"], 10.into());
    assert_eq!(client.metadata()["mean"], Array::from_f64(&[2, 3], &[0.0; 6]).unwrap().into());
    let reply = client.infer(&observation()).unwrap();
    assert_eq!((reply.actions.horizon(), reply.actions.dim()), (10, 3));
    assert_eq!(reply.actions.step(9).unwrap(), [5.0, -10.0, 22.5]);
    assert_eq!(reply.fields["same"], true.into());
    assert_eq!(reply.fields["pixels"], (59 * 30).into());
    assert_eq!(reply.fields["wrench"], observation()["observation/wrench"]);
    assert_eq!(reply.fields["gain"], 0.5.into());
    assert!(reply.server_ms.unwrap() > 0.0);
    let mut bad = observation();
    bad.insert("prompt".into(), "fail".into());
    match client.infer(&bad).unwrap_err() {
        Error::Server { last, traceback, .. } => {
            assert!(last.starts_with("ValueError: no such appendix (File "), "{last}");
            assert!(traceback.starts_with("Traceback"), "{traceback}");
        }
        e => panic!("{e}"),
    }
    client.reset(&Map::new()).unwrap();
    assert_eq!(client.infer(&observation()).unwrap().actions, reply.actions);
    let mut slowest = 0.0f64;
    for _ in 0..100 {
        slowest = slowest.max(client.infer(&observation()).unwrap().round_trip_ms);
    }
    println!("slowest of 100 small round trips: {slowest:.2} ms");
}

#[test]
fn their_client_works_with_our_server() {
    let Some(python) = python() else { return };
    let metadata = Map::from([("name".to_owned(), Value::from("ours"))]);
    let options = LoopbackOptions { metadata, api_key: Some("open sesame".into()), ..LoopbackOptions::default() };
    let policy = |call| {
        let seen = call == Call::Infer(observation());
        let values = [1.0, 2.0, if seen { 3.0 } else { -1.0 }, 4.0];
        Ok(Map::from([("actions".to_owned(), Array::from_f32(&[2, 2], &values).unwrap().into())]))
    };
    let server = Loopback::start(&options, policy).unwrap();
    let output = peer(&python, &["ask", &server.url(), "open sesame"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let told = String::from_utf8(output.stdout).unwrap();
    let expected =
        r#"{"metadata": {"name": "ours"}, "actions": [[1.0, 2.0], [3.0, 4.0]], "dtype": "<f4", "timed": true}"#;
    assert_eq!(told.trim(), expected);
    let refused = peer(&python, &["ask", &server.url(), "wrong"]).output().unwrap();
    assert!(!refused.status.success() && String::from_utf8_lossy(&refused.stderr).contains("401"));
}
