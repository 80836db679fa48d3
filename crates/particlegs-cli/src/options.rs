//! Options that would do nothing: one table of which option means something beside which other. An option
//! that is given and means nothing is refused by name, for a result without it would mislead.

use crate::figure::output::FileKind;
use clap::ArgMatches;
use clap::parser::ValueSource;
use particlegs::{Error, NamedValue, Result};
use particlegs_export::{Group, Kind as Exported};
use particlegs_formats::PathKind;
use std::path::Path;

/// Options of some commands that mean nothing beside some others.
struct OptionRule {
    commands: &'static [&'static str],
    /// As clap knows them.
    options: &'static [&'static str],
    /// Do they mean nothing beside what else was given?
    idle: fn(&CommandMatches<'_>) -> bool,
    /// What they belong to.
    belongs: &'static str,
    /// What to do; may be empty.
    hint: &'static str,
}

/// How a snapshot is opened.
const OPENING: &[&str] = &[
    "format",
    "particle_type",
    "positions",
    "weights",
    "frame",
    "layers_by",
    "box_lengths",
    "length_unit",
    "mass_unit",
    "skip_invalid",
    "strict",
    "unwrapped",
    "gadget_blocks",
];
/// What of it is kept.
const SELECTION: &[&str] = &["region", "every", "sample", "center", "width"];

/// What is about a picture, and its colours.
const FIGURE: &[&str] = &[
    "colormap",
    "range",
    "no_annotations",
    "colorbar",
    "background",
    "axes",
    "scale_bar",
    "title",
    "figure_width",
    "font_size",
    "dpi",
    "video",
];

/// How a page opens.
const PAGE: &[&str] = &[
    "style",
    "background",
    "color_by_layer",
    "like",
    "views",
    "azimuth",
    "elevation",
    "distance",
    "projection",
    "look_at",
];

/// Rules, each as commands, options, when these mean nothing, and what they belong to, with what to do.
macro_rules! rules {
    ($([$($command:literal),*], $options:expr, $idle:expr => $belongs:expr, $hint:expr;)*) => {
        &[$(OptionRule {
            commands: &[$($command),*],
            options: $options,
            idle: $idle,
            belongs: $belongs,
            hint: $hint,
        }),*]
    };
}

const DENSITY: [&str; 2] = ["--style density", "add --style density, or leave it away"];
const MODEL: &str = "snapshots, and the file is a model";
const RECOVER: &str = "draw particles with `recover`, then convert those";
const BEHIND: [&str; 2] = ["the snapshot, and none is given", "name it behind the model"];
const SNAPSHOT: [&str; 2] = [BEHIND[0], "name it by --snapshot"];

const RULES: &[OptionRule] = rules! {
    ["render", "reference"], &["colormap", "range", "raw"], |g| !g.density() => DENSITY[0], DENSITY[1];
    ["reference"], &["smooth"], |g| !g.density() => DENSITY[0], DENSITY[1];
    ["render", "reference"], &["no_annotations", "colorbar"], |g| !g.has_bars() =>
        "--style density, PDF and SVG, and --scale-bar: nothing else has bars", "";
    ["render", "reference"], &["radius", "opacity"], |g| g.is("style", "density") =>
        "the other styles: a surface density has no particle radius or opacity", "";
    ["render"], &["color_by_layer"], |g| g.is("style", "density") =>
        "the other styles: a density has colours of its own", "draw one layer with --layer NAME";
    ["render", "reference"], &["distance"], |g| g.is("projection", "orthographic") =>
        "perspective pictures", "choose the window with --azimuth, --elevation, --center, --width and --depth";
    ["render", "reference"], &["distance"], |g| g.has("width") =>
        "pictures without --width, which says how near the camera is", "";
    ["render", "reference"], &["azimuth", "elevation", "distance", "projection", "center", "width", "depth", "fit"],
        |g| g.has("path") => "pictures without --path, whose key frames are cameras", "";
    ["render", "reference"], &["font_size"], |g| !g.has_letters() => "figures with letters: a colour bar, a scale bar, axes or a title", "";
    ["render", "reference"], &["figure_width", "font_size"], |g| g.has("no_annotations") && !g.draws_page() =>
        "figures: with --no-annotations a PNG is the picture alone", "--size says how many pixels it has";
    ["render", "reference"], FIGURE, |g| g.has("raw") => "pictures: --raw writes values", "";
    ["compress"], &["resume", "minutes", "log"], |g| !g.trains() => "training: it needs --train fast|best|paper", "";
    ["compress", "plan"], &["law", "scale", "iterations"], |g| !g.trains() =>
        "training: it needs --train fast|best|paper, or --config", "";
    ["compress", "plan"], &["effort"], |g| g.is("train", "paper") =>
        "a fit: the published recipe starts from particles drawn at random",
        "leave --effort away; --scale and --iterations shorten training";
    ["info"], OPENING, |g| g.model("input") => MODEL, "";
    ["info"], &["no_bounds"], |g| g.model("input") => MODEL, "";
    ["convert"], OPENING, |g| g.model("input") => MODEL, RECOVER;
    ["convert"], SELECTION, |g| g.model("input") => MODEL, RECOVER;
    ["verify"], OPENING, |g| !g.has("snapshot") => BEHIND[0], BEHIND[1];
    ["view"], OPENING, |g| !g.has("particles") => SNAPSHOT[0], SNAPSHOT[1];
    ["view"], &["region", "every", "sample", "left_out"], |g| !g.has("particles") => SNAPSHOT[0], SNAPSHOT[1];
    ["verify"], SELECTION, |g| !g.has("snapshot") => BEHIND[0], BEHIND[1];
    ["merge"], &["certificate"], |g| !g.folder("parts") =>
        "a job's folder: a merge of files has no certificate", "";
    ["recover"], &["scale"], |g| g.is("method", "grid") =>
        "the methods that draw from Gaussians: `grid` fills cells", "";
    ["stats"], &["grid", "assignment"], |g| g.without(&["density"]) =>
        "the measure `density`, which --only leaves out", "";
    ["stats"], &["spectrum_grid", "spectrum_assignment", "no_interlacing", "k_max"], |g| g.without(&["spectrum"]) =>
        "the measure `spectrum`, which --only leaves out", "";
    ["stats"], &["separations"], |g| g.without(&["pairs", "spectrum"]) =>
        "the measures `pairs` and `spectrum`, which --only leaves out", "";
    ["stats"], &["pairs"], |g| g.without(&["pairs", "rdf"]) =>
        "the measures `pairs` and `rdf`, which --only leaves out", "";
    ["stats"], &["aperture"], |g| g.without(&["groups"]) => "the measure `groups`, which --only leaves out", "";
    ["stats"], &["linking", "linking_length"], |g| g.without(&["groups", "haloes"]) =>
        "the measures `groups` and `haloes`, which --only leaves out", "";
    ["stats"], &["rdf_max"], |g| g.without(&["rdf"]) => "the measure `rdf`, which --only leaves out", "";
    ["stats"], &["profile_axis", "profile_bins"], |g| g.without(&["profile"]) =>
        "the measure `profile`, which --only leaves out", "";
    ["stats"], &["centres", "halo_radius", "halo_bins"], |g| g.without(&["haloes"]) =>
        "the measure `haloes`, which --only leaves out", "";
    ["stats"], &["neighbours"], |g| g.without(&["neighbours"]) =>
        "the measure `neighbours`, which --only leaves out", "";
    ["stats"], &["spectrum_assignment", "no_interlacing"], |g| g.is("convention", "paper") =>
        "--convention correct: the published table has its own", "";
    ["export"], &["color"], |g| g.exports() != Some(Group::Splats) =>
        "splats: it needs an output that ends in .ply, .glb or .gltf", "";
    ["export"], &["radius", "opacity", "colormap", "range"], |g| !g.exports_picture() =>
        "pages and splats: it needs an output that ends in .html, .ply, .glb or .gltf", "";
    ["export"], PAGE, |g| g.exports() != Some(Group::Page) =>
        "pages: it needs an output that ends in .html", "";
    ["export"], &["colormap", "range"], |g| g.exports() == Some(Group::Splats) && !g.is("color", "density") =>
        "--color density", "add --color density, or leave it away";
    ["view", "export"], &["radius", "opacity"], |g| g.page_of_density() =>
        "the other styles: a surface density has no particle radius or opacity", "add --style paraview";
    ["view", "export"], &["color_by_layer"], |g| g.page_of_density() =>
        "the other styles: a density has colours of its own", "add --style paraview";
    ["view", "export"], &["colormap", "range"], |g| g.exports() != Some(Group::Splats) && g.has("style") && !g.density() =>
        DENSITY[0], DENSITY[1];
    ["export"], &["grid", "cell"], |g| g.exports().is_some_and(|e| e != Group::Grid) =>
        "density on a grid: it needs an output that ends in .npy, .vti or .fits", "";
};

/// Refuses the first option on the command line that would do nothing.
pub fn check(matches: &ArgMatches) -> Result<()> {
    let Some((command, matches)) = matches.subcommand() else { return Ok(()) };
    let given = CommandMatches(matches);
    for rule in RULES.iter().filter(|r| r.commands.contains(&command)) {
        if let Some(option) = rule.options.iter().find(|o| given.has(o))
            && (rule.idle)(&given)
        {
            let what = format!("{} does nothing here: it belongs to {}", spelling(option), rule.belongs);
            return Err(Error::Argument { what, remedy: rule.hint.into() });
        }
    }
    Ok(())
}

/// An option as it is typed.
fn spelling(id: &str) -> String {
    match id {
        "box_lengths" => "--box".into(),
        id => format!("--{}", id.replace('_', "-")),
    }
}

/// What stands on the command line of one command.
struct CommandMatches<'a>(&'a ArgMatches);

impl CommandMatches<'_> {
    /// Is the argument there, and not as a default?
    fn has(&self, id: &str) -> bool {
        self.0.try_contains_id(id).unwrap_or(false) && self.0.value_source(id) == Some(ValueSource::CommandLine)
    }

    /// The words of an argument as typed, or its default.
    fn words(&self, id: &str) -> Vec<String> {
        let raw = self.0.try_get_raw(id).ok().flatten();
        raw.into_iter().flatten().map(|v| v.to_string_lossy().into_owned()).collect()
    }

    fn is(&self, id: &str, value: &str) -> bool {
        self.words(id).iter().any(|v| v == value)
    }

    /// Is a surface density drawn, or perhaps: of a picture to be drawn alike it is not known yet?
    fn density(&self) -> bool {
        self.is("style", "density") || self.has("like") && !self.has("style")
    }

    /// Are there bars in the picture, or beside it?
    fn has_bars(&self) -> bool {
        let beside = ["panels", "color_by_layer", "scale_bar", "figure_width"].iter().any(|id| self.has(id));
        self.density() || self.draws_page() || beside
    }

    /// Is anything written about the picture, or on it?
    fn has_letters(&self) -> bool {
        self.has_bars() || ["axes", "title"].iter().any(|id| self.has(id))
    }

    /// Is the output a page with its own room about the picture?
    fn draws_page(&self) -> bool {
        let kind = self.paths("out").first().and_then(|p| FileKind::of(p));
        kind.is_some_and(|k| k != FileKind::Png)
    }

    fn trains(&self) -> bool {
        ["fast", "best", "paper"].iter().any(|p| self.is("train", p)) || self.has("config") || self.has("print_config")
    }

    /// What `export` is to write; `None` where that is not clear, which is told of later.
    fn exports(&self) -> Option<Group> {
        let asked = self.words("kind").first().and_then(|name| Exported::from_name(name).ok());
        let out = self.paths("output").into_iter().next()?;
        Exported::for_output(&out, asked).ok().map(Exported::group)
    }

    /// Is a page or a file of splats written?
    fn exports_picture(&self) -> bool {
        matches!(self.exports(), Some(Group::Page | Group::Splats))
    }

    /// Does a page open with a surface density, as it does unless it is told otherwise?
    fn page_of_density(&self) -> bool {
        let page = self.exports().is_none_or(|e| e == Group::Page);
        page && !["paraview", "expected"].iter().any(|s| self.is("style", s))
            && (self.has("style") || !self.has("like"))
    }

    /// Is --only given, without any of these measures?
    fn without(&self, measures: &[&str]) -> bool {
        self.has("only") && !measures.iter().any(|m| self.is("only", m))
    }

    /// Is the one file of a positional argument a model? Files that cannot be
    /// read are told of later, and what can be read once only is left alone.
    fn model(&self, id: &str) -> bool {
        matches!(&self.paths(id)[..], [one] if matches!(PathKind::from_path(one), PathKind::Model))
    }

    /// Is the one part a folder?
    fn folder(&self, id: &str) -> bool {
        matches!(&self.paths(id)[..], [one] if one.is_dir())
    }

    fn paths(&self, id: &str) -> Vec<std::path::PathBuf> {
        let raw = self.0.try_get_raw(id).ok().flatten();
        raw.into_iter().flatten().map(|v| Path::new(v).to_path_buf()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    /// Every command and option of the table exists: a renamed one would never be refused.
    #[test]
    fn the_table_names_what_there_is() {
        let cli = crate::Cli::command();
        for rule in RULES {
            for name in rule.commands {
                let command = cli.find_subcommand(name).unwrap_or_else(|| panic!("no command {name}"));
                for option in rule.options {
                    let arg = command.get_arguments().find(|a| a.get_id() == option);
                    let arg = arg.unwrap_or_else(|| panic!("{name} has no {option}"));
                    assert_eq!(arg.get_long().map(|l| format!("--{l}")), Some(spelling(option)), "{name}");
                }
            }
        }
    }
}
