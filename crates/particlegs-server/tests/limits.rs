//! Limits for clients: silent clients, slow clients, many clients and no clients.

use particlegs_core::context::Context;
use particlegs_server::{Event, Limits, Options, Server, Token, ViewerContent};
use particlegs_view::page::PageOpening;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Barrier, Mutex};
use std::time::Duration;

const SHORT: Duration = Duration::from_millis(300);

fn limits() -> Limits {
    Limits { head: SHORT, body: SHORT, ..Limits::default() }
}

fn server(limits: Limits) -> Server {
    let (host, token) = ("127.0.0.1".into(), Token::random().unwrap());
    Server::bind(Options { host, port: Some(0), proxies: vec![], node: None, token, limits }).unwrap()
}

/// Serves one model, `model`, while `client` runs; returns the server's events.
fn while_serving(
    limits: Limits,
    poster: Option<&(dyn Fn(&[u8]) -> Option<Vec<u8>> + Sync)>,
    client: impl FnOnce(&Client) + Send,
) -> Vec<Event> {
    let server = server(limits);
    let urls = [server.url(), server.url_for_once().unwrap()];
    let address = format!("127.0.0.1:{}", server.port());
    let path = |url: &str| url.strip_prefix(&format!("http://{address}")).unwrap().to_string();
    let client_side = Client { path: path(&urls[0]), once: path(&urls[1]), address: address.clone() };
    let (stop, events) = (AtomicBool::new(false), Mutex::new(Vec::new()));
    let cancel = || stop.load(Ordering::Relaxed);
    std::thread::scope(|scope| {
        let talking = scope.spawn(|| {
            let _stop = StopGuard(&stop);
            client(&client_side);
        });
        let content = ViewerContent {
            models: vec![("m.pgs".into(), b"model".to_vec())],
            truth: None,
            opening: PageOpening::default(),
            poster,
        };
        server
            .serve(content, &Context::SILENT.with_cancel(&cancel), &|event| events.lock().unwrap().push(event))
            .unwrap();
        if let Err(panic) = talking.join() {
            std::panic::resume_unwind(panic);
        }
    });
    events.into_inner().unwrap()
}

/// Stops the server even if the client panics, so that a failing test ends.
struct StopGuard<'a>(&'a AtomicBool);

impl Drop for StopGuard<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

struct Client {
    address: String,
    path: String,
    once: String,
}

impl Client {
    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        stream
    }

    fn get(&self, path: &str) -> String {
        let mut stream = self.connect();
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", self.address).unwrap();
        read(stream)
    }
}

fn read(mut stream: TcpStream) -> String {
    let mut bytes = Vec::new();
    if let Err(e) = stream.read_to_end(&mut bytes) {
        let is_left_open = matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut);
        assert!(!is_left_open, "the connection is neither answered nor closed");
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

fn is_ok(answer: &str) -> bool {
    answer.starts_with("HTTP/1.1 200")
}

#[test]
fn silent_and_slow_clients_are_left() {
    while_serving(limits(), None, |client| {
        // One client sends nothing, one stops within its head, one sends single bytes slowly.
        let silent = client.connect();
        let mut halting = client.connect();
        write!(halting, "GET {} HTTP/1.1\r\nHost:", client.path).unwrap();
        let mut slow = client.connect();
        let mut sent = 0;
        while slow.write_all(b"G").is_ok() && sent < 100 {
            sent += 1;
            std::thread::sleep(Duration::from_millis(20));
        }
        assert!(!is_ok(&read(silent)) && !is_ok(&read(halting)) && sent < 100);
        assert!(is_ok(&client.get(&client.path)));
    });
}

#[test]
fn strangers_take_no_seats() {
    // A head may take an hour: whoever is served was not waiting for a stranger to be left.
    let few = Limits { connections: 4, head: Duration::from_secs(3600), ..Limits::default() };
    while_serving(few, None, |client| {
        // More connections than permits: silent ones, ones with half a head, refused ones.
        let strangers: Vec<TcpStream> = (0..300).map(|_| client.connect()).collect();
        for (i, mut stream) in strangers.iter().enumerate() {
            let _ = match i % 3 {
                0 => Ok(()),
                1 => write!(stream, "GET {}model/0 HTTP/1.1\r\n", client.path),
                _ => write!(stream, "GET /x HTTP/1.1\r\nHost: {}\r\n\r\n", client.address),
            };
        }
        assert!(is_ok(&client.get(&format!("{}model/0", client.path))));
    });
}

#[test]
fn more_connections_with_the_token_wait_for_a_seat() {
    let few = Limits { connections: 2, ..limits() };
    while_serving(few, None, |client| {
        let request = format!("GET {}model/0 HTTP/1.1\r\nHost: {}\r\n\r\n", client.path, client.address);
        let mut streams: Vec<TcpStream> = (0..6).map(|_| client.connect()).collect();
        streams.iter_mut().for_each(|stream| stream.write_all(request.as_bytes()).unwrap());
        // Each connection keeps its permit between two requests.
        assert!(streams.into_iter().all(|stream| is_ok(&read(stream))));
    });
}

#[test]
fn refused_requests_do_not_keep_it_alive() {
    let idle = Limits { idle: Some(2 * SHORT), ..Limits::default() };
    while_serving(idle, None, |client| {
        let others = ["GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", "GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n"];
        let mut silent = Vec::new();
        let has_ended = others.iter().cycle().take(100_000).any(|request| {
            let Ok(mut stream) = TcpStream::connect(&client.address) else { return true };
            let _ = stream.write_all(request.as_bytes());
            let _ = stream.read_to_end(&mut Vec::new());
            silent.extend(TcpStream::connect(&client.address));
            false
        });
        assert!(has_ended && silent.len() > 1, "{}", silent.len());
    });
}

#[test]
fn a_connection_may_ask_again_and_again_for_its_time() {
    let brief = Limits { connection: 3 * SHORT, ..limits() };
    while_serving(brief, None, |client| {
        let mut stream = client.connect();
        let request = format!("GET {}model/0 HTTP/1.1\r\nHost: {}\r\n\r\n", client.path, client.address);
        let mut answers = 0;
        let mut buffer = [0; 4096];
        while stream.write_all(request.as_bytes()).is_ok() {
            match stream.read(&mut buffer) {
                Ok(n) if n > 0 => answers += 1,
                _ => break,
            }
            std::thread::sleep(SHORT / 30);
        }
        assert!(answers > 3, "{answers}");
    });
}

#[test]
fn left_alone_it_ends() {
    let server = server(Limits { idle: Some(SHORT), ..limits() });
    let content = ViewerContent { models: vec![], truth: None, opening: PageOpening::default(), poster: None };
    server.serve(content, &Context::SILENT, &|_| {}).unwrap();
}

#[test]
fn the_way_for_once_leads_to_the_page_once() {
    while_serving(limits(), None, |client| {
        let first = client.get(&client.once);
        assert!(first.starts_with("HTTP/1.1 303") && first.contains(&format!("location: {}\r\n", &client.path[1..])));
        assert!(client.get(&client.once).starts_with("HTTP/1.1 404"));
        assert!(is_ok(&client.get(&client.path)));
    });
}

#[test]
fn a_poster_is_waited_for() {
    let page_is_served = Barrier::new(2);
    let slow = |bytes: &[u8]| {
        page_is_served.wait();
        Some([b"poster of ", bytes].concat())
    };
    while_serving(limits(), Some(&slow), |client| {
        assert!(is_ok(&client.get(&client.path)), "the page does not wait for it");
        page_is_served.wait();
        let answer = client.get(&format!("{}poster", client.path));
        assert!(is_ok(&answer) && answer.contains("image/png") && answer.ends_with("poster of model"), "{answer}");
    });
    while_serving(limits(), Some(&|_| None), |client| {
        assert!(client.get(&format!("{}poster", client.path)).starts_with("HTTP/1.1 404"));
    });
}

#[test]
fn refused_names_are_told_once_and_not_without_end() {
    let events = while_serving(limits(), None, |client| {
        for i in 0..60 {
            let mut stream = client.connect();
            let host = format!("site{}.example", i / 2);
            write!(stream, "GET / HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
            assert!(read(stream).starts_with("HTTP/1.1 403"));
        }
        // The loop handles events before it accepts the next connection.
        std::thread::sleep(SHORT);
    });
    assert_eq!(events.len(), 16, "{events:?}");
    assert_eq!(events[0], Event::RefusedHost("site0.example".into()));
}
