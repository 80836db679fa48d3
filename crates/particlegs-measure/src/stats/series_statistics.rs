//! Statistics of a whole series: a table with a row for each frame, its spectra, and plots over time.

use super::frame_table::{FrameTable, number};
use super::presentation::{AxisUnits, ChartParts, chart, curve};
use super::{Evolution, FieldMean, FrameStatistics, Measure, StatsOptions, WaveShell};
use particlegs_core::codec::{FrameCoding, FrameEntry, SeriesClock, SeriesDecoder, SeriesFile};
use particlegs_core::context::Context;
use particlegs_core::model::{Metadata, Model, Units, per_length};
use particlegs_core::{Error, Result};
use particlegs_figure::{FileKind, Plot, PlotAxis, PlotSeries, number as short, write_plots};
use particlegs_files::output::{Outputs, write_bytes, write_json};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Wave numbers whose power is in the table and the plot.
const WAVES: usize = 5;
/// Groups are counted from so many particles on.
const SIZES: [u64; 3] = [20, 100, 1000];

/// Statistics of each frame of a series that is there. As JSON it is a record with a row for each frame.
pub struct SeriesStatistics {
    clock: SeriesClock,
    entries: Vec<FrameEntry>,
    name: String,
    options: Value,
    units: Units,
    frames: Vec<Metadata>,
    found: Vec<Option<FrameStatistics>>,
    linking_length: Option<String>,
    /// Wave numbers of the first frame's shells, at most [`WAVES`].
    waves: Vec<f64>,
}

impl SeriesStatistics {
    /// Measures of a frame alone.
    pub const MEASURES: [Measure; 2] = [Measure::Spectrum, Measure::Groups];

    /// Measures every frame of the series called `name`, of the layers that `choose` takes: of [`Self::MEASURES`]
    /// what the options name, and means of fields. A frame without these layers has no statistics.
    ///
    /// # Errors
    /// [`Error::Argument`] for options out of range and other measures; [`Error::Input`] for frames that cannot be
    /// compared, and where none has the layers; those of decoding.
    pub fn new(
        name: &str,
        series: &SeriesFile<'_>,
        options: StatsOptions,
        choose: impl Fn(Model) -> Result<Model>,
        context: &Context<'_>,
    ) -> Result<Self> {
        // All measures are the default: those that need two inputs are then left out without a word.
        let pairs = options.measures.iter().find(|m| !Self::MEASURES.contains(m));
        if let Some(measure) = pairs.filter(|_| options.measures.len() < Measure::ALL.len()) {
            let names = Self::MEASURES.map(Measure::name).join(" and ");
            let message = format!("{} compares two inputs; of a series alone there are {names}", measure.name());
            return Err(Error::argument(message));
        }
        let record = json!(&options);
        let mut evolution = Evolution::new(options)?;
        let mut decoder = SeriesDecoder::new(series);
        let (mut frames, mut found, mut without) = (Vec::new(), Vec::new(), None);
        for number in series.there() {
            let model = decoder.frame(number, context)?.clone().into_model();
            let metadata = model.metadata.clone();
            // A species may appear later.
            let model = match choose(model) {
                Ok(model) => model,
                Err(error) => {
                    without.get_or_insert(error);
                    frames.push(Metadata { count: 0, ..metadata });
                    found.push(None);
                    continue;
                }
            };
            let statistics = evolution.measure(&model, &series.name(number), context)?;
            statistics.notes.iter().for_each(|note| context.note(note));
            frames.push(model.metadata);
            found.push(Some(statistics));
        }
        if found.iter().all(Option::is_none) {
            return Err(without.unwrap_or_else(|| Error::input(name, "the series has no frames")));
        }
        let first = found.iter().flatten().next().map_or(&[][..], |f| &f.spectrum);
        let waves = chosen_waves(first);
        let linking_length = evolution.options.linking_length;
        let (name, units, clock, entries) = (name.to_string(), series.units()?, series.clock, series.frames.clone());
        Ok(SeriesStatistics { clock, entries, name, options: record, units, frames, found, linking_length, waves })
    }

    /// The statistics of each frame that is there, in order; `None` of one without the chosen layers.
    pub fn frames(&self) -> impl Iterator<Item = (usize, &Metadata, Option<&FrameStatistics>)> {
        let all = self.there().zip(&self.frames).zip(&self.found);
        all.map(|((number, metadata), statistics)| (number, metadata, statistics.as_ref()))
    }

    fn there(&self) -> impl Iterator<Item = usize> {
        (0..self.entries.len()).filter(|&i| self.entries[i].kind != FrameCoding::Missing)
    }

    fn values<T>(&self, pick: impl Fn(&FrameStatistics) -> Option<T>) -> Vec<Option<T>> {
        self.found.iter().map(|f| f.as_ref().and_then(&pick)).collect()
    }

    fn power(&self, k: f64) -> Vec<Option<f64>> {
        self.values(|f| power_at(&f.spectrum, k))
    }

    fn groups(&self, from: u64) -> Vec<Option<f64>> {
        self.values(|f| Some(f.groups.as_ref()?.iter().filter(|n| **n >= from).count() as f64))
    }

    fn has_groups(&self) -> bool {
        self.found.iter().flatten().any(|f| f.groups.is_some())
    }

    /// Components of fields that any frame has, as the first that has them says.
    fn components(&self) -> Vec<&FieldMean> {
        let mut all: Vec<&FieldMean> = Vec::new();
        for mean in self.found.iter().flatten().flat_map(|f| &f.fields) {
            if !all.iter().any(|m| m.component == mean.component) {
                all.push(mean);
            }
        }
        all
    }

    /// Values of a component in the unit that the first frame has it in; frames with another have none.
    fn mean(&self, field_mean: &FieldMean) -> Vec<Option<f64>> {
        let same = |m: &&FieldMean| {
            m.component == field_mean.component && m.unit == field_mean.unit && m.is_sum == field_mean.is_sum
        };
        self.values(|f| Some(f.fields.iter().find(same)?.value))
    }

    fn volume_unit(&self) -> Option<String> {
        self.units.length_text().map(|u| if u.contains(['/', ' ']) { format!("({u})^3") } else { format!("{u}^3") })
    }

    fn wave_text(&self, k: f64) -> String {
        let unit = self.units.length_text().map_or(String::new(), |u| format!(" {}", per_length(u)));
        format!("{}{unit}", short(k))
    }

    /// The rows of the frames as CSV.
    fn table(&self) -> String {
        let mut table = FrameTable::new(&self.entries, &self.frames, &self.units);
        for &k in &self.waves {
            let about = format!("P(k) at k = {}, of the mixture", self.wave_text(k));
            table.add((&format!("power_{}", short(k)), self.volume_unit()), &about, self.power(k));
        }
        if self.has_groups() {
            for from in SIZES {
                // A number has the unit of the series; another text names its own.
                let length = self.linking_length.as_deref().unwrap_or("-");
                let unit = self.units.length_text().filter(|_| length.parse::<f64>().is_ok());
                let unit = unit.map_or(String::new(), |unit| format!(" {unit}"));
                let about = format!("friends of friends of drawn particles, linked within {length}{unit}");
                table.add((&format!("groups_{from}"), None), &about, self.groups(from));
            }
        }
        for mean in self.components() {
            let (word, about) = match mean.is_sum {
                true => ("total", "sum over all particles"),
                false => ("mean", "over all particles, weighted by mass where that is known"),
            };
            table.add((&format!("{word}_{}", mean.component), mean.unit.clone()), about, self.mean(mean));
        }
        table.text() + "\n"
    }

    /// All spectra as CSV: a row for each shell of each frame.
    fn spectra(&self) -> String {
        let mut csv = "frame,time,step,redshift,scale_factor,k_low,k_high,k,modes,power\n".to_string();
        for ((i, statistics), m) in self.there().zip(&self.found).zip(&self.frames) {
            let Some(statistics) = statistics else { continue };
            let when = [m.epoch.time, m.epoch.step.map(|s| s as f64), m.epoch.redshift(), m.epoch.scale_factor];
            let when = when.map(number).join(",");
            for WaveShell { edges, k, modes, power } in &statistics.spectrum {
                let [low, high, k, power] = [edges[0], edges[1], *k, *power].map(|v| number(Some(v)));
                let _ = writeln!(csv, "{i},{when},{low},{high},{k},{modes},{power}");
            }
        }
        csv
    }

    /// Writes `stats.json`, `frames.csv`, where there are spectra `power_frames.csv`, and plots of each kind into a
    /// folder, all or none.
    ///
    /// # Errors
    /// [`Error::Output`] for a file that is there and was not made by this function; [`Error::Io`].
    pub fn write(
        &self,
        folder: &Path,
        plots: &[FileKind],
        outputs: &Outputs,
        context: &Context<'_>,
    ) -> Result<Vec<PathBuf>> {
        let fill = |folder: &Path| {
            write_bytes(&folder.join("frames.csv"), self.table().as_bytes())?;
            if !self.waves.is_empty() {
                write_bytes(&folder.join("power_frames.csv"), self.spectra().as_bytes())?;
            }
            self.figures().iter().try_for_each(|figure| write_plots(folder, figure, plots))?;
            write_json(&folder.join("stats.json"), self)
        };
        outputs.write_set(folder, fill, context)
    }

    /// Figures over time: power at a few wave numbers, numbers of groups, and means of fields below one another.
    fn figures(&self) -> Vec<ChartParts> {
        let brackets = |unit: Option<String>| unit.map_or(String::new(), |u| format!(" [{u}]"));
        let plot = |name: &str, title: &str, y: PlotAxis, series: Vec<PlotSeries>| {
            chart(name, title, [self.clock_axis(), y], series, Vec::new())
        };
        let power = self.waves.iter().enumerate().map(|(i, &k)| {
            let name = format!("k = {}", self.wave_text(k));
            self.curve(&name, i, self.power(k).into_iter())
        });
        let y = PlotAxis::logarithmic(format!("P(k){}", AxisUnits::new(self.units.length_text()).volume));
        let mut figures = vec![plot("power_frames", "Power spectrum over time", y, power.collect())];
        if self.has_groups() {
            let series = SIZES.iter().enumerate().map(|(i, from)| {
                let name = format!("{from} particles and more");
                self.curve(&name, i, self.groups(*from).into_iter())
            });
            let y = PlotAxis::linear("groups");
            figures.push(plot("groups_frames", "Friends-of-friends groups over time", y, series.collect()));
        }
        let mut fields: Vec<Plot> = Vec::new();
        let components = self.components();
        for field_components in components.chunk_by(|a, b| a.field == b.field) {
            let series = field_components.iter().enumerate().map(|(i, mean)| {
                let name = if field_components.len() > 1 { &mean.component[..] } else { "" };
                self.curve(name, i, self.mean(mean).into_iter())
            });
            let title = if fields.is_empty() { "Fields over time" } else { "" };
            let word = if field_components[0].is_sum { "total" } else { "mean" };
            let y = PlotAxis::linear(format!(
                "{word} {}{}",
                field_components[0].field,
                brackets(field_components[0].unit.clone())
            ));
            fields.extend(plot("fields_frames", title, y, series.collect()));
        }
        figures.push(fields);
        figures
    }

    fn clock_axis(&self) -> PlotAxis {
        let unit = self.units.time.as_ref().filter(|_| self.clock == SeriesClock::Time);
        PlotAxis::linear(format!("{}{}", self.clock.name(), unit.map_or(String::new(), |u| format!(" [{}]", u.text))))
    }

    fn curve(&self, name: &str, style: usize, values: impl Iterator<Item = Option<f64>>) -> PlotSeries {
        let at = |(value, frame): (Option<f64>, usize)| Some((self.entries[frame].time, value?));
        curve(name, style, false, values.zip(self.there()).filter_map(at).collect())
    }

    /// The first and the last value of each quantity, a line each.
    pub fn text(&self) -> String {
        let numbers: Vec<usize> = self.there().collect();
        let measured_frames: Vec<usize> = (0..self.found.len()).filter(|&i| self.found[i].is_some()).collect();
        let (Some(&first), Some(&last)) = (measured_frames.first(), measured_frames.last()) else {
            return String::new();
        };
        let when = |i: usize| self.clock.text(self.entries[numbers[i]].time, &self.units);
        let mut text = format!("{} frames, {} to {}", measured_frames.len(), when(first), when(last));
        let mut line = |name: String, values: Vec<Option<f64>>, unit: Option<String>| {
            let shown = |i: usize| values[i].map_or("-".into(), short);
            let unit = unit.map_or(String::new(), |u| format!(" {u}"));
            let _ = write!(text, "\n{name:<36} {} to {}{unit}", shown(first), shown(last));
        };
        for &k in &self.waves {
            line(format!("P(k) at {}", self.wave_text(k)), self.power(k), self.volume_unit());
        }
        if self.has_groups() {
            SIZES.iter().for_each(|n| line(format!("groups of {n} particles and more"), self.groups(*n), None));
        }
        for mean in self.components() {
            let word = if mean.is_sum { "total" } else { "mean" };
            line(format!("{word} {}", mean.component), self.mean(mean), mean.unit.clone());
        }
        text
    }
}

impl Serialize for SeriesStatistics {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let mut frames = self.frames();
        let mut record = |(frame, entry): (usize, &FrameEntry)| {
            let measured = if entry.kind == FrameCoding::Missing { None } else { frames.next() };
            let missing = || json!({ "frame": frame, "kind": "missing" });
            measured.map_or_else(missing, |(frame, metadata, statistics)| frame_record(frame, metadata, statistics))
        };
        SeriesRecord {
            series: &self.name,
            clock: self.clock.name(),
            length_unit: self.units.length_text(),
            linking_length: self.linking_length.as_deref(),
            tool_version: env!("CARGO_PKG_VERSION"),
            options: &self.options,
            frames: self.entries.iter().enumerate().map(&mut record).collect(),
        }
        .serialize(serializer)
    }
}

#[derive(Serialize)]
struct SeriesRecord<'a> {
    series: &'a str,
    clock: &'static str,
    length_unit: Option<&'a str>,
    linking_length: Option<&'a str>,
    tool_version: &'static str,
    options: &'a Value,
    frames: Vec<Value>,
}

fn frame_record(frame: usize, m: &Metadata, measurement: Option<&FrameStatistics>) -> Value {
    let nothing = FrameStatistics::default();
    let statistics = measurement.unwrap_or(&nothing);
    let groups: Option<Vec<Value>> = statistics.groups.as_ref().map(|sizes| {
        let number = |from: &u64| sizes.iter().filter(|n| *n >= from).count();
        SIZES.iter().map(|from| json!({ "from": from, "groups": number(from) })).collect()
    });
    json!({
        "frame": frame, "time": m.epoch.time, "step": m.epoch.step, "redshift": m.epoch.redshift(),
        "scale_factor": m.epoch.scale_factor, "particles": m.count, "spectrum": statistics.spectrum,
        "groups": groups, "fields": statistics.fields,
    })
}

/// Wave numbers of shells in about equal factors, from the first to the last.
fn chosen_waves(shells: &[WaveShell]) -> Vec<f64> {
    let (Some(first), Some(last)) = (shells.first(), shells.last()) else { return Vec::new() };
    let nearest =
        |k: f64| shells.iter().map(|s| s.k).min_by(|a, b| libm::log(a / k).abs().total_cmp(&libm::log(b / k).abs()));
    let step = libm::log(last.k / first.k) / (WAVES - 1) as f64;
    let mut waves: Vec<f64> = (0..WAVES).filter_map(|i| nearest(first.k * libm::exp(step * i as f64))).collect();
    waves.dedup();
    waves
}

/// The power at a wave number, between shells by the logarithms of both; `None` beyond them.
fn power_at(shells: &[WaveShell], k: f64) -> Option<f64> {
    let after = shells.partition_point(|s| s.k < k);
    let next = shells.get(after)?;
    if next.k == k {
        return Some(next.power);
    }
    let before = shells.get(after.checked_sub(1)?)?;
    let share = libm::log(k / before.k) / libm::log(next.k / before.k);
    (before.power > 0.0 && next.power > 0.0).then(|| before.power * libm::pow(next.power / before.power, share))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_between_shells_follows_a_power_law() {
        let shell = |k: f64| WaveShell { edges: [k, k], k, modes: 1, power: 100.0 * k.powi(-2) };
        let shells: Vec<WaveShell> = (1..=64).map(|i| shell(f64::from(i))).collect();
        assert_eq!(power_at(&shells, 4.0), Some(6.25));
        assert!((power_at(&shells, 4.5).unwrap() / (100.0 / 20.25) - 1.0).abs() < 1e-12);
        assert_eq!([0.5, 65.0].map(|k| power_at(&shells, k)), [None; 2]);
        assert_eq!(chosen_waves(&shells), [1.0, 3.0, 8.0, 23.0, 64.0]);
        assert_eq!(chosen_waves(&shells[..2]), [1.0, 2.0]);
        assert_eq!(chosen_waves(&[]), [0.0; 0]);
    }
}
