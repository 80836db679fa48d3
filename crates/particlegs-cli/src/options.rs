//! Options that would do nothing: one table of which option means something beside which other. An option
//! that is given and means nothing is refused by name, for a result without it would mislead.

use crate::figure::output::FileKind;
use clap::ArgMatches;
use clap::parser::ValueSource;
use particlegs::{Error, NamedValue, Result};
use particlegs_export::{Group, Kind as Exported};
use particlegs_formats::Kind;
use std::path::Path;

/// Options of some commands that mean nothing where `why` gives a reason.
struct Rule {
    commands: &'static [&'static str],
    /// As clap knows them.
    options: &'static [&'static str],
    /// Why they mean nothing beside what else was given, and what to do; `None` = they mean something.
    why: fn(&Given<'_>) -> Option<(&'static str, &'static str)>,
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

const RULES: &[Rule] = &[
    Rule {
        commands: &["render", "reference"],
        options: &["colormap", "range", "raw"],
        why: |g| (!g.density()).then_some(("--style density", "add --style density, or leave it away")),
    },
    Rule {
        commands: &["reference"],
        options: &["smooth"],
        why: |g| (!g.density()).then_some(("--style density", "add --style density, or leave it away")),
    },
    Rule {
        commands: &["render", "reference"],
        options: &["no_annotations", "colorbar"],
        why: |g| {
            let bars = g.density() || g.draws_page() || g.has("panels") || g.has("color_by_layer");
            let bars = bars || g.has("scale_bar") || g.has("figure_width");
            (!bars).then_some(("--style density, PDF and SVG, and --scale-bar: nothing else has bars", ""))
        },
    },
    Rule {
        commands: &["render", "reference"],
        options: &["radius", "opacity"],
        why: |g| {
            let density = g.is("style", "density");
            density.then_some(("the other styles: a surface density has no particle radius or opacity", ""))
        },
    },
    Rule {
        commands: &["render"],
        options: &["color_by_layer"],
        why: |g| {
            let density = g.is("style", "density");
            density
                .then_some(("the other styles: a density has colours of its own", "draw one layer with --layer NAME"))
        },
    },
    Rule {
        commands: &["render", "reference"],
        options: &["distance"],
        why: |g| {
            let hint = "choose the window with --azimuth, --elevation, --center, --width and --depth";
            g.is("projection", "orthographic").then_some(("perspective pictures", hint))
        },
    },
    Rule {
        commands: &["render", "reference"],
        options: &["distance"],
        why: |g| g.has("width").then_some(("pictures without --width, which says how near the camera is", "")),
    },
    Rule {
        commands: &["render", "reference"],
        options: FIGURE,
        why: |g| g.has("raw").then_some(("pictures: --raw writes values", "")),
    },
    Rule {
        commands: &["compress"],
        options: &["resume", "minutes", "log"],
        why: |g| (!g.trains()).then_some(("training: it needs --train fast|best|paper", "")),
    },
    Rule {
        commands: &["compress", "plan"],
        options: &["law", "scale", "iterations"],
        why: |g| (!g.trains()).then_some(("training: it needs --train fast|best|paper, or --config", "")),
    },
    Rule {
        commands: &["compress", "plan"],
        options: &["effort"],
        why: |g| {
            let hint = "leave --effort away; --scale and --iterations shorten training";
            g.is("train", "paper")
                .then_some(("a fit: the published recipe starts from particles drawn at random", hint))
        },
    },
    Rule {
        commands: &["info"],
        options: OPENING,
        why: |g| g.model("input").then_some(("snapshots, and the file is a model", "")),
    },
    Rule {
        commands: &["info"],
        options: &["no_bounds"],
        why: |g| g.model("input").then_some(("snapshots, and the file is a model", "")),
    },
    Rule {
        commands: &["convert"],
        options: OPENING,
        why: |g| {
            g.model("input")
                .then_some(("snapshots, and the file is a model", "draw particles with `recover`, then convert those"))
        },
    },
    Rule {
        commands: &["convert"],
        options: SELECTION,
        why: |g| {
            g.model("input")
                .then_some(("snapshots, and the file is a model", "draw particles with `recover`, then convert those"))
        },
    },
    Rule {
        commands: &["verify"],
        options: OPENING,
        why: |g| (!g.has("snapshot")).then_some(("the snapshot, and none is given", "name it behind the model")),
    },
    Rule {
        commands: &["view"],
        options: OPENING,
        why: |g| (!g.has("particles")).then_some(("the snapshot, and none is given", "name it by --snapshot")),
    },
    Rule {
        commands: &["view"],
        options: &["region", "every", "sample", "left_out"],
        why: |g| (!g.has("particles")).then_some(("the snapshot, and none is given", "name it by --snapshot")),
    },
    Rule {
        commands: &["verify"],
        options: SELECTION,
        why: |g| (!g.has("snapshot")).then_some(("the snapshot, and none is given", "name it behind the model")),
    },
    Rule {
        commands: &["merge"],
        options: &["certificate"],
        why: |g| (!g.folder("parts")).then_some(("a job's folder: a merge of files has no certificate", "")),
    },
    Rule {
        commands: &["recover"],
        options: &["scale"],
        why: |g| g.is("method", "grid").then_some(("the methods that draw from Gaussians: `grid` fills cells", "")),
    },
    Rule {
        commands: &["stats"],
        options: &["grid", "assignment"],
        why: |g| g.without(&["density"]).then_some(("the measure `density`, which --only leaves out", "")),
    },
    Rule {
        commands: &["stats"],
        options: &["spectrum_grid", "spectrum_assignment", "no_interlacing", "k_max"],
        why: |g| g.without(&["spectrum"]).then_some(("the measure `spectrum`, which --only leaves out", "")),
    },
    Rule {
        commands: &["stats"],
        options: &["separations"],
        why: |g| {
            g.without(&["pairs", "spectrum"])
                .then_some(("the measures `pairs` and `spectrum`, which --only leaves out", ""))
        },
    },
    Rule {
        commands: &["stats"],
        options: &["pairs"],
        why: |g| {
            g.without(&["pairs", "rdf"]).then_some(("the measures `pairs` and `rdf`, which --only leaves out", ""))
        },
    },
    Rule {
        commands: &["stats"],
        options: &["aperture"],
        why: |g| g.without(&["groups"]).then_some(("the measure `groups`, which --only leaves out", "")),
    },
    Rule {
        commands: &["stats"],
        options: &["linking"],
        why: |g| {
            g.without(&["groups", "haloes"])
                .then_some(("the measures `groups` and `haloes`, which --only leaves out", ""))
        },
    },
    Rule {
        commands: &["stats"],
        options: &["rdf_max"],
        why: |g| g.without(&["rdf"]).then_some(("the measure `rdf`, which --only leaves out", "")),
    },
    Rule {
        commands: &["stats"],
        options: &["profile_axis", "profile_bins"],
        why: |g| g.without(&["profile"]).then_some(("the measure `profile`, which --only leaves out", "")),
    },
    Rule {
        commands: &["stats"],
        options: &["centres", "halo_radius", "halo_bins"],
        why: |g| g.without(&["haloes"]).then_some(("the measure `haloes`, which --only leaves out", "")),
    },
    Rule {
        commands: &["stats"],
        options: &["neighbours"],
        why: |g| g.without(&["neighbours"]).then_some(("the measure `neighbours`, which --only leaves out", "")),
    },
    Rule {
        commands: &["stats"],
        options: &["spectrum_assignment", "no_interlacing"],
        why: |g| g.is("convention", "paper").then_some(("--convention correct: the published table has its own", "")),
    },
    Rule {
        commands: &["export"],
        options: &["radius", "opacity", "color", "colormap", "range"],
        why: |g| {
            (g.exports() != Some(Group::Splats))
                .then_some(("splats: it needs an output that ends in .ply, .glb or .gltf", ""))
        },
    },
    Rule {
        commands: &["export"],
        options: &["colormap", "range"],
        why: |g| (!g.is("color", "density")).then_some(("--color density", "add --color density, or leave it away")),
    },
    Rule {
        commands: &["export"],
        options: &["grid", "cell"],
        why: |g| {
            g.exports()
                .is_some_and(|e| e != Group::Grid)
                .then_some(("density on a grid: it needs an output that ends in .npy, .vti or .fits", ""))
        },
    },
];

/// Refuses the first option on the command line that would do nothing.
///
/// # Errors
/// [`Error::Argument`] that names the option and what it belongs to.
pub fn check(matches: &ArgMatches) -> Result<()> {
    let Some((command, matches)) = matches.subcommand() else { return Ok(()) };
    let given = Given(matches);
    for rule in RULES.iter().filter(|r| r.commands.contains(&command)) {
        for option in rule.options.iter().filter(|o| given.has(o)) {
            if let Some((belongs, hint)) = (rule.why)(&given) {
                let what = format!("{} does nothing here: it belongs to {belongs}", spelling(option));
                return Err(Error::Argument { what, remedy: hint.into() });
            }
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
struct Given<'a>(&'a ArgMatches);

impl Given<'_> {
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
        Exported::of(&out, asked).ok().map(Exported::group)
    }

    /// Is --only given, without any of these measures?
    fn without(&self, measures: &[&str]) -> bool {
        self.has("only") && !measures.iter().any(|m| self.is("only", m))
    }

    /// Is the one file of a positional argument a model? Files that cannot be
    /// read are told of later, and what can be read once only is left alone.
    fn model(&self, id: &str) -> bool {
        matches!(&self.paths(id)[..], [one] if matches!(Kind::of(one), Kind::Model))
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
