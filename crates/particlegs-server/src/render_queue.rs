//! Pictures of all particles: the page's requests (camera, style and size, as JSON), and the queue of the thread that draws
//! them. A new request cancels the one before.

use particlegs_core::camera::{Camera, DensityView, Projection, View};
use particlegs_core::context::Context;
use particlegs_core::picture::{Plane, Size};
use particlegs_core::render::tone;
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Result};
use particlegs_particles::{Particles, Selection, Storage};
use particlegs_reference::Reference;
use particlegs_view::page::smoothed;
use serde::Deserialize;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::oneshot;

/// Coarse pictures always use the same particles.
const SEED: u64 = 42;

/// A request in the queue.
struct QueuedRender {
    question: RenderRequest,
    given_up: Arc<AtomicBool>,
    answer: oneshot::Sender<Result<Vec<u8>>>,
}

pub struct RenderQueue {
    jobs: Mutex<Option<Sender<QueuedRender>>>,
    /// Cancels the last request.
    last: Mutex<Arc<AtomicBool>>,
}

/// The receiving end of the queue.
pub struct RenderWorker {
    jobs: Receiver<QueuedRender>,
}

/// A queue and its worker.
pub fn open() -> (RenderQueue, RenderWorker) {
    let (sender, jobs) = channel();
    (RenderQueue { jobs: Mutex::new(Some(sender)), last: Mutex::default() }, RenderWorker { jobs })
}

/// A picture to wait for; dropping it cancels the request.
pub struct PendingRender {
    given_up: Arc<AtomicBool>,
    answer: oneshot::Receiver<Result<Vec<u8>>>,
}

impl RenderQueue {
    /// Requests a picture and cancels the request before.
    pub fn ask(&self, question: RenderRequest) -> PendingRender {
        let (sender, answer) = oneshot::channel();
        let given_up = Arc::<AtomicBool>::default();
        // One lock for both, so that the last request in the queue is the one that is not cancelled.
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        last.store(true, Ordering::Relaxed);
        *last = Arc::clone(&given_up);
        if let Some(jobs) = &*self.jobs.lock().unwrap_or_else(PoisonError::into_inner) {
            // If the worker has stopped, the answer is `Error::Cancelled`.
            let _ = jobs.send(QueuedRender { question, given_up: Arc::clone(&given_up), answer: sender });
        }
        PendingRender { given_up, answer }
    }

    /// Cancels the current request and ends the worker.
    pub fn close(&self) {
        self.jobs.lock().unwrap_or_else(PoisonError::into_inner).take();
        self.last.lock().unwrap_or_else(PoisonError::into_inner).store(true, Ordering::Relaxed);
    }
}

impl PendingRender {
    /// The picture's bytes; [`Error::Cancelled`] if another was requested meanwhile.
    pub async fn answer(mut self) -> Result<Vec<u8>> {
        (&mut self.answer).await.unwrap_or(Err(Error::Cancelled))
    }
}

impl Drop for PendingRender {
    fn drop(&mut self) {
        self.given_up.store(true, Ordering::Relaxed);
    }
}

impl RenderWorker {
    /// Draws requests until the queue is closed.
    pub fn work(self, reference: &Reference<'_>, context: &Context<'_>) {
        let mut subject = ParticleScene { all: reference, smooth: None, some: None };
        for QueuedRender { question, given_up, answer } in self.jobs {
            // The page shows the progress, the terminal does not.
            let cancel = || given_up.load(Ordering::Relaxed) || context.cancelled();
            let watched = context.silent().with_cancel(&cancel);
            let picture = watched.check().and_then(|()| subject.draw(&question, &watched, context));
            // The client may have left.
            let _ = answer.send(picture);
        }
    }
}

/// All particles, and the sample of the last coarse picture.
struct ParticleScene<'a> {
    all: &'a Reference<'a>,
    /// Smoothed particles for densities, made at the first request.
    smooth: Option<Reference<'a>>,
    some: Option<Particles>,
}

impl ParticleScene<'_> {
    /// `whole` is not cancelled with the request: smoothed particles serve all later ones.
    fn draw(&mut self, question: &RenderRequest, context: &Context<'_>, whole: &Context<'_>) -> Result<Vec<u8>> {
        let particles = self.all.particles();
        let number = question.particles(particles.len());
        if number == particles.len() {
            let neighbours = smoothed(number as u64).filter(|_| question.is_density());
            if let (Some(neighbours), None) = (neighbours, &self.smooth) {
                let all = Reference::with_bounds(particles, *self.all.bounds());
                self.smooth = Some(all.smoothed(neighbours, whole)?);
            }
            let smooth = self.smooth.as_ref().filter(|_| neighbours.is_some());
            return question.draw(smooth.unwrap_or(self.all), context);
        }
        // Frees another sample before a new one is made.
        let some = match self.some.take().filter(|some| some.len() == number) {
            Some(some) => some,
            None => {
                let sample = Selection { sample: Some(number as u64), seed: SEED, ..Selection::all() };
                particles.select(sample, &Storage::Memory, context)?
            }
        };
        let reference = Reference::with_bounds(self.some.insert(some), *self.all.bounds());
        question.draw_some(&reference, particles.len() as f64 / number as f64, context)
    }
}

/// Maximum width and height, pixels.
const LARGEST_SIDE: usize = 4096;

/// A request for a picture of all particles. Lengths are in world units.
#[derive(Clone, Debug, Deserialize)]
pub struct RenderRequest {
    camera: Camera,
    /// Radius and opacity of the particles; surface density has none.
    radius: Option<f64>,
    opacity: Option<f64>,
    look: RequestLook,
    width: usize,
    height_pixels: usize,
    /// Whether an orthographic surface density repeats a periodic box; true by default, as in `reference`.
    periodic: Option<bool>,
    /// Share of the particles to draw, for a quick picture; 1 by default.
    share: Option<f64>,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
enum RequestLook {
    Paraview,
    ParaviewNoFxaa,
    Expected,
    Density,
}

impl RenderRequest {
    /// Reads the JSON and checks every number.
    pub fn read(json: &[u8]) -> Result<Self> {
        let question: RenderRequest =
            serde_json::from_slice(json).map_err(|e| Error::argument(format!("not a picture request: {e}")))?;
        let (width, height) = (question.width, question.height_pixels);
        if !((1..=LARGEST_SIDE).contains(&width) && (1..=LARGEST_SIDE).contains(&height)) {
            return Err(Error::argument(format!("a size of {width}x{height} is outside 1 to {LARGEST_SIDE} pixels")));
        }
        if let Some(share) = question.share.filter(|share| !(*share > 0.0 && *share <= 1.0)) {
            return Err(Error::argument(format!("a share of {share} is outside (0, 1]")));
        }
        question.view()?.check(question.size())?;
        Ok(question)
    }

    /// Whether it is a surface density.
    fn is_density(&self) -> bool {
        self.look == RequestLook::Density
    }

    /// Number of particles to draw out of `all`.
    fn particles(&self, all: usize) -> usize {
        ((self.share.unwrap_or(1.0) * all as f64).round() as usize).clamp(1, all.max(1))
    }

    fn size(&self) -> Size {
        Size { width: self.width, height: self.height_pixels }
    }

    fn view(&self) -> Result<View> {
        let (radius, opacity) = match self.look {
            // A view needs both numbers; a surface density uses neither.
            RequestLook::Density => (1.0, 1.0),
            _ => {
                let missing = |part: &str| Error::argument(format!("this style needs {part}"));
                (self.radius.ok_or_else(|| missing("a radius"))?, self.opacity.ok_or_else(|| missing("an opacity"))?)
            }
        };
        if !self.is_density() && matches!(self.camera.projection, Projection::Orthographic { .. }) {
            return Err(Error::argument("orthographic pictures of all particles need style density"));
        }
        Ok(View { name: "view".into(), camera: self.camera, radius, opacity })
    }

    /// Draws grey levels as bytes, or surface densities as little-endian float32; rows from the top.
    fn draw(&self, reference: &Reference<'_>, context: &Context<'_>) -> Result<Vec<u8>> {
        match self.look.of_grey() {
            Some(style) => Ok(reference.draw(&self.view()?, self.size(), style, context)?.data),
            None => Ok(as_bytes(&self.density(reference, context)?)),
        }
    }

    /// [`RenderRequest::draw`] from a sample in which each particle stands for `many`: the expected picture of all
    /// particles, without the shot noise of ParaView's styles.
    fn draw_some(&self, some: &Reference<'_>, many: f64, context: &Context<'_>) -> Result<Vec<u8>> {
        let for_all = |mut plane: Plane| {
            plane.data.iter_mut().for_each(|v| *v = (f64::from(*v) * many) as f32);
            plane
        };
        let Some(style) = self.look.of_grey() else {
            return Ok(as_bytes(&for_all(self.density(some, context)?)));
        };
        let (view, size) = (self.view()?, self.size());
        let tau = for_all(some.optical_depth(&view, size, context)?);
        Ok(tone(&tau, style, view.opacity, view.radius_pixels(size)).data)
    }

    fn density(&self, reference: &Reference<'_>, context: &Context<'_>) -> Result<Plane> {
        let cell = reference.particles().meta.cell.filter(|_| self.periodic != Some(false));
        let view = DensityView::of_cell(&self.view()?, self.size(), reference.bounds(), cell);
        reference.surface_density(&view, self.size(), context)
    }
}

impl RequestLook {
    /// The tone style; `None` for surface density.
    fn of_grey(self) -> Option<ToneStyle> {
        match self {
            RequestLook::Paraview => Some(ToneStyle::Paraview),
            RequestLook::ParaviewNoFxaa => Some(ToneStyle::ParaviewNoFxaa),
            RequestLook::Expected => Some(ToneStyle::Expected),
            RequestLook::Density => None,
        }
    }
}

fn as_bytes(plane: &Plane) -> Vec<u8> {
    plane.data.iter().flat_map(|v| v.to_le_bytes()).collect()
}
