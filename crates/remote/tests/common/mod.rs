//! Misbehaving servers and hand-written messages.
#![allow(dead_code, clippy::unwrap_used, reason = "helpers of tests; not every test uses all")]

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread::JoinHandle;
use std::time::Duration;
use trocar_remote::{Array, Endpoint, Map, Observation, Value, pack};
use tungstenite::{Message, WebSocket};

/// A server of one connection.
pub struct Hostile {
    pub url: String,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Hostile {
    fn drop(&mut self) {
        // A failed test may not have connected.
        if std::thread::panicking() {
            return;
        }
        if let Some(thread) = self.thread.take() {
            assert!(thread.join().is_ok(), "the hostile server failed");
        }
    }
}

/// Runs `act` with the first connection. Reads of the server end after five seconds, so that no
/// test hangs.
pub fn raw(act: impl FnOnce(TcpStream) + Send + 'static) -> Hostile {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("ws://{}", listener.local_addr().unwrap());
    let thread = std::thread::spawn(move || {
        let (socket, _) = listener.accept().unwrap();
        socket.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
        act(socket);
    });
    Hostile { url, thread: Some(thread) }
}

/// [`raw`] after a WebSocket handshake.
pub fn web(act: impl FnOnce(WebSocket<TcpStream>) + Send + 'static) -> Hostile {
    raw(|socket| act(tungstenite::accept(socket).unwrap()))
}

/// [`web`] after empty metadata and a request; `act` gets the socket.
pub fn after_request(act: impl FnOnce(WebSocket<TcpStream>) + Send + 'static) -> Hostile {
    web(|mut socket| {
        socket.send(Message::Binary(pack(&Map::new()).unwrap().into())).unwrap();
        while !matches!(socket.read().unwrap(), Message::Binary(_)) {}
        act(socket);
    })
}

/// Answers the first request with `reply` and waits until the client closes.
pub fn replies(reply: Vec<u8>) -> Hostile {
    after_request(|mut socket| {
        socket.send(Message::Binary(reply.into())).unwrap();
        linger(&mut socket);
    })
}

/// Reads until the client closes.
pub fn linger(socket: &mut WebSocket<TcpStream>) {
    while socket.read().is_ok() {}
}

/// Reads the head of an HTTP request.
pub fn head(socket: &mut TcpStream) {
    let (mut seen, mut byte) = (Vec::new(), [0]);
    while !seen.ends_with(b"\r\n\r\n") {
        if socket.read(&mut byte).unwrap() == 0 {
            return;
        }
        seen.push(byte[0]);
    }
}

/// Answers the handshake with `bytes`.
pub fn answers(bytes: &'static [u8]) -> Hostile {
    raw(|mut socket| {
        head(&mut socket);
        socket.write_all(bytes).unwrap();
    })
}

/// An endpoint with short timeouts.
pub fn endpoint(url: &str) -> Endpoint {
    let mut endpoint = Endpoint::new(url);
    endpoint.timeouts.connect = Duration::from_millis(400);
    endpoint.timeouts.infer = Duration::from_millis(400);
    endpoint.retry.attempts = 1;
    endpoint
}

/// A small observation with all kinds of values.
pub fn observation() -> Observation {
    let pixels: Vec<u8> = (0..4 * 5 * 3).collect();
    let images = Map::from([("cam_high".to_owned(), Array::from_u8(&[4, 5, 3], pixels).unwrap().into())]);
    Map::from([
        ("images".to_owned(), Value::from(images)),
        ("observation/state".to_owned(), Array::from_f32(&[3], &[0.5, -1.0, 2.25]).unwrap().into()),
        ("observation/wrench".to_owned(), Array::from_f64(&[2, 1], &[1e-300, -0.1]).unwrap().into()),
        ("prompt".to_owned(), "lift the appendix \u{2014} slowly".into()),
        ("step".to_owned(), 300.into()),
        ("time".to_owned(), 0.25.into()),
        ("training".to_owned(), false.into()),
    ])
}

/// MessagePack of text of less than 32 bytes.
pub fn text(text: &str) -> Vec<u8> {
    [&[0xa0 | text.len() as u8][..], text.as_bytes()].concat()
}

/// MessagePack of less than 65536 bytes.
pub fn bin(bytes: &[u8]) -> Vec<u8> {
    [&[0xc5][..], &(bytes.len() as u16).to_be_bytes(), bytes].concat()
}

/// MessagePack of a map of packed entries.
pub fn map(entries: &[(Vec<u8>, Vec<u8>)]) -> Vec<u8> {
    let mut bytes = vec![0x80 | entries.len() as u8];
    entries.iter().for_each(|(k, v)| bytes.extend([k.as_slice(), v].concat()));
    bytes
}

/// An array as openpi writes it.
pub fn array(dtype: Vec<u8>, shape: &[u8], data: &[u8]) -> Vec<u8> {
    let shape = [&[0x90 | shape.len() as u8][..], shape].concat();
    let entries =
        [(bin(b"__ndarray__"), vec![0xc3]), (bin(b"data"), bin(data)), (bin(b"dtype"), dtype), (bin(b"shape"), shape)];
    map(&entries)
}

/// A reply with `value` as its field `actions`.
pub fn actions(value: Vec<u8>) -> Vec<u8> {
    map(&[(text("actions"), value)])
}

/// Little-endian single precision.
pub fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}
