//! All addresses behind the token. There are no others: nothing is looked up in a file system.

use crate::answer::{HttpResponse, bytes, part, refusal, with};
use crate::render_queue::{RenderQueue, RenderRequest};
use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use hyper::body::Bytes;
use hyper::header::{self, HeaderMap, HeaderValue};
use hyper::{Method, StatusCode};
use particlegs_core::{Error, Result};
use particlegs_view::assets;
use particlegs_view::page::Page;
use std::io::{Read, Write};
use std::sync::Arc;
use tokio::sync::watch;

pub struct RouteTable {
    page: EncodedBody,
    policy: HeaderValue,
    engine: EncodedBody,
    models: Vec<Bytes>,
    /// `None` if the page has no poster. Inside: `None` until it is drawn, then the result.
    poster: Option<watch::Receiver<Option<Option<Bytes>>>>,
    queue: Option<Arc<RenderQueue>>,
}

/// Receives the poster.
pub struct PosterSlot(watch::Sender<Option<Option<Bytes>>>);

impl PosterSlot {
    /// Sets the poster, or `None` if it cannot be drawn.
    pub fn set(self, poster: Option<Vec<u8>>) {
        self.0.send_replace(Some(poster.map(Bytes::from)));
    }
}

/// A body, plain and compressed.
struct EncodedBody {
    plain: Bytes,
    gzip: Bytes,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    Page,
    Engine,
    Poster,
    Model(usize),
    Truth,
}

impl RouteTable {
    /// The routes of a page and its models, with a poster and a queue for pictures of all particles if there are any.
    pub fn new(
        page: &Page,
        models: Vec<Bytes>,
        poster: bool,
        queue: Option<Arc<RenderQueue>>,
    ) -> Result<(Self, PosterSlot)> {
        let fault = |e| Error::io("the page", e);
        let (sender, receiver) = watch::channel(None);
        // A notebook of the same site may frame the page.
        let policy = HeaderValue::from_str(&format!("{}; frame-ancestors 'self'", page.policy));
        let table = RouteTable {
            page: EncodedBody::of_plain(&page.html).map_err(fault)?,
            policy: policy.map_err(|e| fault(std::io::Error::other(e)))?,
            engine: EncodedBody::of_gzip(assets::ENGINE).map_err(fault)?,
            models,
            poster: poster.then_some(receiver),
            queue,
        };
        Ok((table, PosterSlot(sender)))
    }

    /// The route of a path behind the token.
    pub fn find(&self, path: &str) -> Option<Route> {
        match path {
            "" => Some(Route::Page),
            "engine" => Some(Route::Engine),
            "poster" => self.poster.is_some().then_some(Route::Poster),
            "truth" => self.queue.is_some().then_some(Route::Truth),
            _ => {
                let number = path.strip_prefix("model/")?;
                // Compared as text, so that a model has one address: neither `01` nor `+1`.
                (0..self.models.len()).find(|i| i.to_string() == number).map(Route::Model)
            }
        }
    }

    /// The answer to a GET.
    pub async fn get(&self, place: Route, headers: &HeaderMap) -> HttpResponse {
        match place {
            Route::Page => {
                let answer = self.page.answer("text/html; charset=utf-8", headers);
                with(answer, header::CONTENT_SECURITY_POLICY, self.policy.clone())
            }
            Route::Engine => self.engine.answer("application/wasm", headers),
            Route::Model(i) => part(&self.models[i], headers),
            Route::Poster => self.poster().await,
            Route::Truth => refusal(StatusCode::METHOD_NOT_ALLOWED, "request pictures by POST"),
        }
    }

    /// Waits until the poster is drawn.
    async fn poster(&self) -> HttpResponse {
        let Some(mut poster) = self.poster.clone() else {
            return refusal(StatusCode::NOT_FOUND, "there is no poster");
        };
        let poster_png = poster.wait_for(Option::is_some).await.ok().and_then(|poster| poster.clone().flatten());
        match poster_png {
            Some(png) => bytes("image/png", png),
            None => refusal(StatusCode::NOT_FOUND, "there is no poster"),
        }
    }

    /// The response to a request for a picture of all particles.
    pub async fn truth(&self, json: &[u8]) -> HttpResponse {
        let Some(queue) = &self.queue else {
            return refusal(StatusCode::NOT_FOUND, "there is no snapshot");
        };
        let question = match RenderRequest::read(json) {
            Ok(question) => question,
            Err(wrong) => return refusal(StatusCode::BAD_REQUEST, &wrong.to_string()),
        };
        match queue.ask(question).answer().await {
            Ok(picture) => bytes("application/octet-stream", picture.into()),
            Err(Error::Cancelled) => refusal(StatusCode::CONFLICT, "cancelled: another picture was requested"),
            Err(wrong @ Error::Argument { .. }) => refusal(StatusCode::BAD_REQUEST, &wrong.to_string()),
            Err(wrong @ Error::Memory { .. }) => refusal(StatusCode::UNPROCESSABLE_ENTITY, &wrong.to_string()),
            Err(wrong) => refusal(StatusCode::INTERNAL_SERVER_ERROR, &wrong.to_string()),
        }
    }
}

impl Route {
    /// The methods it accepts.
    pub fn methods(self) -> (&'static [Method], &'static str) {
        match self {
            Route::Truth => (&[Method::POST], "POST"),
            _ => (&[Method::GET, Method::HEAD], "GET, HEAD"),
        }
    }
}

impl EncodedBody {
    fn of_plain(text: &str) -> std::io::Result<Self> {
        let mut packer = GzEncoder::new(Vec::new(), Compression::default());
        packer.write_all(text.as_bytes())?;
        Ok(EncodedBody { plain: Bytes::from(text.to_string()), gzip: packer.finish()?.into() })
    }

    fn of_gzip(gzip: &'static [u8]) -> std::io::Result<Self> {
        let mut plain = Vec::new();
        GzDecoder::new(gzip).read_to_end(&mut plain)?;
        Ok(EncodedBody { plain: plain.into(), gzip: Bytes::from_static(gzip) })
    }

    fn answer(&self, kind: &'static str, headers: &HeaderMap) -> HttpResponse {
        let answer = if takes_gzip(headers) {
            let gzip = HeaderValue::from_static("gzip");
            with(bytes(kind, self.gzip.clone()), header::CONTENT_ENCODING, gzip)
        } else {
            bytes(kind, self.plain.clone())
        };
        with(answer, header::VARY, HeaderValue::from_static("accept-encoding"))
    }
}

/// Whether the client accepts gzip.
fn takes_gzip(headers: &HeaderMap) -> bool {
    let lists = headers.get_all(header::ACCEPT_ENCODING).iter().filter_map(|v| v.to_str().ok());
    lists.flat_map(|list| list.split(',')).any(|coding| {
        let mut parts = coding.split(';').map(str::trim);
        let named = parts.next().is_some_and(|name| name.eq_ignore_ascii_case("gzip"));
        let weight = parts.find_map(|p| p.strip_prefix("q=")).map_or(Ok(1.0), str::parse::<f64>);
        named && weight.is_ok_and(|w| w > 0.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gzip_where_the_client_takes_it() {
        let takes = |value: &'static str| {
            takes_gzip(&HeaderMap::from_iter([(header::ACCEPT_ENCODING, HeaderValue::from_static(value))]))
        };
        assert!(takes("gzip") && takes("br, gzip, zstd") && takes("GZIP;q=0.5"));
        assert!(
            !takes("") && !takes("br") && !takes("gzip;q=0") && !takes("gzip;q=x") && !takes_gzip(&HeaderMap::new())
        );
    }
}
