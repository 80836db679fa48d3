//! The running server, and a client that sends arbitrary bytes.

use crate::common::{TestFolder, process, signal, waited};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// The running server.
pub struct TestServer {
    pub child: Child,
    /// Its first output.
    pub url: String,
    rest: BufReader<std::process::ChildStdout>,
}

impl TestServer {
    pub fn new(dir: &TestFolder, prepare: impl FnOnce(&mut Command) -> &mut Command) -> Self {
        let mut command = process(dir.path());
        command.args(["view", "--port", "0"]);
        // No display, and nothing else from the session that runs the tests.
        for name in ["SSH_CONNECTION", "PARTICLEGS_TOKEN", "DISPLAY", "WAYLAND_DISPLAY", "WSL_DISTRO_NAME"] {
            command.env_remove(name);
        }
        if cfg!(not(target_os = "linux")) {
            command.arg("--no-open");
        }
        prepare(&mut command);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut rest = BufReader::new(child.stdout.take().unwrap());
        let mut url = String::new();
        rest.read_line(&mut url).unwrap();
        assert!(url.starts_with("http://"), "{url}");
        TestServer { child, url: url.trim().to_string(), rest }
    }

    /// `127.0.0.1:PORT`, and the path with the token.
    pub fn parts(&self) -> (&str, &str) {
        let rest = self.url.strip_prefix("http://").unwrap();
        rest.split_at(rest.find('/').unwrap())
    }

    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.parts().0).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        stream
    }

    /// Sends raw bytes and returns the answer.
    pub fn raw(&self, request: &[u8]) -> HttpAnswer {
        let mut stream = self.connect();
        // The server may refuse it before all is sent.
        let _ = stream.write_all(request);
        HttpAnswer::read(stream)
    }

    /// Requests a path behind the token, with extra headers.
    pub fn ask(&self, method: &str, path: &str, head: &str, body: &[u8]) -> HttpAnswer {
        self.raw(&self.request(method, path, head, body))
    }

    pub fn request(&self, method: &str, path: &str, head: &str, body: &[u8]) -> Vec<u8> {
        let (host, token) = self.parts();
        let host = if head.contains("Host:") { String::new() } else { format!("Host: {host}\r\n") };
        let start = format!(
            "{method} {token}{path} HTTP/1.1\r\n{host}Connection: close\r\nContent-Length: {}\r\n{head}\r\n",
            body.len()
        );
        [start.as_bytes(), body].concat()
    }

    pub fn get(&self, path: &str) -> HttpAnswer {
        self.ask("GET", path, "", b"")
    }

    pub fn truth(&self, question: &Value) -> HttpAnswer {
        self.raw(&self.question(question))
    }

    pub fn question(&self, question: &Value) -> Vec<u8> {
        let origin = format!("Content-Type: application/json\r\nOrigin: http://{}\r\n", self.parts().0);
        self.request("POST", "truth", &origin, question.to_string().as_bytes())
    }

    /// Ends it with a signal; returns the exit code and the output without the address.
    pub fn end(mut self, name: &str) -> (Option<i32>, String, String) {
        signal(&self.child, name);
        waited("the server to end", || self.child.try_wait().unwrap().is_some());
        let code = self.child.wait().unwrap().code();
        let (mut out, mut err) = (String::new(), String::new());
        self.rest.read_to_string(&mut out).unwrap();
        self.child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
        assert!(!err.contains("panicked"), "{err}");
        (code, out, err)
    }
}

impl Drop for TestServer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// An answer.
pub struct HttpAnswer {
    pub status: u16,
    /// In lower case.
    pub head: String,
    pub body: Vec<u8>,
}

impl HttpAnswer {
    pub fn read(mut stream: TcpStream) -> Self {
        let mut bytes = Vec::new();
        // The connection may be closed early.
        let _ = stream.read_to_end(&mut bytes);
        let end = bytes.windows(4).position(|w| w == b"\r\n\r\n").map_or(bytes.len(), |at| at + 4);
        let head = String::from_utf8(bytes[..end].to_vec()).unwrap();
        let status = head.get(9..12).map_or(0, |code| code.parse().unwrap());
        HttpAnswer { status, head: head.to_ascii_lowercase(), body: bytes[end..].to_vec() }
    }

    pub fn text(&self) -> &str {
        std::str::from_utf8(&self.body).unwrap()
    }

    pub fn header(&self, name: &str) -> Option<&str> {
        self.head.lines().find_map(|l| l.strip_prefix(name)?.strip_prefix(": "))
    }
}
