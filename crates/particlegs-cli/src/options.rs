//! Refuses options that have no effect, since ignoring them would mislead. One table holds the rules.

use crate::commands::stats::OPTIONS_OF_MEASURES;
use clap::parser::ValueSource;
use clap::{ArgMatches, Id};
use particlegs::input::{is_series, is_single};
use particlegs_core::{Error, NamedValue, Result};
use particlegs_export::{Group, Kind as Exported};
use particlegs_figure::FileKind;
use std::path::Path;

struct OptionRule {
    /// Separated by spaces, like the options.
    commands: &'static str,
    /// clap's ids; a group of options by the name of its struct.
    options: &'static str,
    /// Whether they have no effect, given the other arguments.
    idle: fn(&CommandMatches<'_>) -> bool,
    belongs: &'static str,
    hint: &'static str,
}

/// Rules: commands, options, when these have no effect, what they apply to, and a hint if one helps.
macro_rules! rules {
    ($($commands:literal: $options:expr, $idle:expr => $belongs:expr $(, $hint:expr)?;)*) => {
        &[$(OptionRule {
            commands: $commands,
            options: $options,
            idle: $idle,
            belongs: $belongs,
            hint: [$($hint,)? ""][0],
        }),*]
    };
}

const DENSITY: [&str; 2] = ["--style density", "add --style density, or omit the option"];
const MODEL: &str = "snapshots, but this file is a model";
const SERIES_ALONE: &str = "two inputs, and a series alone is given";
const NO_SNAPSHOT: &str = "a snapshot, and none is given";

const RULES: &[OptionRule] = rules! {
    "render reference": "colormap range raw", |g| !g.density() => DENSITY[0], DENSITY[1];
    "reference": "smooth", |g| !g.density() => DENSITY[0], DENSITY[1];
    "render reference": "no_annotations", |g| !g.has_letters() =>
        "--style density, --frames, --time, PDF, SVG and --scale-bar: other pictures have no annotations";
    "render reference": "colorbar", |g| !g.has_bars() =>
        "--style density, PDF, SVG and --scale-bar: other pictures have no bars";
    "render reference": "radius opacity", |g| g.is("style", "density") || g.has("field") =>
        "the other styles: densities and fields have no particle radius or opacity";
    "render reference": "scale bulk field_weight shade", |g| !g.draws_field() => "maps of a field", "add --field NAME";
    "render reference": "style", |g| g.has("field") => "pictures without --field, which is a style of its own";
    "render": "color_by_layer", |g| g.is("style", "density") =>
        "the other styles: a density has its own colours", "draw one layer with --layer NAME";
    "render reference": "distance", |g| g.is("projection", "orthographic") =>
        "perspective pictures", "choose the window with --azimuth, --elevation, --center, --width and --depth";
    "render reference": "distance", |g| g.has("width") =>
        "pictures without --width, which already sets the distance";
    "render reference": "azimuth elevation distance projection center width depth fit",
        |g| g.has("path") => "pictures without --path, whose key frames set the camera";
    "render reference": "font_size", |g| !g.has_letters() => "figures with text: a colour bar, a scale bar, axes or a title";
    "render reference": "figure_width font_size", |g| g.has("no_annotations") && !g.draws_page() =>
        "figures: with --no-annotations a PNG is only the picture", "set its number of pixels with --size";
    "render reference": "FigureArgs colormap range video", |g| g.has("raw") => "pictures: --raw writes values";
    "render": "follow", |g| !g.series("models") => "films of a series (run.pgs)";
    "render reference": "frames", |g| !g.has("path") && !g.has("turntable") && !g.series("models") =>
        "--path and to series", "add --path FILE";
    "render reference": "video", |g| !g.has("path") && !g.has("turntable") && !g.has("frames") =>
        "--turntable, --path and --frames", "add --turntable N or --path FILE";
    "compress": "resume minutes log", |g| !g.trains() => "training: it needs --train fast|best|paper";
    "compress plan": "law scale iterations", |g| !g.trains() =>
        "training: it needs --train fast|best|paper, or --config";
    "compress plan": "effort", |g| g.is("train", "paper") =>
        "fits: the published recipe starts from random particles",
        "omit --effort; --scale and --iterations shorten training";
    "info": "SnapshotArgs no_bounds", |g| g.model("input") => MODEL;
    "info": "csv", |g| !g.series("input") || g.has("frame") => "a whole series (run.pgs)";
    "convert": "SnapshotArgs SelectionArgs WindowArgs", |g| g.model("input") => MODEL,
        "draw particles with `recover`, then convert those";
    "verify": "SnapshotArgs SelectionArgs WindowArgs", |g| !g.has("snapshot") && !g.series("model") => NO_SNAPSHOT, "name it after the model";
    "view": "SnapshotArgs SelectionArgs", |g| !g.has("particles") => NO_SNAPSHOT, "name it with --snapshot";
    "merge": "certificate", |g| !g.folder("parts") =>
        "job folders: merged files have no certificate";
    "recover": "scale", |g| g.is("method", "grid") =>
        "the methods that draw from Gaussians: `grid` fills cells";
    "stats": "spectrum_assignment no_interlacing", |g| g.is("convention", "paper") =>
        "--convention correct: the published definitions are fixed";
    "stats": "convention separations aperture format positions mass_field topology select layers_by box_lengths length_unit mass_unit skip_invalid strict unwrapped gadget_blocks",
        |g| g.measures_series() => SERIES_ALONE;
    "export": "color", |g| g.exports() != Some(Group::Splats) =>
        "splats: it needs an output that ends in .ply, .glb or .gltf";
    "export": "radius opacity colormap range", |g| !g.exports_picture() =>
        "pages and splats: it needs an output that ends in .html, .ply, .glb or .gltf";
    "export": "PageArgs", |g| g.exports() != Some(Group::Page) =>
        "pages: it needs an output that ends in .html";
    "export": "colormap range", |g| g.exports() == Some(Group::Splats) && !g.is("color", "density") =>
        "--color density", "add --color density, or omit the option";
    "view export": "radius opacity", |g| g.page_of_density() =>
        "the other styles: a surface density has no particle radius or opacity", "add --style paraview";
    "view export": "color_by_layer", |g| g.page_of_density() =>
        "the other styles: a density has its own colours", "add --style paraview";
    "view export": "colormap range", |g| g.exports() != Some(Group::Splats) && g.has("style") && !g.density() =>
        DENSITY[0], DENSITY[1];
    "export": "grid cell", |g| g.exports().is_some_and(|e| e != Group::Grid) =>
        "density on a grid: it needs an output that ends in .npy, .vti, .fits, .dx or .mrc";
};

pub fn check(matches: &ArgMatches) -> Result<()> {
    let Some((command, matches)) = matches.subcommand() else { return Ok(()) };
    let command_matches = CommandMatches(matches);
    if command == "stats" {
        command_matches.check_measures()?;
    }
    for rule in RULES.iter().filter(|r| r.commands.split(' ').any(|c| c == command)) {
        if let Some(option) = rule.options.split(' ').find_map(|o| command_matches.first_of(o))
            && (rule.idle)(&command_matches)
        {
            return Err(no_effect(&option, rule.belongs, rule.hint));
        }
    }
    Ok(())
}

fn no_effect(option: &str, belongs: &str, hint: &'static str) -> Error {
    Error::argument_with(format!("{} has no effect here; it applies to {belongs}", spelling(option)), hint)
}

fn spelling(id: &str) -> String {
    match id {
        "box_lengths" => "--box".into(),
        id => format!("--{}", id.replace('_', "-")),
    }
}

fn is_group(option: &str) -> bool {
    option.starts_with(char::is_uppercase)
}

struct CommandMatches<'a>(&'a ArgMatches);

impl CommandMatches<'_> {
    /// Whether the argument was given, not only as a default.
    fn has(&self, id: &str) -> bool {
        // A rule may hold for several commands; a debug build of clap panics at an option that this one does not have.
        self.0.try_contains_id(id).unwrap_or(false) && self.0.value_source(id) == Some(ValueSource::CommandLine)
    }

    /// The option, or the first one of a group that was given.
    fn first_of(&self, option: &str) -> Option<String> {
        if is_group(option) {
            let ids = self.0.try_get_many::<Id>(option).ok().flatten();
            return ids.into_iter().flatten().find(|id| self.has(id.as_str())).map(Id::to_string);
        }
        self.has(option).then(|| option.to_string())
    }

    /// The words of an argument as typed, or its default.
    fn words(&self, id: &str) -> Vec<String> {
        let raw = self.0.try_get_raw(id).ok().flatten();
        raw.into_iter().flatten().map(|v| v.to_string_lossy().into_owned()).collect()
    }

    fn is(&self, id: &str, value: &str) -> bool {
        self.words(id).iter().any(|v| v == value)
    }

    /// Whether a field is drawn; with --like one may be.
    fn draws_field(&self) -> bool {
        self.has("field") || self.has("like") && !self.has("style")
    }

    /// Whether a surface density or a field is drawn; with --like one may be.
    fn density(&self) -> bool {
        self.is("style", "density") || self.draws_field()
    }

    fn has_bars(&self) -> bool {
        let beside = ["panels", "color_by_layer", "scale_bar", "figure_width"].iter().any(|id| self.has(id));
        self.density() || self.draws_page() || beside
    }

    /// Whether the picture has annotations.
    fn has_letters(&self) -> bool {
        self.has_bars() || ["axes", "title", "frames", "time"].iter().any(|id| self.has(id))
    }

    /// Whether the output is a PDF or SVG page.
    fn draws_page(&self) -> bool {
        let kind = self.paths("out").first().and_then(|p| FileKind::from_path(p));
        kind.is_some_and(|k| k != FileKind::Png)
    }

    fn trains(&self) -> bool {
        ["fast", "best", "paper"].iter().any(|p| self.is("train", p)) || self.has("config") || self.has("print_config")
    }

    /// The group of formats that `export` writes; `None` if that is unclear, which is reported later.
    fn exports(&self) -> Option<Group> {
        let kind = self.words("kind").first().and_then(|name| Exported::from_name(name).ok());
        let out = self.paths("output").into_iter().next()?;
        Exported::for_output(&out, kind).ok().map(Exported::group)
    }

    fn exports_picture(&self) -> bool {
        matches!(self.exports(), Some(Group::Page | Group::Splats))
    }

    /// Whether a page opens with a surface density, its default.
    fn page_of_density(&self) -> bool {
        let page = self.exports().is_none_or(|e| e == Group::Page);
        page && !["paraview", "expected"].iter().any(|s| self.is("style", s))
            && (self.has("style") || !self.has("like"))
    }

    /// Refuses options of measures that --only leaves out, or that compare two inputs where there is one.
    fn check_measures(&self) -> Result<()> {
        for (options, measures) in OPTIONS_OF_MEASURES {
            let Some(option) = options.split(' ').find_map(|o| self.first_of(o)) else { continue };
            if self.has("only") && !measures.iter().any(|m| self.is("only", m)) {
                let names: Vec<String> = measures.iter().map(|m| format!("`{m}`")).collect();
                let (ending, names) = (if names.len() > 1 { "s" } else { "" }, names.join(", "));
                let names = names.rsplit_once(", ").map_or(names.clone(), |(most, last)| format!("{most} and {last}"));
                return Err(no_effect(&option, &format!("the measure{ending} {names}, which --only leaves out"), ""));
            }
            if self.measures_series() && !measures.iter().any(|m| ["spectrum", "groups"].contains(m)) {
                return Err(no_effect(&option, SERIES_ALONE, ""));
            }
        }
        Ok(())
    }

    /// Whether a series alone is measured.
    fn measures_series(&self) -> bool {
        self.series("truth") && !self.has("other")
    }

    /// Whether the only positional argument is a model. Unreadable files are reported later, and pipes are not touched.
    fn model(&self, id: &str) -> bool {
        matches!(&self.paths(id)[..], [one] if is_single(one))
    }

    fn series(&self, id: &str) -> bool {
        matches!(&self.paths(id)[..], [one] if is_series(one))
    }

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
    fn the_rules_name_existing_options() {
        let cli = crate::Cli::command();
        let of_rules = RULES.iter().map(|r| (r.commands, r.options));
        for (commands, options) in of_rules.chain(OPTIONS_OF_MEASURES.iter().map(|(options, _)| ("stats", *options))) {
            for name in commands.split(' ') {
                let command = cli.find_subcommand(name).unwrap_or_else(|| panic!("no command {name}"));
                let (groups, options): (Vec<_>, Vec<_>) = options.split(' ').partition(|o| is_group(o));
                for group in groups {
                    let group = command.get_groups().find(|g| g.get_id() == group);
                    assert!(group.is_some_and(|g| g.get_args().next().is_some()), "{name} has no {group:?}");
                }
                for option in options {
                    let arg = command.get_arguments().find(|a| a.get_id() == option);
                    let arg = arg.unwrap_or_else(|| panic!("{name} has no {option}"));
                    assert_eq!(arg.get_long().map(|l| format!("--{l}")), Some(spelling(option)), "{name}");
                }
            }
        }
    }
}
