//! Misbehaving servers: each gives its own error of one line, in time.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests, which print the errors")]

mod common;

use common::{after_request, answers, endpoint, linger, observation, raw, replies, web};
use rand_pcg::Pcg64Mcg;
use std::io::Write;
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use trocar_remote::{Array, Client, Endpoint, Error, Loopback, LoopbackOptions, Map, Value, pack};
use tungstenite::Message;
use tungstenite::protocol::{CloseFrame, frame::coding::CloseCode};

/// The error of a connection with one request. Checks that it is one line and comes in time.
fn fails(endpoint: &Endpoint) -> Error {
    let start = Instant::now();
    let e = Client::connect(endpoint).and_then(|mut client| client.infer(&observation())).unwrap_err();
    assert!(start.elapsed() < Duration::from_millis(1500), "{e}: {:?}", start.elapsed());
    let line = e.to_string();
    assert!(!line.contains('\n') && line.len() < 1000, "{line}");
    println!("{line}");
    e
}

fn error(server: &common::Hostile) -> Error {
    fails(&endpoint(&server.url))
}

#[test]
fn invalid_endpoints_are_refused() {
    let field = |endpoint: &Endpoint| match fails(endpoint) {
        Error::Endpoint { field, .. } => field,
        e => panic!("{e}"),
    };
    for url in ["", "http://127.0.0.1:1", "ws://", "ws://host:99999", "ws://a b", "wsx://127.0.0.1"] {
        assert_eq!(field(&endpoint(url)), "url", "{url}");
    }
    if cfg!(not(feature = "rustls")) {
        assert_eq!(field(&endpoint("wss://127.0.0.1:1")), "url");
    }
    let mut bad = endpoint("127.0.0.1:1");
    bad.api_key = Some("two\nlines".into());
    assert_eq!(field(&bad), "api_key");
    let mut secret = endpoint("ws://me:password@127.0.0.1:1");
    secret.api_key = Some("hidden".into());
    assert!(!format!("{secret:?} {}", fails(&secret)).contains("hidden"));
    assert!(!format!("{secret:?} {}", fails(&secret)).contains("password"));
}

#[test]
fn a_missing_server_is_tried_again() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = listener.local_addr().unwrap().to_string();
    drop(listener);
    let mut endpoint = endpoint(&url);
    endpoint.retry.attempts = 3;
    endpoint.retry.first_pause = Duration::from_millis(100);
    let start = Instant::now();
    assert!(matches!(fails(&endpoint), Error::CannotConnect { .. }));
    // 100 ms and 200 ms between three attempts.
    assert!(start.elapsed() > Duration::from_millis(290));
    assert!(matches!(
        fails(&common::endpoint("ws://no-such-host.invalid")),
        Error::CannotConnect { .. } | Error::TimedOut { .. }
    ));
}

#[test]
fn a_server_that_starts_late_is_found() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    drop(listener);
    let thread = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(150));
        let (socket, _) = TcpListener::bind(address).unwrap().accept().unwrap();
        let mut socket = tungstenite::accept(socket).unwrap();
        socket.send(Message::Binary(pack(&Map::new()).unwrap().into())).unwrap();
        linger(&mut socket);
    });
    let mut endpoint = endpoint(&address.to_string());
    endpoint.retry.attempts = 10;
    endpoint.retry.first_pause = Duration::from_millis(20);
    drop(Client::connect(&endpoint).unwrap());
    thread.join().unwrap();
}

#[test]
fn keys_are_checked() {
    let options = LoopbackOptions { api_key: Some("right".into()), ..LoopbackOptions::default() };
    let server = Loopback::start(&options, |_| Ok(Map::new())).unwrap();
    for key in [None, Some("wrong")] {
        let mut endpoint = endpoint(&server.url());
        endpoint.api_key = key.map(str::to_owned);
        match fails(&endpoint) {
            Error::KeyRefused { reason, .. } => {
                assert_eq!(reason.contains("no key was sent"), key.is_none(), "{reason}");
            }
            e => panic!("{e}"),
        }
    }
    let mut endpoint = endpoint(&server.url());
    endpoint.api_key = Some("right".into());
    assert!(Client::connect(&endpoint).is_ok());
    let polite = web(|mut socket| {
        socket.close(Some(CloseFrame { code: CloseCode::Policy, reason: "bad key".into() })).unwrap();
        linger(&mut socket);
    });
    assert!(matches!(error(&polite), Error::KeyRefused { .. }));
}

#[test]
fn other_servers_are_handshake_errors() {
    let bad: [&[u8]; 5] = [
        b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n",
        b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nOK",
        b"HTTP/1.1 301 Moved\r\nLocation: http://127.0.0.1/\r\nContent-Length: 0\r\n\r\n",
        b"SSH-2.0-OpenSSH_9.6\r\n\r\n",
        b"",
    ];
    for bytes in bad {
        let e = error(&answers(bytes));
        assert!(matches!(e, Error::Handshake { .. }), "{e}");
    }
    let busy = error(&answers(b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\n\r\n"));
    assert!(matches!(busy, Error::CannotConnect { .. }), "{busy}");
    let endless = raw(|mut socket| {
        let _ = socket.write_all(b"HTTP/1.1 101 Switching\r\n");
        while socket.write_all(&[b'a'; 4096]).is_ok() {}
    });
    assert!(matches!(error(&endless), Error::Handshake { .. }));
    let metadata = web(|mut socket| {
        socket.send(Message::Binary(vec![0x90].into())).unwrap();
        linger(&mut socket);
    });
    assert!(matches!(error(&metadata), Error::WrongField { .. }));
}

#[test]
fn tracebacks_are_shown_by_their_last_line() {
    const TRACEBACK: &str = "Traceback (most recent call last):\n  File \"serve.py\", line 3, in infer\n    raise\nValueError: bad \u{1b}[31mshape\n";
    let check = |e: Error| match e {
        Error::Server { last, traceback, .. } => {
            assert_eq!(traceback, TRACEBACK);
            assert_eq!(last, "ValueError: bad  [31mshape (File \"serve.py\", line 3, in infer)");
        }
        e => panic!("{e}"),
    };
    check(error(&after_request(|mut socket| {
        socket.send(Message::text(TRACEBACK)).unwrap();
        linger(&mut socket);
    })));
    check(error(&web(|mut socket| {
        socket.send(Message::text(TRACEBACK)).unwrap();
        linger(&mut socket);
    })));
    let long = after_request(|mut socket| {
        socket.send(Message::text("\u{fc}\n".repeat(1 << 20) + &"x".repeat(1 << 20))).unwrap();
        linger(&mut socket);
    });
    assert!(matches!(error(&long), Error::Server { traceback, .. } if traceback.len() <= 64 << 10));
}

#[test]
fn closed_connections_are_errors() {
    assert!(matches!(error(&raw(drop)), Error::Handshake { .. } | Error::Closed { .. }));
    assert!(matches!(error(&web(drop)), Error::Closed { what: "the server's metadata", .. }));
    assert!(matches!(error(&after_request(drop)), Error::Closed { what: "a reply", .. }));
    let polite = after_request(|mut socket| {
        let reason = "Internal server error.".into();
        socket.close(Some(CloseFrame { code: CloseCode::Error, reason })).unwrap();
        linger(&mut socket);
    });
    match error(&polite) {
        Error::Closed { reason, .. } => assert_eq!(reason, "1011 Internal server error."),
        e => panic!("{e}"),
    }
}

#[test]
fn waits_end_at_a_deadline() {
    let pause = || std::thread::sleep(Duration::from_millis(700));
    let whats = [
        (raw(move |_socket| pause()), "the WebSocket handshake"),
        (web(move |_socket| pause()), "the server's metadata"),
        (after_request(move |_socket| pause()), "a reply"),
        // A byte now and then: never idle, never complete.
        (
            raw(|mut socket| {
                for byte in b"HTTP/1.1 101 Switching Protocols\r\n" {
                    if socket.write_all(&[*byte]).is_err() {
                        return;
                    }
                    std::thread::sleep(Duration::from_millis(50));
                }
            }),
            "the WebSocket handshake",
        ),
        (
            after_request(|mut socket| {
                let socket = socket.get_mut();
                let _ = socket.write_all(&[0x82, 126, 0x40, 0]);
                while socket.write_all(&[0xc0]).is_ok() {
                    std::thread::sleep(Duration::from_millis(50));
                }
            }),
            "a reply",
        ),
        // Pings are not a reply.
        (after_request(|mut socket| while socket.send(Message::Ping(vec![1].into())).is_ok() {}), "a reply"),
    ];
    for (server, expected) in whats {
        match error(&server) {
            Error::TimedOut { what, seconds, .. } => assert_eq!((what, seconds), (expected, 0.4)),
            e => panic!("{expected}: {e}"),
        }
    }
}

#[test]
fn a_server_that_reads_nothing_times_out() {
    let server = web(|mut socket| {
        socket.send(Message::Binary(pack(&Map::new()).unwrap().into())).unwrap();
        std::thread::sleep(Duration::from_millis(900));
    });
    let mut client = Client::connect(&endpoint(&server.url)).unwrap();
    let large = Map::from([("image".to_owned(), Array::from_u8(&[64 << 20], vec![0; 64 << 20]).unwrap().into())]);
    let start = Instant::now();
    let e = client.infer(&large).unwrap_err();
    assert!(matches!(e, Error::TimedOut { .. }), "{e}");
    assert!(start.elapsed() < Duration::from_millis(1500), "{:?}", start.elapsed());
}

#[test]
fn wrong_frames_are_protocol_errors() {
    // Reserved bits; an unknown opcode; a masked frame; a fragmented ping; a continuation without a
    // start; text that is not UTF-8.
    let frames: [&[u8]; 6] = [
        &[0xf2, 1, 0xc0],
        &[0x83, 1, 0xc0],
        &[0x82, 0x81, 1, 2, 3, 4, 0xc1],
        &[0x09, 0],
        &[0x80, 1, 0xc0],
        &[0x81, 2, 0xc3, 0x28],
    ];
    for frame in frames {
        let server = after_request(move |mut socket| {
            socket.get_mut().write_all(frame).unwrap();
            linger(&mut socket);
        });
        let e = error(&server);
        assert!(matches!(e, Error::Protocol { .. }), "{frame:?}: {e}");
    }
}

#[test]
fn damaged_streams_give_errors() {
    let good = [
        &[0x82, 1, 0x80, 0x82, 126, 0, 60][..],
        &common::actions(common::array(common::text("<f4"), &[1, 2], &common::floats(&[1.0, 2.0]))),
    ]
    .concat();
    let seeds = [("stream".to_owned(), good)];
    for case in 0..300 {
        let bytes = trocar_testing::damage(&seeds[0].1, &seeds, &mut Pcg64Mcg::new(case));
        let server = web(move |mut socket| {
            // The client may have closed before everything is written.
            let _ = socket.get_mut().write_all(&bytes);
        });
        if let Err(e) = Client::connect(&endpoint(&server.url)).and_then(|mut c| c.infer(&observation())) {
            assert!(!e.to_string().contains('\n'), "{e}");
        }
    }
}

#[test]
fn a_message_without_a_request_is_not_a_reply() {
    let server = web(|mut socket| {
        let reply = common::actions(common::array(common::text("<f4"), &[1, 1], &common::floats(&[9.0])));
        socket.send(Message::Binary(pack(&Map::new()).unwrap().into())).unwrap();
        socket.send(Message::Binary(reply.into())).unwrap();
        linger(&mut socket);
    });
    let mut client = Client::connect(&endpoint(&server.url)).unwrap();
    std::thread::sleep(Duration::from_millis(50));
    let e = client.infer(&observation()).unwrap_err();
    assert!(matches!(e, Error::Protocol { .. } | Error::NotConnected { .. }), "{e}");
    let again = client.infer(&observation()).unwrap_err();
    assert!(matches!(&again, Error::NotConnected { reason, .. } if reason.contains("without a request")), "{again}");
    assert!(!client.is_connected());
}

#[test]
fn pings_between_requests_are_answered() {
    let server = web(|mut socket| {
        socket.send(Message::Binary(pack(&Map::new()).unwrap().into())).unwrap();
        socket.send(Message::Ping(b"there?".as_slice().into())).unwrap();
        match socket.read().unwrap() {
            Message::Pong(payload) => assert_eq!(&payload[..], b"there?"),
            other => panic!("{other}"),
        }
        linger(&mut socket);
    });
    let client = Client::connect(&endpoint(&server.url)).unwrap();
    std::thread::sleep(Duration::from_millis(1200));
    assert!(client.is_connected());
    drop(client);
}

#[test]
fn the_interruption_flag_ends_every_wait() {
    let flag = Arc::new(AtomicBool::new(false));
    let stop = Arc::clone(&flag);
    let server = after_request(move |mut socket| {
        stop.store(true, Ordering::Relaxed);
        linger(&mut socket);
    });
    let mut endpoint = endpoint(&server.url);
    endpoint.interrupt = Some(Arc::clone(&flag));
    endpoint.timeouts.infer = Duration::from_secs(60);
    assert_eq!(fails(&endpoint), Error::Interrupted);
    // Set before: nothing is started.
    let silent = raw(drop);
    endpoint.url = silent.url.clone();
    assert_eq!(fails(&endpoint), Error::Interrupted);
    let nobody = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    endpoint.url = nobody.to_string();
    endpoint.retry.attempts = 100;
    endpoint.retry.first_pause = Duration::from_secs(60);
    assert_eq!(fails(&endpoint), Error::Interrupted);
}

#[test]
fn only_a_reset_restores_a_lost_connection() {
    let mut calls = 0;
    let policy = move |_| {
        calls += 1;
        if calls == 2 {
            return Err("ValueError: no more".to_owned());
        }
        Ok(Map::from([("actions".to_owned(), Array::from_f32(&[1, 1], &[calls as f32]).unwrap().into())]))
    };
    let server = Loopback::start(&LoopbackOptions::default(), policy).unwrap();
    let mut client = Client::connect(&endpoint(&server.url())).unwrap();
    let first = client.infer(&observation()).unwrap();
    assert_eq!(first.actions.values(), [1.0]);
    assert!(first.server_ms.unwrap() >= 0.0 && first.round_trip_ms >= first.server_ms.unwrap());
    let e = client.infer(&observation()).unwrap_err();
    assert!(matches!(&e, Error::Server { last, .. } if last.contains("ValueError: no more")), "{e}");
    assert!(matches!(client.infer(&observation()), Err(Error::NotConnected { .. })));
    client.reset(&Map::new()).unwrap();
    assert_eq!(client.infer(&observation()).unwrap().actions.values(), [3.0]);
}

#[test]
fn wrong_replies_leave_the_connection_open() {
    let mut calls = 0;
    let policy = move |_| {
        calls += 1;
        let actions: Value = if calls == 1 { 7.into() } else { Array::from_f64(&[2, 1], &[1.0, 2.0]).unwrap().into() };
        Ok(Map::from([("actions".to_owned(), actions)]))
    };
    let server = Loopback::start(&LoopbackOptions::default(), policy).unwrap();
    let mut client = Client::connect(&endpoint(&server.url())).unwrap();
    assert!(matches!(client.infer(&observation()), Err(Error::WrongField { .. })));
    assert_eq!(client.infer(&observation()).unwrap().actions.horizon(), 2);
    // An observation that cannot be packed is not sent.
    let deep = (0..100).fold(Value::Nil, |inner, _| Value::List(vec![inner]));
    assert!(matches!(client.infer(&Map::from([("deep".to_owned(), deep)])), Err(Error::TooDeep { .. })));
    assert!(client.infer(&observation()).is_ok());
}

#[test]
fn each_kind_of_bad_reply_has_its_error() {
    let e = error(&replies(common::actions(common::array(common::text("|O"), &[1], b"\x80\x04pickle"))));
    assert!(matches!(&e, Error::WrongDtype { at, dtype, .. } if at.ends_with("reply/actions") && dtype == "|O"), "{e}");
    assert!(e.to_string().starts_with("ws://127.0.0.1:"), "{e}");
}

#[test]
fn a_server_that_sends_without_a_pause_is_an_error() {
    // Pings and empty fragments without end, before any request.
    for pieces in [&[0x89u8, 0x00][..], &[0x00, 0x00]] {
        let server = web(move |mut socket| {
            socket.send(Message::Binary(pack(&Map::new()).unwrap().into())).unwrap();
            let stream = socket.get_mut();
            if pieces[0] == 0 {
                // The start of a message.
                stream.write_all(&[0x02, 0x00]).unwrap();
            }
            let flood = pieces.repeat(4096);
            let start = Instant::now();
            while start.elapsed() < Duration::from_secs(3) && stream.write_all(&flood).is_ok() {}
        });
        let mut client = Client::connect(&endpoint(&server.url)).unwrap();
        std::thread::sleep(Duration::from_millis(50));
        let start = Instant::now();
        let error = client.infer(&observation()).unwrap_err();
        drop(client);
        assert!(start.elapsed() < Duration::from_millis(1500), "{error}: {:?}", start.elapsed());
        assert!(!error.to_string().contains('\n'), "{error}");
    }
}

#[test]
fn an_address_is_checked_without_a_connection_and_shows_no_secret() {
    assert_eq!(Endpoint::new("ws://user:secret@127.0.0.1:1/a?token=secret").check(), Ok(()));
    for bad in ["ws://", "ws://:1", "ws://user:secret@two words?secret", "http://user:secret@h", "ws://h:0?secret"] {
        let why = Endpoint::new(bad).check().unwrap_err();
        assert!(matches!(why, Error::Endpoint { field: "url", .. }), "{bad}: {why:?}");
        assert!(!why.to_string().contains("secret"), "{why}");
    }
    let mut endpoint = Endpoint::new("ws://h");
    endpoint.api_key = Some("secret\nsecret".to_owned());
    let why = endpoint.check().unwrap_err().to_string();
    assert!(why.contains("api_key") && !why.contains("secret"), "{why}");
}
