//! Accepts only requests that name this server and come from its own page.
//!
//! A page of another site can make a browser send requests here. If that site's name resolves to this address (DNS
//! rebinding), the page can even read the responses. Such requests name the other site in Host or Origin.

use std::net::{IpAddr, Ipv6Addr};

/// The names that the server answers to.
#[derive(Clone, Debug)]
pub struct Guard {
    /// Whether other machines can reach it; it then answers to any address.
    widened: bool,
    /// Names besides those of loopback, in lower case.
    names: Vec<String>,
    /// Names of proxies whose pages may send requests, in lower case.
    proxies: Vec<String>,
}

/// Why a request is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// It names this other host, or none.
    Host(Option<String>),
    /// It comes from a page of another site.
    Origin,
}

impl Guard {
    /// `names` are the host's own, `proxies` those the user allows.
    pub fn new(widened: bool, names: impl IntoIterator<Item = String>, proxies: &[String]) -> Self {
        let lower = |name: String| name.trim_end_matches('.').to_ascii_lowercase();
        let proxies: Vec<String> = proxies.iter().cloned().map(lower).collect();
        let names = names.into_iter().map(lower).chain(proxies.iter().cloned()).collect();
        Guard { widened, names, proxies }
    }

    /// Checks the headers of a request; each occurs at most once.
    pub fn check(&self, host: Option<&str>, origin: Option<&str>) -> Result<(), Refusal> {
        let site = host.and_then(authority).ok_or(Refusal::Host(None))?;
        if !self.is_own(&site.name) {
            return Err(Refusal::Host(Some(site.name)));
        }
        let Some(origin) = origin else { return Ok(()) };
        let from = origin.split_once("://").and_then(|(scheme, rest)| {
            let known = if scheme == "http" { 80 } else { 443 };
            ["http", "https"].contains(&scheme).then_some((authority(rest)?, known))
        });
        match from {
            // Browsers leave out the usual port of the scheme, in Host and in Origin.
            Some((from, known)) if from.name == site.name && from.is_at(site.port.unwrap_or(known), known) => Ok(()),
            Some((from, _)) if self.proxies.contains(&from.name) => Ok(()),
            _ => Err(Refusal::Origin),
        }
    }

    fn is_own(&self, name: &str) -> bool {
        let address = name.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
        match address {
            // Unlike a name, an address cannot be made to point elsewhere.
            Ok(address) => self.widened || is_loopback(address) || self.names.iter().any(|n| n == name),
            Err(_) => name == "localhost" || self.names.iter().any(|n| n == name),
        }
    }
}

/// Whether the text is only a host's name or address.
pub fn is_name(text: &str) -> bool {
    authority(text).is_some_and(|a| a.port.is_none())
}

/// Whether only this machine can reach the address.
pub fn is_loopback(address: IpAddr) -> bool {
    match address {
        IpAddr::V4(v4) => v4.is_loopback(),
        IpAddr::V6(v6) => v6 == Ipv6Addr::LOCALHOST || v6.to_ipv4_mapped().is_some_and(|v4| v4.is_loopback()),
    }
}

/// A host and its port, as Host and Origin give them.
struct Authority {
    /// In lower case; an IPv6 address in its brackets.
    name: String,
    port: Option<u16>,
}

impl Authority {
    fn is_at(&self, port: u16, known: u16) -> bool {
        self.port.unwrap_or(known) == port
    }
}

fn authority(text: &str) -> Option<Authority> {
    // An IPv6 address has colons of its own, inside brackets.
    let colon = match text.rfind(']') {
        Some(end) if text.starts_with('[') => text[end..].find(':').map(|c| end + c),
        Some(_) => return None,
        None => text.find(':'),
    };
    let (name, port) = match colon {
        Some(at) => (&text[..at], Some(text[at + 1..].parse::<u16>().ok()?)),
        None => (text, None),
    };
    let plain = |c: char| c.is_ascii_alphanumeric() || "-._[]:".contains(c);
    let name = name.trim_end_matches('.').to_ascii_lowercase();
    (!name.is_empty() && name.chars().all(plain)).then_some(Authority { name, port })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn own() -> Guard {
        Guard::new(false, [], &[])
    }

    #[test]
    fn the_loopback_has_its_names_at_any_port() {
        // A tunnel may begin at another port than the server's.
        for host in ["127.0.0.1:8317", "localhost:9000", "LOCALHOST", "[::1]:8317", "127.1.2.3:1", "localhost.:8317"] {
            assert_eq!(own().check(Some(host), None), Ok(()), "{host}");
            assert_eq!(own().check(Some(host), Some(&format!("http://{host}"))), Ok(()), "{host}");
        }
    }

    #[test]
    fn other_names_are_other_sites() {
        let others =
            ["evil.example", "127.0.0.1.evil.example:8317", "localhost.evil.example", "10.0.0.7:8317", "node17"];
        for host in others {
            assert!(matches!(own().check(Some(host), None), Err(Refusal::Host(Some(_)))), "{host}");
        }
        for host in ["", ":8317", "a b", "user@127.0.0.1", "127.0.0.1:http", "[::1", "::1]:80", "127.0.0.1:99999"] {
            assert_eq!(own().check(Some(host), None), Err(Refusal::Host(None)), "{host}");
        }
        assert_eq!(own().check(None, None), Err(Refusal::Host(None)));
    }

    #[test]
    fn pages_of_other_sites_may_not_ask() {
        let host = Some("127.0.0.1:8317");
        let others = [
            "null",
            "https://evil.example",
            "http://127.0.0.1:3000",
            "http://localhost:8317",
            "file://",
            "http://127.0.0.1:8317.evil.example",
            "ftp://127.0.0.1:8317",
            "",
        ];
        for origin in others {
            assert_eq!(own().check(host, Some(origin)), Err(Refusal::Origin), "{origin}");
        }
    }

    #[test]
    fn a_name_is_not_a_url() {
        assert!(["hub.example.org", "node17", "192.0.2.1", "[2001:db8::1]"].into_iter().all(is_name));
        assert!(
            !["https://hub.example.org", "hub.example.org/user", "hub.example.org:443", "*", ""]
                .into_iter()
                .any(is_name)
        );
    }

    #[test]
    fn proxies_are_allowed_by_name() {
        let guard = Guard::new(true, ["node17.cluster".into()], &["Hub.Example.org".into()]);
        // jupyter-server-proxy passes on the browser's own Host ...
        assert_eq!(guard.check(Some("hub.example.org"), Some("https://hub.example.org")), Ok(()));
        // ... Open OnDemand names the node.
        assert_eq!(guard.check(Some("node17.cluster:8317"), Some("https://hub.example.org")), Ok(()));
        assert_eq!(guard.check(Some("10.0.0.7:8317"), Some("http://10.0.0.7:8317")), Ok(()));
        assert_eq!(guard.check(Some("node17.cluster:8317"), Some("https://evil.example")), Err(Refusal::Origin));
        assert!(guard.check(Some("node17.cluster.evil.example"), None).is_err());
        assert!(guard.check(Some("hub.example.org.evil.example"), None).is_err());
    }
}
