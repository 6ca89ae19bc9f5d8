//! The head of a request, read with limits, and plain answers.

use crate::inbox::lock;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Greatest head of a request (bytes).
const MAX_HEAD: usize = 8192;
/// Most header lines.
const MAX_HEADERS: usize = 48;
/// How long a head may take.
const HEAD_TIME: Duration = Duration::from_secs(5);
/// How long an answer may take.
const ANSWER_TIME: Duration = Duration::from_secs(20);

/// Sources that pages may load: everything from here, and nothing from elsewhere.
const POLICY: &str = "default-src 'self'; img-src 'self' blob: data:; connect-src 'self' ws:; media-src blob:; \
     worker-src 'self' blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The head of a request.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Head {
    pub method: String,
    pub path: String,
    pub query: String,
    pub headers: Vec<(String, String)>,
    /// Bytes after the head.
    pub rest: Vec<u8>,
}

impl Head {
    /// Reads a head.
    ///
    /// # Errors
    /// The status to answer, and why.
    pub fn read(stream: &mut TcpStream) -> Result<Self, (u16, String)> {
        let end = Instant::now() + HEAD_TIME;
        let mut bytes = Vec::with_capacity(1024);
        let mut part = [0_u8; 2048];
        loop {
            let left = end.saturating_duration_since(Instant::now());
            if left == Duration::ZERO {
                return Err((408, "the request took too long".to_owned()));
            }
            let gone = |e: std::io::Error| (408, e.to_string());
            stream.set_read_timeout(Some(left)).map_err(gone)?;
            let count = stream.read(&mut part).map_err(gone)?;
            if count == 0 {
                return Err((400, "the request ended early".to_owned()));
            }
            bytes.extend_from_slice(&part[..count]);
            if let Some(head) = Self::parse(&bytes)? {
                return Ok(head);
            }
            if bytes.len() > MAX_HEAD {
                return Err((431, format!("the request's head has more than {MAX_HEAD} bytes")));
            }
        }
    }

    /// A head from its first bytes; `None` if more have to come.
    fn parse(bytes: &[u8]) -> Result<Option<Self>, (u16, String)> {
        let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
        let mut request = httparse::Request::new(&mut headers);
        let end = match request.parse(bytes) {
            Ok(httparse::Status::Complete(end)) => end,
            Ok(httparse::Status::Partial) => return Ok(None),
            Err(why) => return Err((400, format!("the request is no HTTP: {why}"))),
        };
        let target = request.path.unwrap_or("");
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        let text =
            |h: &httparse::Header<'_>| Some((h.name.to_ascii_lowercase(), String::from_utf8(h.value.to_vec()).ok()?));
        let Some(headers) = request.headers.iter().map(text).collect() else {
            return Err((400, "a header is no text".to_owned()));
        };
        Ok(Some(Self {
            method: request.method.unwrap_or("").to_owned(),
            path: path.to_owned(),
            query: query.to_owned(),
            headers,
            rest: bytes[end..].to_vec(),
        }))
    }

    /// The value of a header, by its name in lower case.
    pub fn header(&self, name: &str) -> Option<&str> {
        self.headers.iter().find(|(n, _)| n == name).map(|(_, v)| v.trim())
    }

    /// A value of the query.
    pub fn query(&self, name: &str) -> Option<&str> {
        self.query.split('&').filter_map(|pair| pair.split_once('=')).find(|(n, _)| *n == name).map(|(_, v)| v)
    }

    /// Whether the request came to this machine by one of its own names, and from a page of the
    /// same address if from any: pages of others get nothing, also where they make a name of
    /// theirs point here.
    pub fn is_local(&self) -> bool {
        let Some(host) = self.header("host") else { return false };
        let name = if host.starts_with('[') {
            host.split_once(']').map_or("", |(name, _)| &name[1..])
        } else {
            host.split_once(':').map_or(host, |(name, _)| name)
        };
        let own = ["127.0.0.1", "localhost", "::1"].iter().any(|n| name.eq_ignore_ascii_case(n));
        let same = |origin: &str| origin.strip_prefix("http://").is_some_and(|from| from.eq_ignore_ascii_case(host));
        own && self.header("origin").is_none_or(same)
    }
}

/// Answers a request and ends it. An answer that cannot be sent is lost.
pub(crate) fn answer(stream: &mut TcpStream, status: u16, kind: &str, body: &[u8]) {
    let word = match status {
        200 => "OK",
        400 => "Bad Request",
        401 => "Unauthorized",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        408 => "Request Timeout",
        431 => "Request Header Fields Too Large",
        _ => "Service Unavailable",
    };
    let head = format!(
        "HTTP/1.1 {status} {word}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nConnection: close\r\n\
         Cache-Control: no-cache\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
         Content-Security-Policy: {POLICY}\r\n\r\n",
        body.len()
    );
    let mut timed = Timed { stream, end: Instant::now() + ANSWER_TIME };
    let _ = timed.write_all(head.as_bytes()).and_then(|()| timed.write_all(body)).and_then(|()| timed.flush());
}

/// Answers with a line of text.
pub(crate) fn refuse(stream: &mut TcpStream, status: u16, why: &str) {
    answer(stream, status, "text/plain; charset=utf-8", format!("{why}\n").as_bytes());
}

/// Writes until a time, however slowly the other side reads.
pub(crate) struct Timed<'a> {
    pub stream: &'a mut TcpStream,
    pub end: Instant,
}

impl Write for Timed<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let left = self.end.saturating_duration_since(Instant::now());
        if left == Duration::ZERO {
            return Err(std::io::ErrorKind::TimedOut.into());
        }
        self.stream.set_write_timeout(Some(left))?;
        self.stream.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.stream.flush()
    }
}

/// Counts what is under way, up to a limit.
#[derive(Default)]
pub(crate) struct Counter(Mutex<usize>);

impl Counter {
    /// One more, if there are fewer than `most`.
    pub fn enter(&self, most: usize) -> bool {
        let mut count = lock(&self.0);
        let free = *count < most;
        *count += usize::from(free);
        free
    }

    /// One fewer.
    pub fn leave(&self) {
        let mut count = lock(&self.0);
        *count = count.saturating_sub(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head(lines: &str) -> Head {
        Head::parse(format!("{lines}\r\n\r\nrest").as_bytes()).unwrap().unwrap()
    }

    #[test]
    fn heads_are_read() {
        let got = head("GET /wire/1?token=ab&x=1 HTTP/1.1\r\nHost: localhost:1\r\nUpgrade: WebSocket");
        assert_eq!((got.path.as_str(), got.query("token"), got.query("y")), ("/wire/1", Some("ab"), None));
        assert_eq!((got.header("upgrade"), got.rest.as_slice()), (Some("WebSocket"), &b"rest"[..]));
        assert_eq!(Head::parse(b"GET / HTTP/1.1\r\nHost").unwrap(), None);
        assert!(Head::parse(b"\x16\x03\x01\x02\x00").is_err());
    }

    #[test]
    fn only_own_pages_are_local() {
        let local = |host: &str, origin: &str| {
            let origin = if origin.is_empty() { String::new() } else { format!("\r\nOrigin: {origin}") };
            head(&format!("GET / HTTP/1.1\r\nHost: {host}{origin}")).is_local()
        };
        assert!(local("127.0.0.1:8787", "") && local("localhost:9", "http://localhost:9") && local("[::1]:9", ""));
        assert!(!local("evil.example:8787", "") && !local("127.0.0.1:8787", "http://evil.example"));
        assert!(!local("127.0.0.1:8787", "http://127.0.0.1:8788") && !local("127.0.0.1:8787", "null"));
        assert!(!head("GET / HTTP/1.1").is_local());
    }
}
