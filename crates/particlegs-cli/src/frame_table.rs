//! Tables with a row for each frame of a series.

use particlegs_pipeline::codec::{FrameCoding, SeriesFile};
use particlegs_pipeline::model::{Epoch, Metadata, Units};
use particlegs_pipeline::text::{cell, one_line};

/// A column: its name, its unit, what it is, and what stands in it.
struct FrameColumn {
    name: String,
    unit: Option<String>,
    about: String,
    values: Vec<String>,
}

/// A table whose first line names the columns. What they are, and their units, stand in lines behind `#`.
pub struct FrameTable {
    columns: Vec<FrameColumn>,
}

impl FrameTable {
    /// The number of each frame of a series, what it is, and when. A gap has no metadata.
    pub fn new(series: &SeriesFile<'_>, frames: &[Option<Metadata>], units: &Units) -> FrameTable {
        let kind = |kind: FrameCoding| match kind {
            FrameCoding::Missing => "missing",
            FrameCoding::Keyframe => "keyframe",
            FrameCoding::Change => "changes",
        };
        let column = |name: &str, about: &str, values: Vec<String>| FrameColumn {
            name: name.into(),
            unit: None,
            about: about.into(),
            values,
        };
        let numbers = (0..series.frames.len()).map(|i| i.to_string()).collect();
        let kinds = series.frames.iter().map(|f| kind(f.kind).to_string()).collect();
        let about = "a model of its own (keyframe), changes from the frame before, or missing";
        let mut table =
            FrameTable { columns: vec![column("frame", "its number, from 0", numbers), column("kind", about, kinds)] };
        let epoch = |pick: fn(&Epoch) -> Option<f64>| frames.iter().map(move |m| pick(&m.as_ref()?.epoch));
        let time = units.time.as_ref().map(|u| u.text.clone());
        table.add(("time", time), "of the snapshot", epoch(|e| e.time));
        table.add(("step", None), "time step, as the source numbers it", epoch(|e| e.step.map(|s| s as f64)));
        table.add(("redshift", None), "1 / scale_factor - 1", epoch(Epoch::redshift));
        table.add(("scale_factor", None), "cosmological", epoch(|e| e.scale_factor));
        let particles = frames.iter().map(|m| Some(m.as_ref()?.count as f64));
        table.add(("particles", None), "of the snapshot", particles);
        table
    }

    /// Adds a column, with nothing where a frame has no value or one that is not finite.
    pub fn add(
        &mut self,
        (name, unit): (&str, Option<String>),
        about: &str,
        values: impl IntoIterator<Item = Option<f64>>,
    ) {
        let values = values.into_iter().map(number).collect();
        self.columns.push(FrameColumn { name: name.into(), unit, about: about.into(), values });
    }

    /// The table as CSV, without an end of its last line.
    pub fn text(&self) -> String {
        let row = |cell: &dyn Fn(&FrameColumn) -> String| self.columns.iter().map(cell).collect::<Vec<_>>().join(",");
        let about = |c: &FrameColumn| {
            let unit = c.unit.as_ref().map_or(String::new(), |u| format!(" [{u}]"));
            format!("# {}", one_line(&format!("{}{unit}: {}", c.name, c.about)))
        };
        let rows = self.columns.first().map_or(0, |c| c.values.len());
        let mut lines = vec![row(&|c| cell(&c.name))];
        lines.extend(self.columns.iter().map(about));
        lines.extend((0..rows).map(|i| row(&|c| c.values[i].clone())));
        lines.join("\n")
    }
}

/// A number in as many digits as tell it from others; nothing where there is none.
pub fn number(value: Option<f64>) -> String {
    match value.filter(|v| v.is_finite()) {
        None => String::new(),
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
