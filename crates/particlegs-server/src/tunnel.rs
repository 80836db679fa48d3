//! The `ssh` command that forwards the page to the user's own machine.

use std::net::{IpAddr, UdpSocket};

/// The session that the command runs in.
#[derive(Clone, Copy, Debug)]
pub struct Session<'a> {
    /// `SSH_CONNECTION` of an SSH session: address and port of client and server.
    pub connection: Option<&'a str>,
    /// The user's name here.
    pub user: Option<&'a str>,
    /// The name of this machine.
    pub node: Option<&'a str>,
}

/// The `ssh` command to run on the user's own machine, after which `http://127.0.0.1:PORT/...` is this server; `None`
/// outside SSH sessions.
///
/// A batch system may pass the session's variables on to a compute node. The command then goes through the login machine.
pub fn line(session: Session<'_>, port: u16) -> Option<String> {
    line_from(session, port, |address| UdpSocket::bind((address, 0)).is_ok())
}

/// [`line()`] with `is_here`, which tells whether an address is this machine's.
fn line_from(session: Session<'_>, port: u16, is_here: impl Fn(IpAddr) -> bool) -> Option<String> {
    let server = session.connection?.split_whitespace().nth(2)?.parse::<IpAddr>().ok()?;
    let of_user = |host: &str| session.user.map_or(host.to_string(), |user| format!("{user}@{host}"));
    let login = of_user(&server.to_string());
    match session.node {
        Some(node) if !is_here(server) => {
            // `ssh -J` needs brackets around an IPv6 address.
            let jump = if server.is_ipv6() { of_user(&format!("[{server}]")) } else { login };
            Some(format!("ssh -J {jump} -L {port}:127.0.0.1:{port} {}", of_user(node)))
        }
        _ => Some(format!("ssh -L {port}:127.0.0.1:{port} {login}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn session(connection: Option<&str>) -> Session<'_> {
        Session { connection, user: Some("ada"), node: Some("node17") }
    }

    #[test]
    fn the_line_leads_to_where_the_user_logged_in() {
        let here = |s| line_from(s, 8317, |_| true);
        assert_eq!(here(session(None)), None);
        assert_eq!(here(session(Some("garbage"))), None);
        let ssh_connection = Some("203.0.113.9 51022 192.0.2.4 22");
        assert_eq!(here(session(ssh_connection)).as_deref(), Some("ssh -L 8317:127.0.0.1:8317 ada@192.0.2.4"));
        let nobody = Session { user: None, ..session(ssh_connection) };
        assert_eq!(here(nobody).as_deref(), Some("ssh -L 8317:127.0.0.1:8317 192.0.2.4"));
    }

    #[test]
    fn from_a_node_it_leads_over_the_login_machine() {
        let away = |c| line_from(session(Some(c)), 8317, |_| false);
        let over = away("203.0.113.9 51022 192.0.2.4 22");
        assert_eq!(over.as_deref(), Some("ssh -J ada@192.0.2.4 -L 8317:127.0.0.1:8317 ada@node17"));
        let over = away("2001:db8::1 51022 2001:db8::2 22");
        assert_eq!(over.as_deref(), Some("ssh -J ada@[2001:db8::2] -L 8317:127.0.0.1:8317 ada@node17"));
    }

    /// Loopback is an address of every machine, 192.0.2.4 (for documentation) of none.
    #[test]
    fn addresses_of_this_machine_are_told() {
        let line_for = |server: &str| line(session(Some(&format!("203.0.113.9 1 {server} 22"))), 1).unwrap();
        assert!(!line_for("127.0.0.1").contains("-J"));
        assert!(line_for("192.0.2.4").contains("-J"));
    }
}
