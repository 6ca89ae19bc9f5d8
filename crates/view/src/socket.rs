//! One client: a thread that reads what it sends, and one that writes what it gets.

use crate::frame::Has;
use crate::http::Timed;
use crate::hub::Hub;
use crate::inbox::{Request, Wish};
use crate::outbox::{Client, Next, Outgoing};
use crate::protocol::{MAX_ERRORS, MAX_MESSAGE, MAX_RATE, Mistake, Said, done, error, parse};
use serde_json::json;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Message, WebSocket};

/// Time between pings, and the silence after which a client counts as disconnected.
const PING_EVERY: Duration = Duration::from_secs(2);
const SILENCE: Duration = Duration::from_secs(6);
/// How long a message may take to be written.
const WRITE_TIME: Duration = Duration::from_secs(4);

/// The reading side of a socket. It discards the protocol's own replies, because only the writer
/// may write.
struct ReadOnly(TcpStream);

impl Read for ReadOnly {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        self.0.read(bytes)
    }
}

impl Write for ReadOnly {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// The writing side of a socket, one message at a time.
struct WriteOnly {
    stream: TcpStream,
    end: Instant,
}

impl Read for WriteOnly {
    fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
        Err(std::io::ErrorKind::WouldBlock.into())
    }
}

impl Write for WriteOnly {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        Timed { stream: &mut self.stream, end: self.end }.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.stream.flush()
    }
}

/// Serves a client after its handshake until it disconnects; `rest` came with the handshake.
pub(crate) fn serve(stream: &TcpStream, rest: Vec<u8>, client: &Arc<Client>, hub: &Arc<Hub>) {
    let writer = stream.try_clone().and_then(|own| {
        let client = Arc::clone(client);
        std::thread::Builder::new().name("view-writer".to_owned()).spawn(move || write(own, &client))
    });
    if writer.is_ok() {
        read(stream, rest, client, hub);
    }
    client.close();
    if let Ok(writer) = writer {
        let _ = writer.join();
    }
    let _ = stream.shutdown(Shutdown::Both);
}

/// Sends what waits for the client. Ends the connection when it cannot be sent in time.
fn write(stream: TcpStream, client: &Client) {
    let shut = stream.try_clone();
    let config = WebSocketConfig::default().write_buffer_size(0);
    let mut web = WebSocket::from_raw_socket(WriteOnly { stream, end: Instant::now() }, Role::Server, Some(config));
    let (mut has, mut pinged) = (Has::default(), Instant::now());
    loop {
        web.get_mut().end = Instant::now() + WRITE_TIME;
        // A client that only listens has to say that it is there.
        if pinged.elapsed() >= PING_EVERY {
            pinged = Instant::now();
            if web.send(Message::Ping(Vec::new().into())).is_err() {
                break;
            }
        }
        let message = match client.next(PING_EVERY) {
            Next::Reply(Outgoing::Text(text)) => Message::text(&*text),
            Next::Reply(Outgoing::Pong(bytes)) => Message::Pong(bytes.to_vec().into()),
            Next::Reply(Outgoing::Binary(bytes)) => Message::binary(bytes.to_vec()),
            Next::Frame(frame, dropped, whole) => {
                Message::binary(frame.message(&mut has, client.wants().value, dropped, whole))
            }
            Next::Quiet => continue,
            Next::Closed => {
                web.get_mut().end = Instant::now() + Duration::from_millis(200);
                let _ = web.close(None);
                let _ = web.flush();
                break;
            }
        };
        web.get_mut().end = Instant::now() + WRITE_TIME;
        if web.send(message).is_err() {
            break;
        }
    }
    client.close();
    // Wakes the reader.
    if let Ok(stream) = shut {
        let _ = stream.shutdown(Shutdown::Both);
    }
}

/// Reads the client's messages until it disconnects, is silent, or is cut off.
fn read(stream: &TcpStream, rest: Vec<u8>, client: &Arc<Client>, hub: &Hub) {
    let Ok(own) = stream.try_clone() else { return };
    if own.set_read_timeout(Some(SILENCE)).is_err() {
        return;
    }
    let config = WebSocketConfig::default().max_message_size(Some(MAX_MESSAGE)).max_frame_size(Some(MAX_MESSAGE));
    let mut web = WebSocket::from_partially_read(ReadOnly(own), rest, Role::Server, Some(config));
    let (mut errors, mut second, mut count) = (0, Instant::now(), 0);
    loop {
        let text = match web.read() {
            Ok(Message::Text(text)) => text,
            Ok(Message::Ping(bytes)) => {
                client.reply(Outgoing::Pong(bytes.to_vec().into()));
                continue;
            }
            Ok(Message::Pong(_) | Message::Frame(_)) => continue,
            Ok(Message::Close(_)) => return,
            Ok(Message::Binary(_)) => {
                let why = "clients send text; binary messages come from the server".to_owned();
                client.reply(Outgoing::text(&error(None, &Mistake("type", why))));
                errors += 1;
                if errors > MAX_ERRORS {
                    return;
                }
                continue;
            }
            Err(tungstenite::Error::Capacity(_)) => {
                let why = format!("a message has more than {MAX_MESSAGE} bytes");
                client.reply(Outgoing::text(&error(None, &Mistake("size", why))));
                // The writer gets a moment to send it.
                std::thread::sleep(Duration::from_millis(50));
                return;
            }
            Err(_) => return,
        };
        count += 1;
        if second.elapsed() >= Duration::from_secs(1) {
            (second, count) = (Instant::now(), 0);
        }
        if count > MAX_RATE {
            let why = format!("more than {MAX_RATE} messages in a second");
            client.reply(Outgoing::text(&error(None, &Mistake("busy", why))));
            std::thread::sleep(Duration::from_millis(50));
            return;
        }
        let (number, said) = match parse(&text) {
            Ok(parsed) => parsed,
            Err((number, mistake)) => {
                client.reply(Outgoing::text(&error(number, &mistake)));
                errors += 1;
                if errors > MAX_ERRORS {
                    return;
                }
                continue;
            }
        };
        if let Err(mistake) = take(number, said, client, hub) {
            client.reply(Outgoing::text(&error(number, &mistake)));
        }
    }
}

/// Does what a message asks, or passes it on to the simulation.
fn take(number: Option<i64>, said: Said, client: &Arc<Client>, hub: &Hub) -> Result<(), Mistake> {
    if let Some(seat) = said.seat() {
        hub.check(client.id, seat)?;
    }
    if let Some((arm, command)) = said.command() {
        hub.command(arm, command, client.id);
        return Ok(());
    }
    let wish = match said {
        Said::Subscribe(wants) => {
            hub.subscribe(client, wants);
            return acknowledge(number, client);
        }
        Said::Seats { take, give } => {
            hub.sit(client.id, &take, &give)?;
            return acknowledge(number, client);
        }
        Said::Release { arm } => {
            hub.let_go(arm);
            return acknowledge(number, client);
        }
        Said::Ping { time_s } => {
            client.reply(Outgoing::text(&json!({"type": "pong", "request": number, "time_s": time_s})));
            return Ok(());
        }
        Said::Play {} => Wish::Play,
        Said::Pause {} => Wish::Pause,
        Said::Step { periods } => Wish::Step(periods),
        Said::Speed { factor } => Wish::Speed(factor),
        Said::Reset { seed, policy } => Wish::Reset { seed, policy },
        Said::Seek { time_s } => Wish::Seek(time_s),
        Said::Open { episode } => Wish::Open(episode),
        Said::Live {} => Wish::Live,
        Said::Record { action } => Wish::Record(action),
        Said::HandBack { arm } => Wish::HandBack(arm),
        Said::History { channels, from_s } => Wish::History { channels, from_s },
        Said::Picture { camera, width, height, quality } => Wish::Picture { camera, size: [width, height], quality },
        Said::Table {} => Wish::Table,
        Said::ServoCr { .. } | Said::ServoCp { .. } | Said::ServoJp { .. } | Said::ServoJaw { .. } => return Ok(()),
    };
    if hub.inbox.push(Request { client: client.id, number, wish }) {
        return Ok(());
    }
    Err(Mistake("busy", "too many requests wait; send fewer".to_owned()))
}

fn acknowledge(number: Option<i64>, client: &Client) -> Result<(), Mistake> {
    // Whoever gave no number wants no answer.
    if number.is_some() {
        client.reply(Outgoing::text(&done(number)));
    }
    Ok(())
}
