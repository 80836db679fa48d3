//! Serves the page to one user's browser: on loopback by default, behind a token, from a fixed table of routes.
//!
//! `guard` refuses requests of other sites, `door` checks the token, `table` maps addresses to responses (a new one is a
//! `Route` there), `connection` limits what a client may use. One thread serves; another draws pictures of all particles.

mod answer;
mod connection;
mod door;
mod guard;
mod render_queue;
mod table;
pub mod tunnel;

use connection::SiteServer;
pub use door::Token;
use door::TokenAuth;
use guard::{Guard, is_loopback};
use hyper::body::Bytes;
use particlegs_core::context::Context;
use particlegs_core::{Error, Result};
use particlegs_reference::Reference;
use particlegs_view::page::{ModelFile, PageOpening, Snapshot, served};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener, ToSocketAddrs};
use std::sync::Arc;
use std::time::Duration;
use table::RouteTable;

/// The default port, so that a tunnel to it can be kept in an ssh configuration.
pub const USUAL_PORT: u16 = 8317;

/// Address, token and limits of a server.
#[derive(Clone, Debug)]
pub struct Options {
    /// Address or name to listen at.
    pub host: String,
    /// Port; 0 = any free one; `None` = [`USUAL_PORT`], or any free one if that is in use.
    pub port: Option<u16>,
    /// Host names of proxies to the server, as browsers see them.
    pub proxies: Vec<String>,
    /// This machine's name, used if other machines can reach the server.
    pub node: Option<String>,
    /// The secret in the address.
    pub token: Token,
    /// Connections and times of one client.
    pub limits: Limits,
}

/// Limits for clients.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Maximum number of connections with the token; others wait.
    pub connections: usize,
    /// Time for the head of a request, and between two requests of a connection.
    pub head: Duration,
    /// Time for the body of a request.
    pub body: Duration,
    /// Lifetime of a connection.
    pub connection: Duration,
    /// The server stops after this time without a request that has the token; `None` = never.
    pub idle: Option<Duration>,
}

impl Default for Limits {
    fn default() -> Self {
        Limits {
            connections: 64,
            head: Duration::from_secs(10),
            body: Duration::from_secs(10),
            connection: Duration::from_secs(3600),
            idle: None,
        }
    }
}

/// The models and particles that a page shows.
pub struct ViewerContent<'a> {
    /// Model files: name and bytes.
    pub models: Vec<(String, Vec<u8>)>,
    /// All particles, to compare the models with.
    pub truth: Option<(Snapshot, &'a Reference<'a>)>,
    /// The first view of the page.
    pub opening: PageOpening,
    /// Draws the poster (PNG) from the bytes of the first model, once and in its own thread; `None` if it cannot.
    pub poster: Option<&'a (dyn Fn(&[u8]) -> Option<Vec<u8>> + Sync)>,
}

/// An event to report to the user.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Event {
    /// A request for this host name was refused; it may be a proxy. Sent once per name.
    RefusedHost(String),
    /// A request from a page of another site was refused. Sent once.
    RefusedOrigin,
}

/// A server that listens but has no content yet.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    door: TokenAuth,
    guard: Guard,
    node: Option<String>,
    limits: Limits,
}

impl Server {
    /// Starts to listen. Clients can connect and wait.
    pub fn bind(options: Options) -> Result<Self> {
        let Options { host, port, proxies, node, token, limits } = options;
        if let Some(no_name) = proxies.iter().find(|name| !guard::is_name(name)) {
            let message = format!("`{no_name}` is not the name of a host");
            let hint = "give only the name, such as hub.example.org";
            return Err(Error::argument_with(message, hint));
        }
        let listener = listen(&host, port)?;
        let address = listener.local_addr().map_err(|e| Error::io(&host, e))?;
        let widened = !is_loopback(address.ip());
        let names = [Some(host), node.clone().filter(|_| widened)].into_iter().flatten();
        let guard = Guard::new(widened, names, &proxies);
        Ok(Server { listener, address, door: TokenAuth::new(token), guard, node, limits })
    }

    /// The port it listens on.
    pub fn port(&self) -> u16 {
        self.address.port()
    }

    /// Whether other machines can reach it.
    pub fn is_widened(&self) -> bool {
        !is_loopback(self.address.ip())
    }

    /// The address to open on this machine.
    pub fn url(&self) -> String {
        let ip = match self.address.ip() {
            // 0.0.0.0 is an address to listen at, not one that a browser can open.
            any if any.is_unspecified() => IpAddr::V4(Ipv4Addr::LOCALHOST),
            ip => ip,
        };
        self.url_at(&SocketAddr::new(ip, self.port()).to_string())
    }

    /// The address to open on other machines, if the server listens on all addresses of this one.
    pub fn url_elsewhere(&self) -> Option<String> {
        let node = self.node.as_deref().filter(|_| self.address.ip().is_unspecified())?;
        Some(self.url_at(&format!("{node}:{}", self.port())))
    }

    fn url_at(&self, authority: &str) -> String {
        format!("http://{authority}/{}/", self.door.token())
    }

    /// An address that works once. It is for the browser's command line, which other users of the machine can read in
    /// the list of processes.
    pub fn url_for_once(&self) -> Result<String> {
        let token = self.door.for_once()?;
        Ok(self.url().replace(self.door.token(), token.as_str()).trim_end_matches('/').to_string())
    }

    /// The secret in the address.
    pub fn token(&self) -> &str {
        self.door.token()
    }

    /// Serves until `context` is cancelled or the server is idle for too long.
    pub fn serve(self, shown: ViewerContent<'_>, context: &Context<'_>, tell: &dyn Fn(Event)) -> Result<()> {
        let ViewerContent { models, truth, opening, poster } = shown;
        let named = models.iter().map(|(name, bytes)| ModelFile { name, bytes });
        let page = served(named, truth.as_ref().map(|t| &t.0), &opening, poster.is_some());
        let (queue, worker) = truth.as_ref().map(|_| render_queue::open()).unzip();
        let queue = queue.map(Arc::new);
        let models: Vec<Bytes> = models.into_iter().map(|m| Bytes::from(m.1)).collect();
        let first = models.first().cloned().unwrap_or_default();
        let (table, slot) = RouteTable::new(&page, models, poster.is_some(), queue.clone())?;
        let listening =
            SiteServer { listener: self.listener, guard: self.guard, door: self.door, limits: self.limits, table };
        std::thread::scope(|scope| {
            if let (Some(worker), Some((_, reference))) = (worker, truth) {
                scope.spawn(move || worker.work(reference, context));
            }
            if let Some(draw) = poster {
                scope.spawn(move || slot.set(draw(&first)));
            }
            let served = listening.serve(context, tell);
            // The worker waits for requests until the queue is closed, and the scope for the worker.
            queue.iter().for_each(|q| q.close());
            served
        })
    }
}

/// Listens at the first usable address of the host.
fn listen(host: &str, port: Option<u16>) -> Result<TcpListener> {
    let at = |port: u16| {
        let refused = |e: std::io::Error| Error::Argument {
            what: format!("cannot listen at {host}, port {port}: {e}"),
            hint: "choose another port, or 0 for any free one".into(),
        };
        let addresses: Vec<SocketAddr> = (host, port).to_socket_addrs().map_err(refused)?.collect();
        TcpListener::bind(&addresses[..]).map_err(refused)
    };
    match port {
        Some(port) => at(port),
        None => at(USUAL_PORT).or_else(|_| at(0)),
    }
}
