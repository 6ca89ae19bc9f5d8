//! What a user writes after `--policy`: a name and where the policy comes from, without secrets in either.

use serde::{Deserialize, Serialize};
use trocar_remote::Endpoint;
use trocar_task::policy::POLICIES;
use trocar_workflow::{Error, Result};
use xxhash_rust::xxh3::xxh3_64;

/// A policy of a campaign, by what the user wrote: `scripted`, `ws://HOST:PORT`, `python:MODULE:NAME` or `python:FILE.py:NAME`, or `NAME=` and one of those.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PolicySpec {
    /// Its name in tables and folders. A server's that was given none is its scheme, host and port.
    pub name: String,
    /// What it is. A server's address is whole: what stands after its `?` or `#` may be a secret, and is in no file of the campaign.
    pub source: String,
}

impl PolicySpec {
    /// # Errors
    /// Says what can be written: a text that is no policy, an address that cannot be connected to by this build or has a password in it.
    pub fn parse(text: &str) -> Result<Self> {
        let (name, source) = match text.split_once('=') {
            Some((name, source)) if !name.contains([':', '/']) => (Some(name), source),
            _ => (None, text),
        };
        let wrong = |shown: &str, why: &str| Err(Error::Mismatch(format!("--policy {shown:.80}: {why}")));
        let (shown, unnamed) = if is_address(source) {
            let (address, place) = (without_query(source), place(source));
            if place.contains('@') {
                // Neither is shown: which part is the secret is the user's to know.
                let scheme = scheme(source);
                return wrong(
                    scheme,
                    "an address cannot have a name or password before its host; a key goes into $TROCAR_POLICY_KEY",
                );
            }
            if let Err(why) = Endpoint::new(source).check() {
                return wrong(address, &why.to_string());
            }
            (address, format!("{}{place}", scheme(source)))
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

    /// Whether another process is the policy: a server or a Python callable.
    pub(super) fn is_remote(&self) -> bool {
        self.source.contains(':')
    }

    /// Its source for messages.
    pub(super) fn shown(&self) -> &str {
        if is_address(&self.source) { without_query(&self.source) } else { &self.source }
    }

    /// This as it stands in files. What an address has after its `?` or `#` may be a token: a hash of it is kept, which tells another policy from this one.
    pub(super) fn stored(&self) -> Self {
        let address = without_query(&self.source);
        let source = if is_address(&self.source) && address.len() < self.source.len() {
            format!("{address}?hidden-{:016x}", xxh3_64(&self.source.as_bytes()[address.len() + 1..]))
        } else {
            self.source.clone()
        };
        Self { name: self.name.clone(), source }
    }

    /// Whether this is the policy that a file calls `stored`.
    pub(super) fn is(&self, stored: &Self) -> bool {
        // The whole address is what older files have.
        self.source == stored.source || self.stored().source == stored.source
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

/// Host and port of an address, with what stands before them.
fn place(address: &str) -> &str {
    let rest = without_query(address).split_once("://").map_or("", |(_, rest)| rest);
    rest.split('/').next().unwrap_or("")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn policies_are_named_for_folders() {
        let name = |text| PolicySpec::parse(text).map(|p| (p.name, p.source));
        let pair = |a: &str, b: &str| (a.to_owned(), b.to_owned());
        assert_eq!(name("scripted").unwrap(), pair("scripted", "scripted"));
        assert_eq!(name("mine=ws://127.0.0.1:8000").unwrap(), pair("mine", "ws://127.0.0.1:8000"));
        // A path or a query may hold a token: neither is in a name.
        assert_eq!(name("ws://h:1/a?b=c").unwrap(), pair("ws---h-1", "ws://h:1/a?b=c"));
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
        let stored = spec.stored();
        assert!(secret.iter().all(|s| !format!("{stored:?}").contains(s)), "{stored:?}");
        assert!(spec.is(&stored) && spec.is(&spec));
        let fragment = PolicySpec::parse("ws://h:1/a#secret").map(|spec| format!("{:?}", spec.stored()));
        assert!(fragment.is_ok_and(|stored| !stored.contains("secret")));
        let other = PolicySpec::parse("ws://h:1/a?token=other").unwrap();
        assert!(!other.is(&stored), "another query is another policy");
    }
}
