//! Writes the results of experiments to a folder.

use crate::report::{Provenance, ReportSection, csv, html, markdown};
use crate::results::{Colours, Pictures};
use particlegs_core::picture::{Gray8, Rgb8};
use particlegs_core::{Error, Result};
use particlegs_figure::png_file::{PngMetadata, coded};
use particlegs_figure::{ColourBar, Figure, FigureImage, FigureSpace, FileKind, Panel, layout, raster, write_plots};
use particlegs_files::output::write_bytes;
use std::path::{Path, PathBuf};

const RESULTS: &str = "results.json";

/// The cache in an output folder, which must be new, empty or contain results; `make` makes the folder.
pub fn folder(output: &Path, make: impl FnOnce(&Path) -> Result<()>) -> Result<PathBuf> {
    let io = |e| Error::io(output, e);
    if output.is_dir() {
        let names: Vec<_> = std::fs::read_dir(output).map_err(io)?.filter_map(|e| Some(e.ok()?.file_name())).collect();
        if !(names.is_empty() || names.iter().any(|n| n == RESULTS || n == "kept")) {
            return Err(Error::output(output, "contains other files and no results of `bench`", "name another folder"));
        }
    }
    make(output)?;
    let cache = output.join("kept");
    std::fs::create_dir_all(&cache).map_err(|e| Error::io(&cache, e))?;
    Ok(cache)
}

pub fn write(output: &Path, sections: &[ReportSection], provenance: &Provenance) -> Result<()> {
    let figures = output.join("figures");
    std::fs::create_dir_all(&figures).map_err(|e| Error::io(&figures, e))?;
    let mut drawn = std::collections::BTreeMap::new();
    for results in sections.iter().filter_map(|s| s.found.as_ref().ok()) {
        for table in &results.tables {
            write_bytes(&figures.join(format!("{}.csv", table.name)), csv(table).as_bytes())?;
        }
        for p in &results.plots {
            write_plots(&figures, std::slice::from_ref(p), &[FileKind::Svg, FileKind::Png])?;
        }
        for p in &results.pictures {
            let bytes = joined(p)?;
            write_bytes(&figures.join(format!("{}.png", p.name)), &bytes)?;
            drawn.insert(p.name.clone(), bytes);
        }
    }
    for s in sections {
        let page = markdown(s, provenance, "figures");
        write_bytes(&output.join(format!("{}.md", s.experiment.name)), page.as_bytes())?;
    }
    let page = html(sections, provenance, &|p| drawn.get(&p.name).cloned().unwrap_or_default());
    write_bytes(&output.join("report.html"), page.as_bytes())?;
    write_bytes(&output.join(RESULTS), results(sections, provenance).as_bytes())
}

fn results(sections: &[ReportSection], provenance: &Provenance) -> String {
    let experiments: serde_json::Map<_, _> = sections
        .iter()
        .map(|s| {
            let json = match &s.found {
                Ok(results) => serde_json::to_value(results).unwrap_or_default(),
                Err(why) => serde_json::json!({ "not_measured": why }),
            };
            (s.experiment.name.to_string(), json)
        })
        .collect();
    let all = serde_json::json!({ "made_by": provenance, "experiments": experiments });
    serde_json::to_string_pretty(&all).unwrap_or_default() + "\n"
}

/// Height of labels above pictures in pixels; pages show a row of three at two thirds of its size.
const LETTERS: f64 = 20.0;

/// The labelled pictures side by side, as a PNG.
fn joined(p: &Pictures) -> Result<Vec<u8>> {
    let panel = |(caption, picture): &(String, Rgb8)| Panel {
        caption: Some(caption.clone()),
        ..Panel::plain(FigureImage::Color(picture.clone()))
    };
    let bar = |c: &Colours| ColourBar::logarithmic(c.title.clone(), c.range, |share| c.map.color(share));
    let panels = p.panels.iter().map(panel).collect();
    let figure = Figure { bar: p.colours.as_ref().map(bar), ..Figure::plain(panels, p.columns) };
    let page = raster(&layout(&figure, LETTERS, FigureSpace::Pixels)?)?;
    coded(&plainest(page), &PngMetadata::default())
}

/// Uses grey levels if there are no colours, which takes a third of the bytes.
fn plainest(page: Rgb8) -> FigureImage {
    match page.data.iter().all(|[r, g, b]| r == g && g == b) {
        true => FigureImage::Gray(Gray8 { size: page.size, data: page.data.iter().map(|p| p[0]).collect() }),
        false => FigureImage::Color(page),
    }
}
