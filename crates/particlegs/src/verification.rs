//! Verification of a file, with or without its snapshot.

use crate::input::{FrameChoice, ModelOrSeries, frame_of_snapshot};
use crate::{Context, Model, Result, Series, Snapshot, Storage};
use particlegs_compress::verify::{SeriesVerification, StoredModel, Verification};
use serde::Serialize;

/// Results of the verification of a model, or of a series and one of its frames.
#[derive(Clone, Debug, Serialize)]
pub struct FileVerification {
    /// Of the model, or of the frame.
    #[serde(flatten)]
    pub model: Verification,
    /// The number of the frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<usize>,
    /// Of all frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub series: Option<SeriesVerification>,
    /// The name of the model, or of the frame.
    #[serde(skip)]
    pub place: String,
    /// Whether the model was merged from several snapshots, so that there is no hash to compare.
    #[serde(skip)]
    pub of_several: bool,
    /// Unit of length, as the file has it.
    #[serde(skip)]
    pub length_unit: Option<String>,
}

impl FileVerification {
    fn new(
        stored: &StoredModel,
        snapshot: Option<&Snapshot>,
        (full, seed): (bool, u64),
        context: &Context<'_>,
    ) -> Result<FileVerification> {
        let with_fields = !stored.model.metadata.fields.is_empty();
        let source = snapshot.map(|s| s.read(with_fields && s.has_fields(), &Storage::Memory, context)).transpose()?;
        let source = source.as_ref().map(|(particles, fields)| (particles, &fields[..]));
        Ok(FileVerification {
            model: stored.verify(source, (full, seed), context)?,
            frame: None,
            series: None,
            place: stored.place.clone(),
            of_several: stored.of_several,
            length_unit: stored.model.metadata.units.length_text().map(String::from),
        })
    }

    /// [`crate::Error::Differs`] if what the file says differs from what was measured, or contradicts itself.
    ///
    /// # Errors
    /// That one alone.
    pub fn judge(&self) -> Result<()> {
        self.model.judge(&self.place)
    }
}

impl Model {
    /// Checks what the file says of itself and, with its snapshot, measures its certificate again: in full, or as far
    /// as the file has one. `seed` draws views where the file has none.
    ///
    /// # Errors
    /// [`crate::Error::Corrupt`]; [`crate::Error::Input`] for another snapshot. A difference is no error here:
    /// [`FileVerification::judge`] makes it one.
    pub fn verify(
        &self,
        snapshot: Option<&Snapshot>,
        (full, seed): (bool, u64),
        context: &Context<'_>,
    ) -> Result<FileVerification> {
        FileVerification::new(&self.stored(context)?, snapshot, (full, seed), context)
    }
}

impl Series {
    /// Decodes every frame, and compares them with each other and with the index.
    ///
    /// # Errors
    /// [`crate::Error::Corrupt`]; [`crate::Error::Cancelled`]. Contradictions are no error here:
    /// [`SeriesVerification::judge`] makes them one.
    pub fn verify(&self, context: &Context<'_>) -> Result<SeriesVerification> {
        SeriesVerification::new(self.decoder().series(), context)
    }

    /// [`Series::verify`], and [`Model::verify`] of one frame: of this number, or that which was made from the
    /// snapshot, or the last. The snapshot's frame is then that which the model's was made from.
    ///
    /// # Errors
    /// As these; [`crate::Error::Differs`] for frames that contradict themselves.
    pub fn verify_frame(
        &self,
        snapshot: Option<&Snapshot>,
        number: Option<i64>,
        (full, seed): (bool, u64),
        context: &Context<'_>,
    ) -> Result<FileVerification> {
        let series = self.verify(context)?;
        series.judge(self.name())?;
        let mut decoder = self.decoder();
        let mut frame = match number {
            None if snapshot.is_some() => decoder.series().last()?,
            number => FrameChoice::from(number).number(decoder.series(), self.name(), context)?,
        };
        let mut source = None;
        if let Some(snapshot) = snapshot {
            let metadata = decoder.frame(frame, context)?.metadata.clone();
            let snapshot = snapshot.clone().with_frame(frame_of_snapshot(&metadata, self.name(), context));
            let (particles, fields) = snapshot.read(!metadata.fields.is_empty(), &Storage::Memory, context)?;
            // The hash of the particles tells the frame; where none has it, the last is compared and differs.
            if number.is_none() {
                frame = series.frame_of(&particles).unwrap_or(frame);
                context.note(&format!(
                    "{}: frame {frame} of {} is compared with the snapshot",
                    self.name(),
                    series.frames
                ));
            }
            source = Some(Snapshot::from(particles).with_fields(fields)?);
        }
        let stored = StoredModel::of_frame(&mut decoder, frame, context)?;
        let verified = FileVerification::new(&stored, source.as_ref(), (full, seed), context)?;
        Ok(FileVerification { frame: Some(frame), series: Some(series), ..verified })
    }
}

impl ModelOrSeries {
    /// [`Model::verify`], or [`Series::verify_frame`].
    ///
    /// # Errors
    /// As these.
    pub fn verify(
        &self,
        snapshot: Option<&Snapshot>,
        number: Option<i64>,
        (full, seed): (bool, u64),
        context: &Context<'_>,
    ) -> Result<FileVerification> {
        match self {
            ModelOrSeries::Model(model) => model.verify(snapshot, (full, seed), context),
            ModelOrSeries::Series(series) => series.verify_frame(snapshot, number, (full, seed), context),
        }
    }
}
