//! Connections and requests, bounded in number, size and time.

use crate::answer::{HttpResponse, refusal, with};
use crate::door::{PathAccess, TokenAuth};
use crate::guard::{Guard, Refusal};
use crate::table::{Route, RouteTable};
use crate::{Event, Limits};
use http_body_util::{BodyExt, LengthLimitError, Limited};
use hyper::body::Incoming;
use hyper::header::{self, HeaderMap, HeaderName, HeaderValue};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Request, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use particlegs_core::context::Context;
use particlegs_core::{Error, Result};
use std::collections::{HashSet, VecDeque};
use std::convert::Infallible;
use std::net::TcpListener;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::net::TcpStream;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::{AbortHandle, Id, yield_now};
use tokio::time::{sleep, timeout};

/// Time between two checks whether to stop.
const TICK: Duration = Duration::from_millis(100);
/// Limits of a request: bytes of head and body, number of headers.
const MOST_HEAD: usize = 16 << 10;
const MOST_BODY: usize = 16 << 10;
const MOST_LINES: usize = 64;
/// Maximum size of a connection's read buffer, bytes.
const BUFFER: usize = 64 << 10;
/// Maximum number of refused names to report: a scanner could try any number.
const MOST_REPORTED: usize = 16;
/// Maximum number of connections that have not shown the token.
const MOST_STRANGERS: usize = 256;

/// A server with its content.
pub struct SiteServer {
    pub listener: TcpListener,
    pub guard: Guard,
    pub door: TokenAuth,
    pub limits: Limits,
    pub table: RouteTable,
}

/// State that all connections share.
struct ConnectionState {
    guard: Guard,
    door: TokenAuth,
    limits: Limits,
    table: RouteTable,
    events: Sender<Event>,
    reported: Mutex<HashSet<Event>>,
    /// Time of the last request or response with the token.
    asked: Mutex<Instant>,
    /// Permits for connections that have shown the token.
    seats: Arc<Semaphore>,
    strangers: UnverifiedConnections,
}

/// Connections that have not shown the token yet, the oldest first. They need no permit. If there are too many, the
/// oldest is closed: a client that has the token shows it at once.
#[derive(Default)]
struct UnverifiedConnections(Mutex<VecDeque<AbortHandle>>);

impl UnverifiedConnections {
    fn add(&self, stranger: AbortHandle) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.push_back(stranger);
        if all.len() > MOST_STRANGERS
            && let Some(oldest) = all.pop_front()
        {
            oldest.abort();
        }
    }

    fn remove(&self, known: Id) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).retain(|s| s.id() != known);
    }
}

impl SiteServer {
    /// Serves until it is cancelled or idle for too long.
    pub fn serve(self, context: &Context<'_>, tell: &dyn Fn(Event)) -> Result<()> {
        let SiteServer { listener, guard, door, limits, table } = self;
        let fault = |e| Error::io("the server", e);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build().map_err(fault)?;
        // Tokio takes over only sockets that do not block.
        listener.set_nonblocking(true).map_err(fault)?;
        let (events, happened) = channel();
        let (reported, asked) = (Mutex::default(), Mutex::new(Instant::now()));
        let (seats, strangers) = (Arc::new(Semaphore::new(limits.connections)), UnverifiedConnections::default());
        let shared =
            Arc::new(ConnectionState { guard, door, limits, table, events, reported, asked, seats, strangers });
        runtime.block_on(async {
            let listener = tokio::net::TcpListener::from_std(listener).map_err(fault)?;
            let nobody_is_there = || shared.seats.available_permits() == limits.connections;
            while !(context.cancelled() || nobody_is_there() && shared.is_left_alone()) {
                happened.try_iter().for_each(tell);
                match timeout(TICK, listener.accept()).await {
                    Ok(Ok((stream, _))) => {
                        let client = tokio::spawn(Arc::clone(&shared).converse(stream));
                        shared.strangers.add(client.abort_handle());
                        // Lets the new connection be read before the next is accepted.
                        yield_now().await;
                    }
                    // The client has left, or too many files are open: try again later.
                    Ok(Err(_)) => sleep(TICK).await,
                    Err(_) => {}
                }
            }
            Ok(())
        })
    }
}

impl ConnectionState {
    /// Handles one connection.
    async fn converse(self: Arc<Self>, stream: TcpStream) {
        let limits = self.limits;
        // Responses are written as a whole, so delaying packets gains nothing.
        let _ = stream.set_nodelay(true);
        let seat = Arc::new(Mutex::new(None));
        let service = service_fn(|request| {
            let (shared, seat) = (Arc::clone(&self), Arc::clone(&seat));
            async move { Ok::<_, Infallible>(shared.answer(request, &seat).await) }
        });
        let mut protocol = http1::Builder::new();
        protocol
            .timer(TokioTimer::new())
            .header_read_timeout(limits.head)
            .max_headers(MOST_LINES)
            .max_header_size(MOST_HEAD)
            .max_buf_size(BUFFER);
        // Errors of the client are ignored.
        let _ = timeout(limits.connection, protocol.serve_connection(TokioIo::new(stream), service)).await;
        self.strangers.remove(tokio::task::id());
    }

    /// The response to a request. With the token it takes a permit; without, the connection is closed.
    async fn answer(&self, request: Request<Incoming>, seat: &Mutex<Option<OwnedSemaphorePermit>>) -> HttpResponse {
        let place = match self.opened(&request) {
            Ok(place) => place,
            Err(answer) => return with(*answer, header::CONNECTION, HeaderValue::from_static("close")),
        };
        if seat.lock().unwrap_or_else(PoisonError::into_inner).is_none() {
            let permit = Arc::clone(&self.seats).acquire_owned().await.ok();
            *seat.lock().unwrap_or_else(PoisonError::into_inner) = permit;
            self.strangers.remove(tokio::task::id());
        }
        self.is_asked();
        let answer = self.answer_at(place, request).await;
        // A picture may take longer than the idle time, so its end counts as a request as well.
        self.is_asked();
        answer
    }

    /// The route of a request with the token; the error response without it.
    fn opened(&self, request: &Request<Incoming>) -> std::result::Result<Option<Route>, Box<HttpResponse>> {
        self.guarded(request).map_err(|refused| Box::new(self.refused(refused)))?;
        let path = request.uri().path();
        let path = path.strip_prefix('/').unwrap_or(path);
        let (key, rest) = path.split_once('/').map_or((path, None), |(key, rest)| (key, Some(rest)));
        match (self.door.opens(key), rest) {
            (PathAccess::Everything, Some(rest)) => Ok(self.table.find(rest)),
            (PathAccess::Everything, None) | (PathAccess::Once, None | Some("")) => {
                Err(Box::new(self.to_the_page(rest.is_some())))
            }
            _ => Err(Box::new(nothing())),
        }
    }

    async fn answer_at(&self, place: Option<Route>, request: Request<Incoming>) -> HttpResponse {
        let Some(place) = place else { return nothing() };
        let (methods, allowed) = place.methods();
        if !methods.contains(request.method()) {
            let answer = refusal(StatusCode::METHOD_NOT_ALLOWED, &format!("this address accepts only {allowed}"));
            return with(answer, header::ALLOW, HeaderValue::from_static(allowed));
        }
        match place {
            Route::Truth => self.truth(request).await,
            place => self.table.get(place, request.headers()).await,
        }
    }

    /// Redirects to the page by a relative address, which works behind a proxy.
    fn to_the_page(&self, within: bool) -> HttpResponse {
        let to = format!("{}{}/", if within { "../" } else { "" }, self.door.token());
        let answer = refusal(StatusCode::SEE_OTHER, "the page is at another address");
        HeaderValue::from_str(&to).map_or(answer.clone(), |to| with(answer, header::LOCATION, to))
    }

    fn guarded(&self, request: &Request<Incoming>) -> std::result::Result<(), Refusal> {
        // Only proxies get a whole URL instead of a path.
        if request.uri().authority().is_some() {
            return Err(Refusal::Host(None));
        }
        let headers = request.headers();
        let host = only(headers, header::HOST).map_err(|()| Refusal::Host(None))?;
        let origin = only(headers, header::ORIGIN).map_err(|()| Refusal::Origin)?;
        self.guard.check(host, origin)
    }

    fn refused(&self, refused: Refusal) -> HttpResponse {
        let (event, why) = match refused {
            Refusal::Host(None) => {
                return refusal(StatusCode::BAD_REQUEST, "the request names no host");
            }
            Refusal::Host(Some(name)) => {
                let why = format!(
                    "this server does not answer to the name {name}; the terminal it runs in shows how to allow it"
                );
                (Event::RefusedHost(name), why)
            }
            Refusal::Origin => (Event::RefusedOrigin, "requests from pages of other sites are refused".to_string()),
        };
        let mut reported = self.reported.lock().unwrap_or_else(PoisonError::into_inner);
        if reported.len() < MOST_REPORTED && reported.insert(event.clone()) {
            // The receiver lives as long as the connections.
            let _ = self.events.send(event);
        }
        refusal(StatusCode::FORBIDDEN, &why)
    }

    async fn truth(&self, request: Request<Incoming>) -> HttpResponse {
        let kind = only(request.headers(), header::CONTENT_TYPE).ok().flatten().unwrap_or_default();
        if !kind.split(';').next().is_some_and(|k| k.trim().eq_ignore_ascii_case("application/json")) {
            return refusal(StatusCode::UNSUPPORTED_MEDIA_TYPE, "send the picture request as application/json");
        }
        match timeout(self.limits.body, Limited::new(request.into_body(), MOST_BODY).collect()).await {
            Ok(Ok(body)) => self.table.truth(&body.to_bytes()).await,
            Ok(Err(e)) if e.is::<LengthLimitError>() => {
                refusal(StatusCode::PAYLOAD_TOO_LARGE, &format!("the request is larger than {MOST_BODY} bytes"))
            }
            Ok(Err(_)) => refusal(StatusCode::BAD_REQUEST, "the request is incomplete"),
            Err(_) => refusal(StatusCode::REQUEST_TIMEOUT, "the request took too long"),
        }
    }

    fn is_asked(&self) {
        *self.asked.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
    }

    fn is_left_alone(&self) -> bool {
        let last_request = *self.asked.lock().unwrap_or_else(PoisonError::into_inner);
        self.limits.idle.is_some_and(|idle| last_request.elapsed() >= idle)
    }
}

fn nothing() -> HttpResponse {
    refusal(StatusCode::NOT_FOUND, "not found: open the address that the command printed")
}

/// A header that may occur once, as text.
fn only(headers: &HeaderMap, name: HeaderName) -> std::result::Result<Option<&str>, ()> {
    let mut values = headers.get_all(name).iter();
    match (values.next(), values.next()) {
        (None, _) => Ok(None),
        (Some(value), None) => value.to_str().map(Some).map_err(|_| ()),
        _ => Err(()),
    }
}
