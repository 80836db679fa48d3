//! Several pictures in one figure: one range, one colour bar.

use crate::finish::{Finisher, bytes};
use crate::picture_out::PictureOut;
use crate::view_content::ViewRenderer;
use particlegs_core::camera::ViewSet;
use particlegs_core::context::Context;
use particlegs_core::picture::Plane;
use particlegs_core::{Error, Result};
use particlegs_files::output::write_bytes;
use std::path::PathBuf;

/// Most panels of a figure.
const MOST: usize = 100;

/// Panels and their layout.
pub struct Panels<'a> {
    /// Painters with their names.
    pub painters: Vec<(String, &'a ViewRenderer<'a>)>,
    /// Captions instead of names.
    pub captions: Vec<String>,
    /// Panels per row.
    pub columns: Option<usize>,
}

impl Panels<'_> {
    /// Panels per row: one per model, or up to three for a single model.
    pub fn columns(&self, views: usize) -> usize {
        let default_columns = if self.painters.len() > 1 { self.painters.len() } else { views.min(3) };
        self.columns.unwrap_or(default_columns).clamp(1, self.painters.len() * views)
    }

    /// Draws every view of every model into one figure; returns the common range.
    pub fn draw(
        &self,
        finish: &Finisher<'_>,
        set: &ViewSet,
        range: Option<[f64; 2]>,
        out: &PictureOut,
        context: &Context<'_>,
    ) -> Result<(PathBuf, Option<[f64; 2]>)> {
        let count = self.painters.len() * set.views.len();
        if count > MOST {
            return Err(Error::argument(format!("{count} panels are too many for one figure: {MOST} at most")));
        }
        if !self.captions.is_empty() && self.captions.len() != count {
            let message = format!("{} captions are given, but there are {count} panels", self.captions.len());
            return Err(Error::argument(message));
        }
        let density = finish.shows_values();
        // All contents are held until their common range is known: of a field means in f64 and densities in f32. Then come the
        // panels' colours beside them.
        let bytes_per_pixel = if density { 12 + 4 } else { 4 + 4 };
        context.require_memory("panels", count as u64 * set.size.pixels() as u64 * bytes_per_pixel)?;
        let mut contents = Vec::with_capacity(count);
        for view in &set.views {
            // All models of one view come before the next view: captions and panels rely on this order.
            for (_, painter) in &self.painters {
                let content = (painter.draw)(view, set.size)?;
                content.say_if_empty(view, context);
                contents.push(content);
            }
        }
        let range = match (range, density) {
            (None, true) => Some(finish.common_range(contents.iter().map(|s| finish.range_of(s)))),
            (range, _) => range,
        };
        // Grey levels have no range, but a figure takes one.
        let shown_range = range.unwrap_or(Plane::EMPTY_RANGE);
        let mut panels = Vec::with_capacity(count);
        for (i, content) in contents.into_iter().enumerate() {
            let view = &set.views[i / self.painters.len()];
            let mut panel = finish.panel(content, view, shown_range, out.kind())?;
            panel.caption = (!finish.options.no_annotations).then(|| self.caption(i, set)).filter(|c| !c.is_empty());
            panels.push(panel);
        }
        let path = out.picture("panels");
        let about = finish.about(&set.views, set.size, shown_range)?;
        let figure = finish.figure(panels, self.columns(set.views.len()), shown_range);
        write_bytes(&path, &bytes(&figure, finish.options, out.kind(), &about)?)?;
        Ok((path, range))
    }

    fn caption(&self, i: usize, set: &ViewSet) -> String {
        if let Some(given) = self.captions.get(i) {
            return given.clone();
        }
        let (name, view) = (&self.painters[i % self.painters.len()].0, &set.views[i / self.painters.len()].name);
        match (self.painters.len(), set.views.len()) {
            (_, 1) => name.clone(),
            (1, _) => view.clone(),
            _ => format!("{name}, {view}"),
        }
    }
}
