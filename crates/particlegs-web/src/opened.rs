//! Open models, partly or completely decoded.

use crate::clip::clipped;
use crate::coarse::{coarse, joined, run};
use crate::picture::FieldFacts;
use crate::question::{FieldRequest, SceneRequest};
use particlegs_core::camera::Extent;
use particlegs_core::codec::{Decoder, SeriesDecoder};
use particlegs_core::context::Context;
use particlegs_core::model::{Block, Layer, Model};
use particlegs_core::render::{self, Scene};
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result};

/// Minimum number of Gaussians decoded in a step, which takes tens of milliseconds.
const STEP: usize = 1 << 15;

/// An open model.
pub(crate) struct LoadedModel {
    pub bounds: Bounds,
    opening: Option<PartialModel>,
    /// The decoded model, or the error that prevents it.
    whole: std::result::Result<CompleteModel, String>,
    /// The series that the model is a moment of.
    series: Option<SeriesDecoder<'static>>,
}

/// A decoded model, and a smaller one for motion if it is large.
struct CompleteModel {
    full: ClippedModel,
    coarse: Option<ClippedModel>,
    extent: Option<Extent>,
    /// Of the last field and layers that were asked for.
    facts: Option<(FieldRequest, Option<Vec<bool>>, FieldFacts)>,
}

/// A partly decoded model.
struct PartialModel {
    decoder: Decoder<'static>,
    /// Remaining pieces, the next one last.
    left: Vec<usize>,
    /// Number of decoded Gaussians.
    decoded: usize,
    sketch: Option<ModelPreview>,
}

/// A preview during decoding, with a block for each piece.
struct ModelPreview {
    part: ClippedModel,
    /// Number of Gaussians merged into one.
    run: usize,
    /// Pieces that are decoded but still boxes here: they are merged when drawn.
    read: Vec<usize>,
}

/// A model, and its part inside the last clip box.
pub(crate) struct ClippedModel {
    pub model: Model,
    clipped: Option<(Bounds, Model, Vec<usize>)>,
}

impl LoadedModel {
    /// A model without decoded Gaussians.
    pub(crate) fn new(decoder: Decoder<'static>) -> Self {
        // Consecutive pieces are neighbours in space. The order of reversed bits spreads them, so that the picture
        // becomes sharper everywhere.
        let mut left: Vec<usize> = (0..decoder.pieces()).collect();
        left.sort_by_key(|piece| std::cmp::Reverse(piece.reverse_bits()));
        let preview = ModelPreview::new(&decoder);
        let bounds = decoder.info().metadata.bounds;
        let opening = Some(PartialModel { decoder, left, decoded: 0, sketch: preview });
        LoadedModel { bounds, opening, whole: Err("the model could not be decoded".into()), series: None }
    }

    /// A series at the time of its clock; `bounds` stay those of this moment.
    pub(crate) fn of_series(mut series: SeriesDecoder<'static>, time: f64) -> Result<Self> {
        let model = series.model_at(time, &Context::SILENT)?;
        let (bounds, whole) = (model.metadata.bounds, Ok(CompleteModel::new(model)));
        Ok(LoadedModel { bounds, opening: None, whole, series: Some(series) })
    }

    /// Shows the series at another time. On an error the moment stays.
    pub(crate) fn set_time(&mut self, time: f64) -> Result<()> {
        let model = self.series()?.model_at(time, &Context::SILENT)?;
        self.whole = Ok(CompleteModel::new(model));
        Ok(())
    }

    pub(crate) fn series(&mut self) -> Result<&mut SeriesDecoder<'static>> {
        self.series.as_mut().ok_or_else(|| Error::argument("the model is not a series"))
    }

    /// Decodes one step; returns the decoded share, 1 at the end.
    pub(crate) fn step(&mut self) -> Result<f64> {
        if let Some(opening) = &mut self.opening {
            match opening.step() {
                Ok(share) if share < 1.0 => return Ok(share),
                Ok(_) => {}
                Err(error) => {
                    // Later queries get the same error: what is left is never decoded.
                    self.opening = None;
                    self.whole = Err(error.to_string());
                    return Err(error);
                }
            }
        }
        self.whole().map(|_| 1.0)
    }

    /// The model to draw: the preview or the smaller model in motion, otherwise the whole model.
    pub(crate) fn shown(&mut self, request: &SceneRequest) -> Result<&Model> {
        let shows_preview = request.coarse && self.opening.as_ref().is_some_and(|o| o.sketch.is_some());
        if !shows_preview {
            let CompleteModel { full, coarse, .. } = self.whole()?;
            return Ok(coarse.as_mut().filter(|_| request.coarse).unwrap_or(full).inside(request.clip));
        }
        let opening = self.opening.as_mut();
        let drawn = opening.and_then(|o| o.sketch.as_mut().map(|s| s.sharpened(&o.decoder).inside(request.clip)));
        drawn.ok_or_else(|| Error::argument("the model is not decoded yet"))
    }

    /// The whole model; decodes the rest if needed.
    pub(crate) fn full(&mut self) -> Result<&mut ClippedModel> {
        Ok(&mut self.whole()?.full)
    }

    /// The extent that an orthographic view has to show.
    pub(crate) fn extent(&mut self) -> Result<Extent> {
        let CompleteModel { full: ClippedModel { model, .. }, extent, .. } = self.whole()?;
        let whole_extent = || render::extent(&Scene::new(model), model.metadata.cell.as_ref());
        // The page draws no periodic images by default, so the extent includes the tails of Gaussians at the edges.
        Ok(*extent.get_or_insert_with(|| Extent { periodic: [false; 3], ..whole_extent() }))
    }

    /// What all pictures of a field have in common, computed once for the same field and layers.
    pub(crate) fn field_facts(&mut self, request: &SceneRequest, field: &FieldRequest) -> Result<FieldFacts> {
        let CompleteModel { full, facts, .. } = self.whole()?;
        if let Some((last_field, layers, last_facts)) = facts
            && last_field == field
            && *layers == request.layers
        {
            return Ok(last_facts.clone());
        }
        let field_facts = FieldFacts::new(&full.model, request, field)?;
        *facts = Some((field.clone(), request.layers.clone(), field_facts.clone()));
        Ok(field_facts)
    }

    fn whole(&mut self) -> Result<&mut CompleteModel> {
        if let Some(PartialModel { decoder, .. }) = self.opening.take() {
            self.whole = decoder.finish().map(CompleteModel::new).map_err(|e| e.to_string());
        }
        self.whole.as_mut().map_err(|line| Error::argument(line.clone()))
    }
}

impl CompleteModel {
    fn new(model: Model) -> Self {
        let coarse = coarse(&model).map(ClippedModel::new);
        CompleteModel { coarse, full: ClippedModel::new(model), extent: None, facts: None }
    }
}

impl PartialModel {
    /// Decodes at least [`STEP`] Gaussians; returns the decoded share.
    fn step(&mut self) -> Result<f64> {
        let enough = self.decoded + STEP;
        while self.decoded < enough
            && let Some(piece) = self.left.pop()
        {
            self.decoder.read(piece)?;
            self.decoded += self.decoder.gaussians(piece);
            if let Some(preview) = &mut self.sketch {
                preview.read.push(piece);
            }
        }
        let all = self.decoder.info().gaussians();
        Ok(if self.left.is_empty() { 1.0 } else { self.decoded as f64 / all as f64 })
    }
}

impl ModelPreview {
    /// All pieces as boxes; `None` for models with one piece or few Gaussians.
    fn new(decoder: &Decoder<'_>) -> Option<ModelPreview> {
        let info = decoder.info();
        let run = run(info.gaussians(), info.metadata.law).filter(|_| decoder.pieces() > 1)?;
        let mut pieces = (0..decoder.pieces()).peekable();
        let bounds = info.metadata.bounds;
        let stored: Vec<Layer<Vec<Block>>> = info
            .layers
            .iter()
            .enumerate()
            .map(|(place, layer)| {
                let layer_pieces = std::iter::from_fn(|| pieces.next_if(|p| decoder.layer(*p) == place));
                let boxes = layer_pieces.filter_map(|piece| decoder.so_far(piece));
                // Drawing does not use count and mass.
                layer.with(boxes.map(|gaussians| Block { bounds, count: 0, mass: 0.0, gaussians }).collect())
            })
            .collect();
        // The first of species that share Gaussians shows all of them.
        let mut stored = stored.into_iter().peekable();
        let layers = info.species_layers().into_iter().map(|layer| {
            let stored_layer =
                stored.next_if(|s| s.name == layer.name || s.name.starts_with(&format!("{}+", layer.name)));
            layer.with(stored_layer.map_or_else(Vec::new, |s| s.content))
        });
        let model = Model { layers: layers.collect(), metadata: info.metadata.clone(), certificate: None };
        Some(ModelPreview { part: ClippedModel::new(model), run, read: Vec::new() })
    }

    /// Replaces the boxes of decoded pieces by their Gaussians.
    fn sharpened(&mut self, decoder: &Decoder<'_>) -> &mut ClippedModel {
        if !self.read.is_empty() {
            let mut blocks: Vec<&mut Block> = self.part.model.layers.iter_mut().flat_map(|l| &mut l.content).collect();
            for piece in self.read.drain(..) {
                if let Some(read) = decoder.so_far(piece) {
                    blocks[piece].gaussians = joined(&read, self.run);
                }
            }
            self.part.clipped = None;
        }
        &mut self.part
    }
}

impl ClippedModel {
    fn new(model: Model) -> Self {
        ClippedModel { model, clipped: None }
    }

    /// The part inside a box.
    pub(crate) fn inside(&mut self, bounds: Option<Bounds>) -> &Model {
        let Some(bounds) = bounds else { return &self.model };
        if self.clipped.as_ref().is_none_or(|(clip, ..)| *clip != bounds) {
            let (part, numbers) = clipped(&self.model, &bounds);
            self.clipped = Some((bounds, part, numbers));
        }
        self.clipped.as_ref().map_or(&self.model, |(_, inside, _)| inside)
    }

    /// The index in the file of Gaussian `i` of the last result of [`ClippedModel::inside`].
    pub(crate) fn number(&self, i: usize, bounds: Option<Bounds>) -> usize {
        self.clipped.as_ref().filter(|_| bounds.is_some()).map_or(i, |(_, _, numbers)| numbers[i])
    }
}
