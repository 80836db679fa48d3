//! The page for one user's browser: loopback by default, behind a token, with a fixed table of what there is.
//!
//! `guard` tells requests of other sites, `door` the token, `table` knows every address and its answer,
//! `connection` bounds what a client may cost. One thread serves; pictures of all particles are drawn by another.

mod answer;
mod connection;
mod door;
mod guard;
mod table;

use crate::page::{ModelFile, PageOpening, Snapshot, served};
use crate::truth::desk;
use connection::SiteServer;
pub use door::Token;
use door::TokenAuth;
use guard::{Guard, is_loopback};
use hyper::body::Bytes;
use particlegs_pipeline::context::Context;
use particlegs_pipeline::reference::Reference;
use particlegs_pipeline::{Error, Result};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener, ToSocketAddrs};
use std::sync::Arc;
use std::time::Duration;
use table::RouteTable;

/// The port that is tried first where none is asked for, so that a tunnel to it can stand in an ssh configuration.
pub const USUAL_PORT: u16 = 8317;

/// How the server is reached.
#[derive(Clone, Debug)]
pub struct Options {
    /// Address or name to listen at.
    pub host: String,
    /// Port; 0 = any that is free; `None` = [`USUAL_PORT`], or any where that is taken.
    pub port: Option<u16>,
    /// Names of proxies that lead to the server, as browsers name them.
    pub proxies: Vec<String>,
    /// This machine's own name: it counts where other machines can reach the server.
    pub node: Option<String>,
    /// The secret in the address.
    pub token: Token,
    /// What a client may cost.
    pub limits: Limits,
}

/// What clients may cost.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Connections with the token at a time; more wait until one ends.
    pub connections: usize,
    /// Time for the head of a request, and between two requests of a connection.
    pub head: Duration,
    /// Time for the body of a request.
    pub body: Duration,
    /// Time for a connection.
    pub connection: Duration,
    /// The server ends after so long without a request that has the token; `None` = never.
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

pub struct ViewerContent<'a> {
    /// Model files: what the page calls each, and its bytes.
    pub models: Vec<(String, Vec<u8>)>,
    /// All particles, for the pictures beside the model's, and what the page calls them.
    pub truth: Option<(Snapshot, &'a Reference<'a>)>,
    /// How the page opens.
    pub opening: PageOpening,
    /// Draws the poster, a PNG, of the bytes of the first model, once and beside the serving; gives `None` where it
    /// cannot.
    pub poster: Option<&'a (dyn Fn(&[u8]) -> Option<Vec<u8>> + Sync)>,
}

/// Something that the user should know of while the server runs.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Event {
    /// A request for this host was refused: a proxy's, if the user set one up. Told once a name.
    RefusedHost(String),
    /// A request from a page of another site was refused. Told once.
    RefusedOrigin,
}

/// A server that listens, and serves as soon as it is told what.
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    door: TokenAuth,
    guard: Guard,
    node: Option<String>,
    limits: Limits,
}

impl Server {
    /// Listens. From now on clients can connect, and wait.
    pub fn bind(options: Options) -> Result<Self> {
        let Options { host, port, proxies, node, token, limits } = options;
        if let Some(no_name) = proxies.iter().find(|name| !guard::is_name(name)) {
            let what = format!("`{no_name}` is not the name of a host");
            let hint = "give the name alone, such as hub.example.org";
            return Err(Error::argument_with(what, hint));
        }
        let listener = listen(&host, port)?;
        let address = listener.local_addr().map_err(|e| Error::io(&host, e))?;
        let widened = !is_loopback(address.ip());
        let names = [Some(host), node.clone().filter(|_| widened)].into_iter().flatten();
        let guard = Guard::new(widened, names, &proxies);
        Ok(Server { listener, address, door: TokenAuth::new(token), guard, node, limits })
    }

    /// The port that it listens at.
    pub fn port(&self) -> u16 {
        self.address.port()
    }

    /// Can other machines reach it?
    pub fn is_widened(&self) -> bool {
        !is_loopback(self.address.ip())
    }

    /// The address to open on this machine.
    pub fn url(&self) -> String {
        let ip = match self.address.ip() {
            any if any.is_unspecified() => IpAddr::V4(Ipv4Addr::LOCALHOST),
            ip => ip,
        };
        self.url_at(&SocketAddr::new(ip, self.port()).to_string())
    }

    /// The address to open on other machines, where they can reach it at all of this one's.
    pub fn url_elsewhere(&self) -> Option<String> {
        let node = self.node.as_deref().filter(|_| self.address.ip().is_unspecified())?;
        Some(self.url_at(&format!("{node}:{}", self.port())))
    }

    fn url_at(&self, authority: &str) -> String {
        format!("http://{authority}/{}/", self.door.token())
    }

    /// An address that leads to the page once: other users of the machine can read it in the list of processes
    /// where a browser is started with it, and then it is of no use to them.
    pub fn url_for_once(&self) -> Result<String> {
        let token = self.door.for_once()?;
        Ok(self.url().replace(self.door.token(), token.as_str()).trim_end_matches('/').to_string())
    }

    /// The server's secret in the address.
    pub fn token(&self) -> &str {
        self.door.token()
    }

    /// Serves until `progress` is cancelled, or nobody has asked for as long as the limits say.
    pub fn serve(self, shown: ViewerContent<'_>, context: &Context<'_>, tell: &dyn Fn(Event)) -> Result<()> {
        let ViewerContent { models, truth, opening, poster } = shown;
        let named = models.iter().map(|(name, bytes)| ModelFile { name, bytes });
        let page = served(named, truth.as_ref().map(|t| &t.0), &opening, poster.is_some());
        let (desk, painter) = truth.as_ref().map(|_| desk::open()).unzip();
        let desk = desk.map(Arc::new);
        let models: Vec<Bytes> = models.into_iter().map(|m| Bytes::from(m.1)).collect();
        let first = models.first().cloned().unwrap_or_default();
        let (table, hang) = RouteTable::new(&page, models, poster.is_some(), desk.clone())?;
        let listening =
            SiteServer { listener: self.listener, guard: self.guard, door: self.door, limits: self.limits, table };
        std::thread::scope(|scope| {
            if let (Some(painter), Some((_, reference))) = (painter, truth) {
                scope.spawn(move || painter.work(reference, context));
            }
            if let Some(draw) = poster {
                scope.spawn(move || hang.up(draw(&first)));
            }
            let served = listening.serve(context, tell);
            desk.iter().for_each(|d| d.close());
            served
        })
    }
}

/// Listens at the first of the host's addresses that can be had.
fn listen(host: &str, port: Option<u16>) -> Result<TcpListener> {
    let at = |port: u16| {
        let refused = |e: std::io::Error| Error::Argument {
            what: format!("cannot listen at {host}, port {port}: {e}"),
            hint: "choose another port, or 0 for any that is free".into(),
        };
        let addresses: Vec<SocketAddr> = (host, port).to_socket_addrs().map_err(refused)?.collect();
        TcpListener::bind(&addresses[..]).map_err(refused)
    };
    match port {
        Some(port) => at(port),
        None => at(USUAL_PORT).or_else(|_| at(0)),
    }
}
