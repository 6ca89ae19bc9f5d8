//! The value of `--policy`: a name and the source of the policy. Neither shows secrets.

use serde::{Deserialize, Serialize};
use trocar_remote::Endpoint;
use trocar_task::policy::POLICIES;
use trocar_workflow::{Error, Result};
use xxhash_rust::xxh3::xxh3_64;

/// A policy as the user names it: `scripted`, `ws://HOST:PORT`, `python:MODULE:NAME` or
/// `python:FILE.py:NAME`, or `NAME=` and one of those.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PolicySpec {
    /// Its name in tables and folders. A server without a given name has its scheme, host and port.
    pub name: String,
    /// Its source. The address of a server may have a secret after its `?` or `#`, which no file of
    /// the campaign shows.
    pub source: String,
}

impl PolicySpec {
    /// Parses the value of `--policy`.
    ///
    /// # Errors
    /// A text that is no policy, an address that is invalid, needs another build, or has a
    /// password.
    pub fn parse(text: &str) -> Result<Self> {
        let (name, source) = match text.split_once('=') {
            Some((name, source)) if !name.contains([':', '/']) => (Some(name), source),
            _ => (None, text),
        };
        let wrong = |shown: &str, why: &str| Err(Error::Mismatch(format!("--policy {shown:.80}: {why}")));
        let (shown, unnamed) = if is_address(source) {
            let (address, place) = (without_query(source), place(source));
            if place.contains('@') {
                // Neither is shown, because either may be the secret.
                let scheme = scheme(source);
                return wrong(
                    scheme,
                    "an address cannot have a name or password before its host; a key goes into $TROCAR_POLICY_KEY",
                );
            }
            if let Err(why) = Endpoint::new(source).check() {
                return wrong(address, &why.to_string());
            }
            (address, format!("{}-{place}", scheme(source).trim_end_matches("://")))
        } else {
            (text, source.to_owned())
        };
        let known = is_address(source)
            || source.strip_prefix("python:").is_some_and(|p| p.contains(':'))
            || POLICIES.contains(&source);
        if !known {
            let names = POLICIES.join(", ");
            return wrong(
                shown,
                &format!(
                    "it must be one of {names}, ws://HOST:PORT, python:FILE.py:NAME or python:MODULE:NAME, or NAME= and one of those"
                ),
            );
        }
        let plain = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '-' };
        let name: String = name.unwrap_or(&unnamed).chars().map(plain).collect();
        if name.is_empty() || name.len() > 80 || name.starts_with('.') {
            return wrong(shown, "its name must have 1 to 80 characters and must not begin with a dot");
        }
        Ok(Self { name, source: source.to_owned() })
    }

    /// Whether the policy is that of a running server.
    pub(super) fn is_server(&self) -> bool {
        is_address(&self.source)
    }

    /// Whether the policy runs in another process: a server or a Python callable.
    pub(super) fn is_remote(&self) -> bool {
        self.source.contains(':')
    }

    /// Its source without secrets, for messages.
    pub(super) fn display_source(&self) -> &str {
        if is_address(&self.source) { without_query(&self.source) } else { &self.source }
    }

    /// The form for files. The part of an address after its `?` or `#` may be a token, so it is
    /// replaced by its hash, which still distinguishes policies.
    pub(super) fn redacted(&self) -> Self {
        let address = without_query(&self.source);
        let source = if is_address(&self.source) && address.len() < self.source.len() {
            format!("{address}?hidden-{:016x}", xxh3_64(&self.source.as_bytes()[address.len() + 1..]))
        } else {
            self.source.clone()
        };
        Self { name: self.name.clone(), source }
    }

    /// Whether this is the policy `stored` of a file.
    pub(super) fn matches(&self, stored: &Self) -> bool {
        // Older files have the whole address.
        self.source == stored.source || self.redacted().source == stored.source
    }
}

fn is_address(source: &str) -> bool {
    source.starts_with("ws://") || source.starts_with("wss://")
}

/// `ws://` or `wss://`.
fn scheme(address: &str) -> &str {
    if address.starts_with("wss://") { "wss://" } else { "ws://" }
}

fn without_query(address: &str) -> &str {
    address.split(['?', '#']).next().unwrap_or("")
}

/// The part of an address between its scheme and its path: host and port, and any user name.
fn place(address: &str) -> &str {
    let rest = without_query(address).split_once("://").map_or("", |(_, rest)| rest);
    rest.split('/').next().unwrap_or("")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_fit_for_folders() {
        let name = |text| PolicySpec::parse(text).map(|p| (p.name, p.source));
        let pair = |a: &str, b: &str| (a.to_owned(), b.to_owned());
        assert_eq!(name("scripted").unwrap(), pair("scripted", "scripted"));
        assert_eq!(name("mine=ws://127.0.0.1:8000").unwrap(), pair("mine", "ws://127.0.0.1:8000"));
        // A path or a query may hold a token: neither is in a name.
        assert_eq!(name("ws://h:1/a?b=c").unwrap(), pair("ws-h-1", "ws://h:1/a?b=c"));
        assert_eq!(name("python:policies.lift:make").unwrap().1, "python:policies.lift:make");
        for bad in ["", "genius", "=scripted", "..=scripted", "python:lift"] {
            assert!(name(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn addresses_that_cannot_be_connected_to_are_refused() {
        for (bad, why) in [
            ("ws://", "host"),
            ("a=ws://:8000", "host"),
            ("ws://h:0", "port"),
            ("ws://h:99999", "url"),
            ("ws://two words", "url"),
        ] {
            let said = PolicySpec::parse(bad).unwrap_err().to_string();
            assert!(said.contains(why), "{bad}: {said}");
        }
        // Unless this was built with encryption.
        if let Err(why) = PolicySpec::parse("a=wss://h") {
            assert!(why.to_string().contains("rustls"), "{why}");
        }
    }

    #[test]
    fn secrets_are_in_no_name_no_file_and_no_message() {
        let secret = ["secret", "token"];
        for bad in ["ws://user:secret@h:1/?token=abc", "a=ws://user:secret@h", "ws://secret@h:0"] {
            let said = PolicySpec::parse(bad).unwrap_err().to_string();
            assert!(said.contains("TROCAR_POLICY_KEY") && secret.iter().all(|s| !said.contains(s)), "{bad}: {said}");
        }
        let said = PolicySpec::parse("ws://h:0/?secret").unwrap_err().to_string();
        assert!(!said.contains("secret"), "{said}");
        let spec = PolicySpec::parse("ws://h:1/a?token=secret").unwrap();
        let stored = spec.redacted();
        assert!(secret.iter().all(|s| !format!("{stored:?}").contains(s)), "{stored:?}");
        assert!(spec.matches(&stored) && spec.matches(&spec));
        let fragment = PolicySpec::parse("ws://h:1/a#secret").map(|spec| format!("{:?}", spec.redacted()));
        assert!(fragment.is_ok_and(|stored| !stored.contains("secret")));
        let other = PolicySpec::parse("ws://h:1/a?token=other").unwrap();
        assert!(!other.matches(&stored), "another query is another policy");
    }
}
