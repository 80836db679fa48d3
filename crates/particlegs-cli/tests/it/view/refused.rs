//! Refused requests: from other sites, with guessed tokens, huge and broken ones; and names with markup.

use super::serving::{HttpAnswer, TestServer};
use crate::common::spiral;
use serde_json::Value;
use std::io::Write;
use std::net::Shutdown;

#[test]
fn requests_without_the_token_find_nothing() {
    let dir = spiral();
    let serving = TestServer::new(&dir, |c| c.arg("spiral.pgs"));
    let (host, token) = serving.parts();
    let to = |path: &str, head: &str| {
        serving.raw(format!("GET {path} HTTP/1.1\r\n{head}Connection: close\r\n\r\n").as_bytes())
    };
    let host_header = format!("Host: {host}\r\n");
    let other = if token.ends_with("0/") { '1' } else { '0' };
    let wrong = format!("{}{other}/", &token[..token.len() - 2]);
    let below = "../ %2e%2e/ ../../etc/passwd model/../../../etc/passwd model/..%2f..%2fetc%2fpasswd model/ model/1 \
                 model/00 model/0/ model/-1 model/99999999999999999999999999 model/0%00 setup poster truth /";
    let below = below.split(' ').map(|path| format!("{token}{path}"));
    let beside = "/ // /favicon.ico /robots.txt /../ /..%2f /%2e%2e/%2e%2e/etc/passwd".split(' ').map(String::from);
    for path in &below.chain(beside).chain([wrong, format!("/{token}")]).collect::<Vec<_>>() {
        let answer = to(path, &host_header);
        assert_eq!(answer.status, 404, "{path}: {}", answer.text());
        assert!(!answer.text().contains(&token[1..token.len() - 1]), "{path}");
    }
    // Names of other sites, and their pages.
    for name in ["evil.example", &format!("127.0.0.1.evil.example{}", &host[9..]), "0.0.0.0", "192.0.2.1"] {
        let answer = to(token, &format!("Host: {name}\r\n"));
        assert_eq!(answer.status, 403, "{name}");
    }
    let two_hosts = format!("{host_header}Host: evil.example\r\n");
    for head in ["", "Host:\r\n", "Host: a b\r\n", "Host: 127.0.0.1:99999\r\n", &two_hosts] {
        assert_eq!(to(token, head).status, 400, "{head:?}");
    }
    for origin in ["null", "https://evil.example", "http://127.0.0.1:1", "file://"] {
        assert_eq!(to(token, &format!("{host_header}Origin: {origin}\r\n")).status, 403, "{origin}");
    }
    assert_eq!(to(&format!("http://evil.example{token}"), &host_header).status, 400);
    assert_eq!(to(token, &format!("{host_header}Origin: http://{host}\r\n")).status, 200);
    assert_eq!(to(token, &format!("Host: localhost{}\r\n", &host[9..])).status, 200);
    // Other methods.
    for method in ["POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "CONNECT", "BREW"] {
        let answer = serving.ask(method, "", "", b"");
        assert!([400, 405].contains(&answer.status), "{method}: {}", answer.status);
    }
    assert_eq!(serving.ask("POST", "", "", b"").header("allow"), Some("get, head"));
    // It still runs, and has reported the refused requests.
    assert_eq!(serving.get("").status, 200);
    let (code, _, said) = serving.end("-TERM");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("`--allow-host evil.example`"), "{said}");
    assert_eq!(said.matches("another site's page").count(), 1, "{said}");
}

#[test]
fn huge_and_broken_requests_are_refused() {
    let dir = spiral();
    let serving = TestServer::new(&dir, |c| c.args(["spiral.pgs", "--snapshot", "spiral"]));
    let (host, token) = serving.parts();
    let long = "x".repeat(1 << 20);
    for head in [
        format!("GET {token} HTTP/1.1\r\nHost: {host}\r\nX-Long: {long}\r\n\r\n"),
        format!("GET /{long} HTTP/1.1\r\nHost: {host}\r\n\r\n"),
        format!("GET {token} HTTP/1.1\r\nHost: {host}\r\n{}\r\n", "X-Many: y\r\n".repeat(5000)),
        "GET / SPDY/9\r\n\r\n".into(),
        "\0\u{1}\u{2}\r\n\r\n".into(),
    ] {
        let answer = serving.raw(head.as_bytes());
        assert!([0, 400, 414, 431].contains(&answer.status), "{}: {:?}", answer.status, &head[..40.min(head.len())]);
    }
    let json = "Content-Type: application/json\r\n";
    assert_eq!(serving.ask("POST", "truth", json, &vec![b' '; 1 << 20]).status, 413);
    // A length without the bytes.
    let promised = format!("POST {token}truth HTTP/1.1\r\nHost: {host}\r\n{json}Content-Length: 99999999999\r\n\r\n");
    let mut stream = serving.connect();
    stream.write_all(&[promised.as_bytes(), &vec![b' '; 20_000]].concat()).unwrap();
    assert_eq!(HttpAnswer::read(stream).status, 413);
    // A body that breaks off.
    let mut stream = serving.connect();
    let broken = format!("POST {token}truth HTTP/1.1\r\nHost: {host}\r\n{json}Content-Length: 9\r\n\r\n{{");
    stream.write_all(broken.as_bytes()).unwrap();
    stream.shutdown(Shutdown::Write).unwrap();
    assert!([0, 400].contains(&HttpAnswer::read(stream).status));
    assert_eq!(serving.ask("POST", "truth", "Content-Type: text/plain\r\n", b"{}").status, 415);
    assert_eq!(serving.ask("GET", "truth", "", b"").status, 405);
    assert_eq!(serving.get("").status, 200);
    assert_eq!(serving.end("-INT").0, Some(0));
}

#[test]
fn names_cannot_break_the_page() {
    let dir = spiral();
    let name = "<img src=x onerror=alert(1)> \"' & <!--<script> \u{202e}ü.pgs";
    std::fs::copy(dir.at("spiral.pgs"), dir.at(name)).unwrap();
    let serving = TestServer::new(&dir, |c| c.arg(name));
    let page = serving.get("");
    let html = page.text();
    assert!(!html.contains("<img src=x") && !html.contains("<!--<script>"), "{html}");
    let setup = html.split("id=\"setup\">").nth(1).unwrap().split("</script>").next().unwrap();
    assert_eq!(serde_json::from_str::<Value>(setup).unwrap()["models"][0]["name"], name);
    assert_eq!(serving.get("model/0").status, 200);
}
