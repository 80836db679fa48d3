//! Tables with a row for each frame of a series.

use particlegs_core::codec::{FrameCoding, FrameEntry};
use particlegs_core::model::{Epoch, Metadata, Units};
use particlegs_core::text::{cell, one_line};

/// A table whose first line names the columns; descriptions and units stand in lines behind `#`. Values are those of
/// the frames that are there.
pub struct FrameTable {
    head: String,
    remarks: String,
    /// Each frame's row, and whether it is there.
    rows: Vec<(String, bool)>,
}

/// The kind of a frame, in a word.
pub fn kind_of(kind: FrameCoding) -> &'static str {
    match kind {
        FrameCoding::Missing => "missing",
        FrameCoding::Keyframe => "keyframe",
        FrameCoding::Change => "changes",
    }
}

impl FrameTable {
    /// The number, kind and time of each frame of a series. `frames` are those that are there.
    pub fn new(entries: &[FrameEntry], frames: &[Metadata], units: &Units) -> FrameTable {
        let about_kind = "a model of its own (keyframe), changes from the frame before, or missing";
        let row = |(number, frame): (usize, &FrameEntry)| {
            (format!("\n{number},{}", kind_of(frame.kind)), frame.kind != FrameCoding::Missing)
        };
        let mut table = FrameTable {
            head: "frame,kind".into(),
            remarks: format!("\n# frame: its number, from 0\n# kind: {about_kind}"),
            rows: entries.iter().enumerate().map(row).collect(),
        };
        let epoch = |pick: fn(&Epoch) -> Option<f64>| frames.iter().map(move |m| pick(&m.epoch));
        let time = units.time.as_ref().map(|u| u.text.clone());
        table.add(("time", time), "of the snapshot", epoch(|e| e.time));
        table.add(("step", None), "time step, as the source numbers it", epoch(|e| e.step.map(|s| s as f64)));
        table.add(("redshift", None), "1 / scale_factor - 1", epoch(Epoch::redshift));
        table.add(("scale_factor", None), "cosmological", epoch(|e| e.scale_factor));
        table.add(("particles", None), "of the snapshot", frames.iter().map(|m| Some(m.count as f64)));
        table
    }

    /// Adds a column, with nothing where a frame has no value or one that is not finite.
    pub fn add(
        &mut self,
        (name, unit): (&str, Option<String>),
        about: &str,
        values: impl IntoIterator<Item = Option<f64>>,
    ) {
        self.head += &format!(",{}", cell(name));
        let unit = unit.map_or(String::new(), |u| format!(" [{u}]"));
        self.remarks += &format!("\n# {}", one_line(&format!("{name}{unit}: {about}")));
        let mut values = values.into_iter();
        for (row, is_there) in &mut self.rows {
            let value = if *is_there { values.next().flatten() } else { None };
            *row += &format!(",{}", number(value));
        }
    }

    /// The table as CSV, without an end of its last line.
    pub fn text(&self) -> String {
        [&self.head, &self.remarks].into_iter().chain(self.rows.iter().map(|r| &r.0)).cloned().collect()
    }
}

/// A number in as many digits as tell it from others; nothing where there is none.
pub(super) fn number(value: Option<f64>) -> String {
    match value.filter(|v| v.is_finite()) {
        None => String::new(),
        // `{v}` has no exponent: far from 1 it would write hundreds of digits.
        Some(v) if v == 0.0 || (1e-4..1e17).contains(&v.abs()) => format!("{v}"),
        Some(v) => format!("{v:e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_that_were_written() {
        let all = [0.0, -0.25, 1e-7, 1.0 / 3.0, 4096.0, -3.5e22];
        assert_eq!(all.map(|v| number(Some(v)).parse::<f64>()), all.map(Ok));
        assert_eq!([number(Some(4096.0)), number(Some(1e-7))], ["4096", "1e-7"]);
        assert_eq!([number(None), number(Some(f64::NAN))], ["", ""]);
    }
}
