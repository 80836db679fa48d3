//! `particlegs view MODEL... [--snapshot SNAP]`.

use crate::common::{CommandContext, Common};
use crate::page_args::{AppearanceArgs, PageArgs};
use crate::page_models::ModelFiles;
use crate::progress::to_stderr;
use crate::snapshot_args::{ParticleArgs, SelectionArgs, SnapshotArgs};
use clap::{Args, ValueHint};
use particlegs_core::Result;
use particlegs_core::text::one_line;
use particlegs_particles::{Particles, Storage};
use particlegs_reference::Reference;
use particlegs_server::tunnel::{self, Session};
use particlegs_server::{Event, Limits, Options, Server, Token, ViewerContent};
use particlegs_view::page::Snapshot;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Duration;

#[derive(Args)]
#[command(
    after_help = "\
Examples:
  particlegs view model.pgs
  particlegs view model.pgs --snapshot snapshot/
  particlegs view model.pgs --style paraview --azimuth 30
  particlegs view a.pgs b.pgs --no-open --port 8317",
    after_long_help = "\
Examples:
  particlegs view model.pgs
  particlegs view model.pgs --snapshot snapshot/
  particlegs view model.pgs --snapshot x.f32 --snapshot y.f32 --snapshot z.f32
  particlegs view model.pgs --style paraview --azimuth 30 --radius 0.02
  particlegs view model.pgs --like saved.png
  particlegs view a.pgs b.pgs --no-open --port 8317
  particlegs view model.pgs --no-open --allow-host hub.example.org

The printed address contains a secret token, new each time; set PARTICLEGS_TOKEN, 32 or more letters
and digits, to choose it. docs/guide/view.md describes SSH, Open OnDemand and jupyter-server-proxy."
)]
pub struct Arguments {
    /// Model files or series; several are shown side by side with one camera.
    #[arg(required = true, value_name = "MODEL", value_hint = ValueHint::FilePath)]
    models: Vec<PathBuf>,
    /// Snapshot to compare with: its first file, its folder, or its raw columns, one option each.
    ///
    /// All its particles are drawn beside the model, from the same camera.
    #[arg(long = "snapshot", value_name = "SNAP", value_hint = ValueHint::AnyPath)]
    particles: Vec<PathBuf>,
    /// Port to listen on; 0 picks any free one [default: 8317, or any free one if that is taken].
    #[arg(long, value_name = "P")]
    port: Option<u16>,
    /// Address or name to listen on; anything but a loopback address lets other machines in.
    #[arg(long, value_name = "H", default_value = "127.0.0.1")]
    host: String,
    /// Host name of a proxy to the page, as in the browser's address bar; may be repeated.
    #[arg(long, value_name = "NAME")]
    allow_host: Vec<String>,
    /// Do not start a browser.
    #[arg(long)]
    no_open: bool,
    /// Stop after this many minutes without a request [default: never].
    #[arg(long, value_name = "MINUTES", value_parser = clap::value_parser!(u64).range(1..))]
    idle: Option<u64>,
    /// Layers that the page opens with: species such as gas or dm, names that `info` lists, or `all`.
    #[arg(
        long = "layer",
        value_name = "NAME,...",
        value_delimiter = ',',
        default_value = "all",
        hide_short_help = true
    )]
    layers: Vec<String>,
    #[command(flatten)]
    page: PageArgs,
    #[command(flatten, next_help_heading = "How the page opens")]
    dials: AppearanceArgs,
    #[command(flatten)]
    snapshot: SnapshotArgs,
    #[command(flatten)]
    selection: SelectionArgs,
    #[command(flatten)]
    common: Common,
}

pub fn run(mut a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    context.reads(
        a.models.iter().chain(&a.particles).chain(&a.snapshot.topology).chain(a.page.files()).map(PathBuf::as_path),
        false,
    )?;
    // A port that is taken is reported before large models are read.
    let server = listen(&a, &context)?;
    let one_frame = !a.particles.is_empty() || a.snapshot.frame.is_some();
    let mut model_files = ModelFiles::read(&a.models, one_frame.then_some(&mut a.snapshot), &context)?;
    let opening = a.page.opening(&a.dials, &a.layers, &model_files.infos(), &context)?;
    let particles = a.particles(&context)?.map(|p| model_files.in_units(p, &context)).transpose()?;
    let reference = particles.as_ref().map(Reference::new);
    let truth = reference.as_ref().map(|r| (a.named(r), r));
    announce(&a, &server, &model_files, truth.as_ref().map(|t| &t.0), &context)?;
    if !a.no_open {
        open(&server, &context)?;
    }
    let quiet = a.common.quiet;
    let tell = |text: &str| {
        if !quiet {
            to_stderr(&one_line(text));
        }
    };
    // From here on the page shows the progress.
    let context = context.without_progress();
    let has_poster = model_files.has_poster(&opening);
    let models = model_files.take_files();
    let poster = |bytes: &[u8]| model_files.poster(bytes, &context, &tell);
    let poster: Option<&(dyn Fn(&[u8]) -> Option<Vec<u8>> + Sync)> = if has_poster { Some(&poster) } else { None };
    server.serve(ViewerContent { models, truth, opening, poster }, &context, &|event| tell(&describe(&event)))
}

fn listen(a: &Arguments, context: &CommandContext) -> Result<Server> {
    let minutes = |m: u64| Duration::from_secs(m.saturating_mul(60));
    let limits = Limits { idle: a.idle.map(minutes), ..Limits::default() };
    let server = Server::bind(Options {
        host: a.host.clone(),
        port: a.port,
        proxies: a.allow_host.clone(),
        node: node(),
        token: token()?,
        limits,
    })?;
    if server.is_widened() {
        context.message(&format!(
            "warning: --host {}: other machines can reach the page, anyone who knows its address can see the models, \
             and the connection is not encrypted",
            a.host
        ));
    }
    Ok(server)
}

fn token() -> Result<Token> {
    const VARIABLE: &str = "PARTICLEGS_TOKEN";
    match std::env::var_os(VARIABLE) {
        None => Token::random(),
        Some(chosen) => Token::chosen(chosen.to_string_lossy().into_owned()).map_err(|e| e.at(VARIABLE)),
    }
}

impl Arguments {
    /// The snapshot's particles, opened as `reference` opens them.
    fn particles(&self, context: &CommandContext) -> Result<Option<Particles>> {
        if self.particles.is_empty() {
            return Ok(None);
        }
        let particles = ParticleArgs::without_window(&self.snapshot, &self.selection);
        particles.read(&self.particles, self.common.seed, &Storage::Memory, context).map(Some)
    }

    /// Name of the snapshot on the page: its first file or folder.
    fn named(&self, reference: &Reference<'_>) -> Snapshot {
        let first = self.particles.first().map_or(Path::new(""), |p| p);
        let whole = std::path::absolute(first).unwrap_or_else(|_| first.to_path_buf());
        let name = whole.file_name().unwrap_or(first.as_os_str()).to_string_lossy().into_owned();
        let particles = reference.particles();
        Snapshot { name, particles: particles.len() as u64, density_of: particles.density_of().into() }
    }
}

fn announce(
    a: &Arguments,
    server: &Server,
    model_files: &ModelFiles,
    snapshot: Option<&Snapshot>,
    context: &CommandContext,
) -> Result<()> {
    let variable = |name: &str| std::env::var(name).ok();
    let (connection, user) = (variable("SSH_CONNECTION"), variable("USER").or_else(|| variable("LOGNAME")));
    let node = node();
    let session = Session { connection: connection.as_deref(), user: user.as_deref(), node: node.as_deref() };
    let ssh = tunnel::line(session, server.port()).filter(|_| !server.is_widened());
    let (url, elsewhere) = (server.url(), server.url_elsewhere());
    let mut text = url.clone();
    if let Some(elsewhere) = &elsewhere {
        text += &format!("\n{elsewhere}");
    }
    if let Some(ssh) = &ssh {
        text += &format!("\nOn your own machine, run this and then open the address there:\n{ssh}");
    }
    text += "\nPress Ctrl-C to stop.";
    let models: Vec<_> = model_files.names().map(|(name, n)| json!({ "name": name, "gaussians": n })).collect();
    let report = json!({
        "url": url, "url_elsewhere": elsewhere, "host": a.host, "port": server.port(), "token": server.token(), "ssh": ssh,
        "models": models, "snapshot": snapshot.map(|s| json!({ "name": s.name, "particles": s.particles })),
    });
    context.finish(&text, &report)
}

/// Starts a browser if there is a display.
fn open(server: &Server, context: &CommandContext) -> Result<()> {
    let is_set = |name: &str| std::env::var_os(name).is_some_and(|v| !v.is_empty());
    // On Windows and macOS no variable says whether there is a screen.
    let screen = !cfg!(all(unix, not(target_os = "macos")))
        || ["DISPLAY", "WAYLAND_DISPLAY", "WSL_DISTRO_NAME"].into_iter().any(is_set);
    // Through SSH a browser would start on the wrong machine.
    if is_set("SSH_CONNECTION") || !screen {
        return Ok(());
    }
    if start_browser(&server.url_for_once()?).is_err() {
        context.message("no browser could be started: open the address yourself");
    }
    Ok(())
}

fn describe(event: &Event) -> String {
    match event {
        Event::RefusedHost(name) => {
            format!("refused: a request for host {name}; if it came from your proxy, add `--allow-host {name}`")
        }
        Event::RefusedOrigin => {
            "refused: a request from another site's page; if that is your proxy, name it with `--allow-host`".into()
        }
    }
}

#[cfg(unix)]
fn node() -> Option<String> {
    let name = rustix::system::uname().nodename().to_string_lossy().into_owned();
    Some(name).filter(|n| !n.is_empty())
}

#[cfg(not(unix))]
fn node() -> Option<String> {
    std::env::var("COMPUTERNAME").ok()
}

/// Starts a browser without waiting for it.
#[cfg(target_os = "linux")]
fn start_browser(url: &str) -> std::io::Result<()> {
    use std::process::{Command, Stdio};
    let start = |program: &str| {
        let mut command = Command::new(program);
        command.arg(url).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().map(drop)
    };
    // The second is for WSL.
    start("xdg-open").or_else(|_| start("wslview"))
}

#[cfg(not(target_os = "linux"))]
use open::that_detached as start_browser;
