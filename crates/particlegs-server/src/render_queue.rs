//! The queue of the thread that draws. A new request cancels the one before.

use crate::render_request::RenderRequest;
use particlegs_core::context::Context;
use particlegs_core::{Error, Result};
use particlegs_particles::{Particles, Selection, Storage};
use particlegs_reference::Reference;
use particlegs_view::page::smoothed;
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
