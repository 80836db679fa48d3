//! The page as one HTML file, for disk or for the server.
//!
//! The script finds everything by id: `setup` lists the models and where their bytes are, `worker` is the worker's
//! source, and the script fills `app`. A page on disk contains models and engine as base64; a served page fetches them
//! by relative addresses, so that a proxy may put it under any path.

pub use crate::opening::{MOST_CIRCLES, PageOpening, PageStyle};
use crate::{assets, markup, poster};
use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use particlegs_core::context::Context;
use particlegs_core::model::Model;
use particlegs_core::{Result, codec};
use particlegs_measure::score::Assessment;
use serde::Serialize;

/// Number of neighbours that densities are smoothed over.
const NEIGHBOURS: usize = 32;
/// Maximum number of particles to smooth: the user waits for it.
const MOST_SMOOTHED: u64 = 10_000_000;

/// Number of neighbours that the densities of this many particles are smoothed over; `None` if they are not.
pub fn smoothed(particles: u64) -> Option<usize> {
    (NEIGHBOURS as u64 + 1..=MOST_SMOOTHED).contains(&particles).then_some(NEIGHBOURS)
}

/// A model file to show.
#[derive(Clone, Copy, Debug)]
pub struct ModelFile<'a> {
    /// The file's name, shown in the page.
    pub name: &'a str,
    /// The file's bytes.
    pub bytes: &'a [u8],
}

impl ModelFile<'_> {
    fn is_series(&self) -> bool {
        codec::is_series(self.bytes)
    }

    /// The verdict of its certificate; empty without one, and of a series.
    fn verdict(&self) -> Vec<Assessment> {
        let info = codec::read_info(self.bytes, self.name).ok();
        let certified = info.filter(|i| i.certificate.is_some());
        certified.map_or_else(Vec::new, |i| Assessment::verdict(i.certificate.as_ref(), &i.metadata))
    }
}

/// The snapshot that a server compares the model with.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// The name shown in the page.
    pub name: String,
    /// Number of particles drawn.
    pub particles: u64,
    /// The quantity that their density sums.
    pub density_of: String,
}

/// A page and its security policy.
#[derive(Clone, Debug)]
pub struct Page {
    pub html: String,
    /// Its Content-Security-Policy, also for the header.
    pub policy: String,
}

/// One file that shows the models offline, opened from disk. Its size is at most 1.35 times the models plus the shell.
///
/// Each file comes with its decoded model, of a series with its first frame, which proves that the page can show it. The
/// page of a single model with more than [`poster::MORE_THAN`] Gaussians contains a poster to show during decoding, if it
/// opens with the default view.
pub fn offline(models: &[(ModelFile<'_>, &Model)], opening: &PageOpening, context: &Context<'_>) -> Result<Vec<u8>> {
    context.check()?;
    let poster = match models {
        [(file, model)] if !file.is_series() && poster::wanted(model.gaussians(), opening) => {
            Some(poster::draw(model, poster::SMALL, context)?.png)
        }
        _ => None,
    };
    let files = || models.iter().map(|(file, _)| *file);
    let coded: u64 = files().map(|m| 4 * (m.bytes.len() as u64).div_ceil(3)).sum();
    // The text of a circle takes about 100 bytes, in up to three copies.
    context.require_memory("the page", coded + (coded >> 3) + 300 * opening.circles.len() as u64)?;
    let poster = poster.map(|png| format!("data:image/png;base64,{}", BASE64_STANDARD.encode(png)));
    let setup = Setup::new(files(), None, opening, Delivery::InPage);
    let mut page = PageBuilder::new(&setup, poster.as_deref());
    for (i, model) in files().enumerate() {
        page.data(&format!("model-{i}"), model.bytes);
    }
    page.data("engine", assets::ENGINE);
    Ok(page.finish().html.into_bytes())
}

/// A page for any web server: it requests the model's file, which lies beside it. Of a series it requests the index and the
/// first frame, then all others group by group, where the server supports HTTP Range.
pub fn linked(file: ModelFile<'_>, opening: &PageOpening) -> Vec<u8> {
    let mut page = PageBuilder::new(&Setup::new([file], None, opening, Delivery::Beside), None);
    page.data("engine", assets::ENGINE);
    page.finish().html.into_bytes()
}

/// The page to serve for these models, with a poster if the server draws one.
pub fn served<'a>(
    models: impl IntoIterator<Item = ModelFile<'a>>,
    snapshot: Option<&'a Snapshot>,
    opening: &'a PageOpening,
    poster: bool,
) -> Page {
    PageBuilder::new(&Setup::new(models, snapshot, opening, Delivery::Server), poster.then_some("poster")).finish()
}

/// The input of the script.
#[derive(Serialize)]
struct Setup<'a> {
    version: &'static str,
    models: Vec<SetupModel<'a>>,
    engine: BytesLocation,
    truth: Option<SetupTruth<'a>>,
    opening: &'a PageOpening,
    served: bool,
    #[serde(skip)]
    delivery: Delivery,
}

/// Places of a page's models and engine.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Delivery {
    /// The server of `view` has both.
    Server,
    /// Both are in the page.
    InPage,
    /// The model's file is beside the page, the engine within.
    Beside,
}

#[derive(Serialize)]
struct SetupModel<'a> {
    name: &'a str,
    bytes: usize,
    series: bool,
    verdict: Vec<Assessment>,
    #[serde(flatten)]
    place: BytesLocation,
}

#[derive(Serialize)]
struct SetupTruth<'a> {
    url: &'static str,
    name: &'a str,
    particles: u64,
    density_of: &'a str,
    /// Number of neighbours that densities are smoothed over; `None` for too many or too few particles.
    smoothed: Option<usize>,
}

/// The place of bytes.
#[derive(Serialize)]
#[serde(rename_all = "lowercase")]
enum BytesLocation {
    /// At an address relative to the page's.
    Url(String),
    /// In the page, in the element of this id.
    Element(String),
}

impl<'a> Setup<'a> {
    fn new(
        models: impl IntoIterator<Item = ModelFile<'a>>,
        snapshot: Option<&'a Snapshot>,
        opening: &'a PageOpening,
        delivery: Delivery,
    ) -> Setup<'a> {
        let served = delivery == Delivery::Server;
        let at = |i, name: &str| match delivery {
            Delivery::Server => BytesLocation::Url(format!("model/{i}")),
            Delivery::InPage => BytesLocation::Element(format!("model-{i}")),
            Delivery::Beside => BytesLocation::Url(markup::path_segment(name)),
        };
        let models = models.into_iter().enumerate().map(|(i, file)| SetupModel {
            name: file.name,
            bytes: file.bytes.len(),
            series: file.is_series(),
            verdict: file.verdict(),
            place: at(i, file.name),
        });
        Setup {
            version: env!("CARGO_PKG_VERSION"),
            models: models.collect(),
            engine: if served { BytesLocation::Url("engine".into()) } else { BytesLocation::Element("engine".into()) },
            truth: snapshot.map(|s| SetupTruth {
                url: "truth",
                name: &s.name,
                particles: s.particles,
                density_of: &s.density_of,
                smoothed: smoothed(s.particles),
            }),
            opening,
            served,
            delivery,
        }
    }

    fn title(&self) -> String {
        self.models.iter().map(|m| m.name).collect::<Vec<_>>().join(", ")
    }
}

/// A page under construction.
struct PageBuilder {
    html: String,
    policy: String,
}

impl PageBuilder {
    /// The page up to the worker's source. `poster` is the address of the picture.
    fn new(setup: &Setup<'_>, poster: Option<&str>) -> Self {
        let (title, policy) = (markup::text(&setup.title()), policy(setup.delivery));
        let poster = poster.map(|src| format!("<img id=\"poster\" alt=\"{title}\" src=\"{src}\">"));
        // The empty icon keeps browsers from asking for one.
        let html = format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"{policy}\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"referrer\" content=\"no-referrer\">\n<title>{title}</title>\n\
             <link rel=\"icon\" href=\"data:,\">\n<style>{style}</style>\n</head>\n<body>\n\
             <main id=\"app\">{poster}</main>\n<script type=\"application/json\" id=\"setup\">{setup}</script>\n\
             <script type=\"text/plain\" id=\"worker\">{worker}</script>\n",
            policy = markup::text(&policy),
            style = assets::STYLE,
            poster = poster.unwrap_or_default(),
            setup = markup::json(setup),
            worker = assets::WORKER,
        );
        PageBuilder { html, policy }
    }

    /// Adds bytes for the script, as base64.
    fn data(&mut self, id: &str, bytes: &[u8]) {
        self.html.reserve(4 * bytes.len().div_ceil(3) + 100);
        self.html += &format!("<script type=\"application/octet-stream\" id=\"{id}\">");
        BASE64_STANDARD.encode_string(bytes, &mut self.html);
        self.html += "</script>\n";
    }

    /// Adds the script, which must come last.
    fn finish(mut self) -> Page {
        self.html += "<script>";
        self.html += assets::SCRIPT;
        self.html += "</script>\n</body>\n</html>\n";
        Page { html: self.html, policy: self.policy }
    }
}

/// The security policy: only this script, WebAssembly, workers from a Blob, and requests to this server.
fn policy(delivery: Delivery) -> String {
    let (script, style) = (assets::SCRIPT_HASH, assets::STYLE_HASH);
    let images = if delivery == Delivery::Server { " 'self'" } else { "" };
    // A page on disk requests nothing.
    let connect = if delivery == Delivery::InPage { "" } else { " connect-src 'self';" };
    format!(
        "default-src 'none'; script-src 'sha256-{script}' 'wasm-unsafe-eval'; style-src 'sha256-{style}'; worker-src blob:; \
         img-src data: blob:{images};{connect} base-uri 'none'; form-action 'none'"
    )
}
