//! Frames of a film, drawn and written in parallel, with one colour range for all.

use crate::finish::Finisher;
use crate::gif::{self, GifFrame};
use crate::picture_out::PictureOut;
use crate::run::DrawingJob;
use crate::view_content::{ViewContent, ViewRenderer};
use particlegs_core::camera::ViewSet;
use particlegs_core::context::Context;
use particlegs_core::picture::{Plane, Size};
use particlegs_core::{Error, Hint, Result, parallel};
use particlegs_figure::FigureImage;
use particlegs_figure::png_file::{PngMetadata, coded};
use particlegs_files::memory::available_bytes;
use particlegs_files::output::write_bytes;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// The drawn frames.
pub struct FrameSeries {
    /// Seconds per frame, including writing.
    pub seconds: Vec<f64>,
    /// Frames of a GIF, if one is made.
    pub gif: Vec<GifFrame>,
    /// Common range.
    pub range: Option<[f64; 2]>,
}

/// Destinations of frames.
pub struct FrameOutputs<'a> {
    /// A folder of PNGs.
    pub files: Option<&'a PictureOut>,
    /// A GIF with this number of frames per second.
    pub gif: Option<u32>,
}

/// Memory for drawn values that wait for the range of all frames, bytes, and at most a quarter of what is free; frames
/// beyond it are drawn twice.
const WAITING: u64 = 1 << 30;

/// Values of frames that wait for their colours.
type WaitingFrames = Vec<Mutex<Option<ViewContent>>>;

/// Common range of these views, each of which is drawn once, and what was drawn of the first of them.
fn one_range(
    renderer: &ViewRenderer<'_>,
    finish: &Finisher<'_>,
    set: &ViewSet,
    context: &Context<'_>,
) -> Result<([f64; 2], WaitingFrames)> {
    context.begin("one range for all frames", set.views.len() as u64);
    // A field's values are f64 beside an f32 that shades them, a density's are f32.
    let pixel_bytes = if finish.field.is_some() { 12 } else { 4 };
    let waiting_bytes = available_bytes().map_or(WAITING, |free| WAITING.min(free / 4)) as usize;
    let most = waiting_bytes / (pixel_bytes * set.size.pixels().max(1));
    let drawn = each(renderer, set.views.len(), |i| {
        let content = (renderer.draw)(&set.views[i], set.size)?;
        let range = finish.range_of(&content);
        context.advance(1);
        Ok((range, Mutex::new(Some(content).filter(|_| i < most))))
    });
    context.end();
    let (ranges, waiting): (Vec<_>, WaitingFrames) = drawn?.into_iter().unzip();
    Ok((finish.common_range(ranges), waiting))
}

/// Works on every view, in parallel if the renderer allows it.
fn each<T: Send>(
    renderer: &ViewRenderer<'_>,
    views: usize,
    task: impl Fn(usize) -> Result<T> + Sync,
) -> Result<Vec<T>> {
    match renderer.side_by_side {
        true => parallel::try_map_range(views, task),
        false => (0..views).map(task).collect(),
    }
}

/// Draws all frames. An error stops further frames; existing ones are complete.
pub fn draw(job: &DrawingJob<'_>, into: &FrameOutputs<'_>) -> Result<FrameSeries> {
    let DrawingJob { painter, finish, set, options, context, .. } = *job;
    let (density, count) = (finish.shows_values(), set.views.len());
    let (range, waiting) = match (options.range, density) {
        (None, true) => one_range(painter, finish, set, context).map(|(range, waiting)| (Some(range), waiting))?,
        (range, _) => (range, Vec::new()),
    };
    let shown_range = range.unwrap_or(Plane::EMPTY_RANGE);
    let written = AtomicUsize::new(0);
    let size = Mutex::new(None);
    context.begin("drawing frames", count as u64);
    let frame = |i: usize| {
        context.check()?;
        let (started, view) = (Instant::now(), &set.views[i]);
        let values = waiting.get(i).and_then(|content| content.lock().unwrap_or_else(|e| e.into_inner()).take());
        let content = values.map_or_else(|| (painter.draw)(view, set.size), Ok)?;
        let (image, dpi) = finish.pixels(content, view, shown_range)?;
        of_one_size(&size, &image)?;
        if let Some(out) = into.files {
            let about = PngMetadata { dpi, ..finish.about(std::slice::from_ref(view), set.size, shown_range)? };
            write_bytes(&out.picture(&view.name), &coded(&image, &about)?)?;
            written.fetch_add(1, Ordering::Relaxed);
        }
        let gif = into.gif.map(|fps| gif::coded(image, fps)).transpose()?;
        context.advance(1);
        Ok((started.elapsed().as_secs_f64(), gif))
    };
    let all = each(painter, count, frame);
    context.end();
    let all = match into.files {
        Some(out) => out.count(written.into_inner(), count, all, context),
        None => all,
    }?;
    let (seconds, gif): (Vec<f64>, Vec<Option<GifFrame>>) = all.into_iter().unzip();
    Ok(FrameSeries { seconds, gif: gif.into_iter().flatten().collect(), range })
}

/// Frames of a film must have one size, which growing labels could change.
fn of_one_size(first: &Mutex<Option<Size>>, image: &FigureImage) -> Result<()> {
    let size = *first.lock().unwrap_or_else(|e| e.into_inner()).get_or_insert(image.size());
    if size == image.size() {
        return Ok(());
    }
    let hint =
        Hint::from("omit labels with ").option("no-annotations", "").words(", or use ").option("colorbar", "inside");
    Err(Error::argument_with("labels of different widths make the frames different in size", hint))
}
