//! Progress: a live line on a terminal, elsewhere one plain line per minute.
//!
//! A [`Meter`] has the clock and the thread. A [`Display`] knows the phases and receives the time, so that tests need
//! no clock. A [`StatusSink`] shows the state.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Interval of updates on a terminal ...
const TICK: Duration = Duration::from_millis(200);
/// ... and elsewhere.
const PLAIN_TICK: Duration = Duration::from_secs(1);
/// Interval of plain lines; shorter runs print none.
const PLAIN_EVERY: Duration = Duration::from_secs(60);
/// Shorter work shows nothing on a terminal.
const UNSEEN: Duration = Duration::from_millis(400);
/// A phase must run this long before its rate is used.
const SETTLED: Duration = Duration::from_secs(1);
/// Most characters of phase names in a line.
const NAME_WIDTH: usize = 44;

/// Shows the state of the work.
trait StatusSink: Send {
    /// Shows the state, `now` after the start.
    fn show(&mut self, status: &ProgressStatus, now: Duration);
    /// Hides the state.
    fn clear(&mut self);
    /// Prints a line above the state.
    fn message(&mut self, text: &str);
}

/// State of the work.
#[derive(Clone, Debug, PartialEq)]
struct ProgressStatus {
    /// The phase and the phases inside it.
    name: String,
    /// Finished share of the outermost phase with a known size.
    share: Option<f64>,
    /// Time of this phase so far.
    elapsed: Duration,
    /// Remaining time, at the rate so far.
    left: Option<Duration>,
}

impl ProgressStatus {
    /// `45 %, 1 min 20 s left`, or `12 s so far`.
    fn figures(&self) -> String {
        // Rounded down, so that 100 % means the end.
        let share = self.share.map_or(String::new(), |s| format!("{:.0} %, ", (100.0 * s).floor()));
        match self.left {
            Some(left) => format!("{share}{} left", duration(left)),
            None => format!("{share}{} so far", duration(self.elapsed)),
        }
    }
}

/// `12 s`, `1 min 20 s`, `2 h 5 min`.
fn duration(d: Duration) -> String {
    match d.as_secs() {
        s @ 0..60 => format!("{s} s"),
        s @ 60..3600 => format!("{} min {} s", s / 60, s % 60),
        s => format!("{} h {} min", s / 3600, s % 3600 / 60),
    }
}

/// Progress of a phase at some time.
#[derive(Clone, Copy)]
struct ProgressSample {
    at: Duration,
    done: u64,
}

/// A running phase.
struct ProgressPhase {
    name: String,
    total: u64,
    done: u64,
    began: Duration,
    /// State at the first update: a resumed run starts with some steps done.
    first: Option<ProgressSample>,
    /// State at the first update after the last step.
    moved: ProgressSample,
}

impl ProgressPhase {
    /// Finished share; `None` if the total is unknown. Some totals are estimates.
    fn share(&self) -> Option<f64> {
        self.share_of(self.done)
    }

    fn share_of(&self, done: u64) -> Option<f64> {
        (self.total > 0).then(|| (done as f64 / self.total as f64).min(1.0))
    }

    fn look(&mut self, now: Duration) {
        let sample = ProgressSample { at: now, done: self.done };
        self.first.get_or_insert(sample);
        if self.moved.done != self.done {
            self.moved = sample;
        }
    }

    /// Remaining time: the rate from the first update to the last step, minus the time since. Steps may take minutes; a
    /// step that exceeds the estimate is assumed to take another tenth of its time.
    fn left(&self, now: Duration) -> Option<Duration> {
        let first = self.first.unwrap_or(ProgressSample { at: self.began, done: 0 });
        let moved_at = if self.moved.done == self.done { self.moved.at } else { now };
        let (elapsed, since) = (moved_at.saturating_sub(first.at), now.saturating_sub(moved_at).as_secs_f64());
        let share = self.share()?;
        let gained = share - self.share_of(first.done)?;
        let is_known = gained > 0.0 && elapsed >= SETTLED;
        let at_last_step = elapsed.as_secs_f64() * (1.0 - share) / gained;
        // `from_secs_f64` panics at what a Duration cannot hold.
        is_known.then(|| Duration::from_secs_f64((at_last_step - since).max(0.1 * since).clamp(1.0, 1e9)))
    }
}

/// The phases, and where they are shown. Times count from the start of the command.
struct Display {
    /// The outermost phase first.
    phases: Vec<ProgressPhase>,
    /// Since when no phase is running.
    idle_since: Duration,
    sink: Box<dyn StatusSink>,
}

impl Display {
    fn new(sink: Box<dyn StatusSink>) -> Self {
        Display { phases: Vec::new(), idle_since: Duration::ZERO, sink }
    }

    fn begin(&mut self, name: &str, total: u64, now: Duration) {
        let moved = ProgressSample { at: now, done: 0 };
        self.phases.push(ProgressPhase { name: name.to_string(), total, done: 0, began: now, first: None, moved });
    }

    fn advance(&mut self, steps: u64) {
        if let Some(phase) = self.phases.last_mut() {
            phase.done = phase.done.saturating_add(steps);
        }
    }

    fn end(&mut self, now: Duration) {
        self.phases.pop();
        self.idle_since = now;
    }

    /// The state at this time.
    fn status(&self, now: Duration) -> ProgressStatus {
        let Some(outermost) = self.phases.first() else {
            let elapsed = now.saturating_sub(self.idle_since);
            return ProgressStatus { name: "working".into(), share: None, elapsed, left: None };
        };
        // Prefer the outer phase as soon as one of its steps is done.
        let known_phase = self.phases.iter().find(|p| p.done > 0 && p.total > 0);
        let phase = known_phase.or(self.phases.iter().find(|p| p.total > 0)).unwrap_or(outermost);
        let names: Vec<&str> = self.phases.iter().map(|p| p.name.as_str()).collect();
        let elapsed = now.saturating_sub(phase.began);
        ProgressStatus { name: shortened(&names.join(": ")), share: phase.share(), elapsed, left: phase.left(now) }
    }

    fn tick(&mut self, now: Duration) {
        self.phases.iter_mut().for_each(|p| p.look(now));
        let status = self.status(now);
        self.sink.show(&status, now);
    }
}

/// The name, shortened to fit the line.
fn shortened(name: &str) -> String {
    if name.chars().count() <= NAME_WIDTH {
        return name.to_string();
    }
    let beginning: String = name.chars().take(NAME_WIDTH - 1).collect();
    format!("{beginning}…")
}

/// A live line on a terminal.
struct Terminal {
    bar: ProgressBar,
    of_known_size: Option<bool>,
}

impl Terminal {
    fn new() -> Self {
        let bar = ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::stderr());
        Terminal { bar, of_known_size: None }
    }
}

impl StatusSink for Terminal {
    fn show(&mut self, status: &ProgressStatus, _: Duration) {
        // A line that is shown already stays for short phases, too.
        if status.elapsed < UNSEEN && self.of_known_size.is_none() {
            return;
        }
        let is_known = status.share.is_some();
        if self.of_known_size != Some(is_known) {
            let form = if is_known { "{prefix} {wide_bar} {msg}" } else { "{prefix} {spinner} {msg}" };
            self.bar.set_style(ProgressStyle::with_template(form).unwrap_or_else(|_| ProgressStyle::default_bar()));
            self.of_known_size = Some(is_known);
        }
        self.bar.set_prefix(status.name.clone());
        self.bar.set_message(status.figures());
        self.bar.set_position((1000.0 * status.share.unwrap_or(0.0)) as u64);
        self.bar.tick();
    }

    fn clear(&mut self) {
        self.bar.finish_and_clear();
        // A bar that was finished and cleared draws nothing any more.
        *self = Terminal::new();
    }

    fn message(&mut self, text: &str) {
        self.bar.suspend(|| to_stderr(text));
    }
}

/// Plain lines for log files and batch systems.
struct PlainLines<W> {
    out: W,
    next: Duration,
}

impl<W: Write + Send> StatusSink for PlainLines<W> {
    fn show(&mut self, status: &ProgressStatus, now: Duration) {
        if now < self.next {
            return;
        }
        self.next = now + PLAIN_EVERY;
        // Errors of the log do not stop the work.
        let _ = writeln!(self.out, "progress after {}: {}, {}", duration(now), status.name, status.figures());
    }

    fn clear(&mut self) {}

    fn message(&mut self, text: &str) {
        let _ = writeln!(self.out, "{text}");
    }
}

/// Prints a line to standard error; errors do not stop the work.
pub fn to_stderr(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Shows the progress of one command.
pub struct Meter {
    began: Instant,
    shared: Arc<SharedDisplay>,
    ticker: Option<JoinHandle<()>>,
}

struct SharedDisplay {
    /// `None` after the end of the command.
    display: Mutex<Option<Display>>,
    over: Condvar,
}

impl SharedDisplay {
    fn lock(&self) -> MutexGuard<'_, Option<Display>> {
        self.display.lock().unwrap_or_else(|e| e.into_inner())
    }
}

impl Meter {
    /// A live line on a terminal, elsewhere one plain line per minute.
    pub fn start() -> Meter {
        // Such a terminal cannot move its cursor: a shell inside an editor, for example.
        let dumb = std::env::var_os("TERM").is_some_and(|t| t == "dumb");
        match std::io::stderr().is_terminal() && !dumb {
            true => Meter::with(Box::new(Terminal::new()), TICK),
            false => Meter::with(Box::new(PlainLines { out: std::io::stderr(), next: PLAIN_EVERY }), PLAIN_TICK),
        }
    }

    fn with(sink: Box<dyn StatusSink>, every: Duration) -> Meter {
        let began = Instant::now();
        let shared = Arc::new(SharedDisplay { display: Mutex::new(Some(Display::new(sink))), over: Condvar::new() });
        let ticker_display = Arc::clone(&shared);
        let ticker = std::thread::Builder::new().name("progress".into()).spawn(move || {
            let mut display = ticker_display.lock();
            while let Some(d) = display.as_mut() {
                d.tick(began.elapsed());
                // Others may lock while this waits; the end of the command wakes it.
                display = ticker_display.over.wait_timeout(display, every).unwrap_or_else(|e| e.into_inner()).0;
            }
        });
        // Without a thread the work goes on without progress.
        Meter { began, shared, ticker: ticker.ok() }
    }

    /// Starts a phase of `total` steps (0 = unknown) inside the running ones.
    pub fn begin(&self, phase: &str, total: u64) {
        let now = self.began.elapsed();
        self.shared.lock().iter_mut().for_each(|d| d.begin(phase, total, now));
    }

    /// Adds finished steps to the innermost phase.
    pub fn advance(&self, steps: u64) {
        self.shared.lock().iter_mut().for_each(|d| d.advance(steps));
    }

    /// Ends the innermost phase.
    pub fn end(&self) {
        let now = self.began.elapsed();
        self.shared.lock().iter_mut().for_each(|d| d.end(now));
    }

    /// Prints a line for the user.
    pub fn message(&self, text: &str) {
        self.shared.lock().iter_mut().for_each(|d| d.sink.message(text));
    }

    /// Hides the progress while `work` writes to the terminal.
    pub fn aside<T>(&self, write: impl FnOnce() -> T) -> T {
        let mut display = self.shared.lock();
        display.iter_mut().for_each(|d| d.sink.clear());
        write()
    }
}

impl Drop for Meter {
    fn drop(&mut self) {
        // Taken first: the thread ends when it finds no display.
        if let Some(mut display) = self.shared.lock().take() {
            display.sink.clear();
        }
        self.shared.over.notify_all();
        if let Some(ticker) = self.ticker.take() {
            let _ = ticker.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    /// The shown texts, with their times.
    #[derive(Clone, Default)]
    struct ShownRecord(Arc<Mutex<Vec<String>>>);

    impl StatusSink for ShownRecord {
        fn show(&mut self, status: &ProgressStatus, _: Duration) {
            self.0.lock().unwrap().push(format!("{}, {}", status.name, status.figures()));
        }
        fn clear(&mut self) {}
        fn message(&mut self, _: &str) {}
    }

    impl Write for ShownRecord {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.lock().unwrap().push(String::from_utf8(bytes.to_vec()).unwrap());
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    impl ShownRecord {
        fn all(&self) -> Vec<String> {
            self.0.lock().unwrap().clone()
        }
    }

    #[test]
    fn durations_have_at_most_two_units() {
        let texts = [0, 59, 60, 3599, 3600, 90_061].map(|s| duration(at(s)));
        assert_eq!(texts, ["0 s", "59 s", "1 min 0 s", "59 min 59 s", "1 h 0 min", "25 h 1 min"]);
    }

    #[test]
    fn a_phase_shows_its_name_share_and_time() {
        let record = ShownRecord::default();
        let mut d = Display::new(Box::new(record.clone()));
        d.begin("fitting", 200, at(10));
        d.tick(at(12));
        d.advance(50);
        d.tick(at(40));
        d.begin("surface density", 0, at(41));
        d.tick(at(42));
        d.end(at(43));
        d.end(at(44));
        d.begin("groups", 0, at(50));
        d.tick(at(125));
        assert_eq!(
            record.all(),
            [
                "fitting, 0 %, 2 s so far",
                "fitting, 25 %, 1 min 24 s left",
                "fitting: surface density, 25 %, 1 min 22 s left",
                "groups, 1 min 15 s so far"
            ]
        );
    }

    /// Steps of an earlier run say nothing about the rate of this one.
    #[test]
    fn a_resumed_phase_estimates_time_from_its_own_steps() {
        let mut d = Display::new(Box::new(ShownRecord::default()));
        d.begin("training", 100, at(0));
        d.advance(70);
        d.tick(at(1));
        assert_eq!(d.status(at(5)).figures(), "70 %, 5 s so far");
        d.advance(10);
        assert_eq!(d.status(at(11)).figures(), "80 %, 20 s left");
    }

    /// A step of minutes does not make the rest look longer with every second.
    #[test]
    fn the_time_left_falls_while_a_step_lasts() {
        let mut d = Display::new(Box::new(ShownRecord::default()));
        d.begin("experiments", 100, at(0));
        d.tick(at(0));
        d.advance(50);
        d.tick(at(100));
        let left = [100, 160, 190, 400].map(|now| {
            d.tick(at(now));
            d.status(at(now)).left
        });
        assert_eq!(left, [100, 40, 10, 30].map(|s| Some(at(s))));
    }

    /// A step of the inner phase is worth telling until the first of the outer one is done.
    #[test]
    fn the_inner_phase_is_shown_until_the_outer_one_advances() {
        let mut d = Display::new(Box::new(ShownRecord::default()));
        d.begin("views", 4, at(0));
        d.begin("drawing", 10, at(0));
        d.advance(5);
        assert_eq!(d.status(at(20)).share, Some(0.5));
        d.end(at(40));
        d.advance(1);
        d.begin("drawing", 10, at(40));
        d.advance(5);
        let status = d.status(at(60));
        assert_eq!((status.share, status.left), (Some(0.25), Some(at(180))));
    }

    /// Whatever the work says or does not say, two seconds never pass with the same line.
    #[test]
    fn the_live_line_keeps_moving() {
        let record = ShownRecord::default();
        let mut d = Display::new(Box::new(record.clone()));
        for second in 0..10 {
            d.tick(at(second));
        }
        d.begin("reading", 0, at(10));
        (10..20).for_each(|s| d.tick(at(s)));
        d.begin("a phase of known size", 100, at(20));
        (20..30).for_each(|s| d.tick(at(s)));
        d.advance(1);
        (30..40).for_each(|s| d.tick(at(s)));
        let lines = record.all();
        assert_eq!(lines.len(), 40);
        assert!(lines.windows(2).all(|w| w[0] != w[1]), "{lines:?}");
        assert!(TICK < at(1));
    }

    #[test]
    fn estimated_totals_do_not_exceed_the_whole() {
        let mut d = Display::new(Box::new(ShownRecord::default()));
        d.begin("partition", 977, at(0));
        d.advance(1037);
        assert_eq!(d.status(at(5)).figures(), "100 %, 1 s left");
        d.advance(u64::MAX);
        assert_eq!(d.status(at(5)).share, Some(1.0));
        // An end too many is no panic.
        (0..3).for_each(|_| d.end(at(6)));
        d.advance(1);
    }

    #[test]
    fn elsewhere_one_plain_line_a_minute_and_none_before() {
        let record = ShownRecord::default();
        let mut d = Display::new(Box::new(PlainLines { out: record.clone(), next: PLAIN_EVERY }));
        d.begin("refine", 300, at(0));
        (0..60).for_each(|s| d.tick(at(s)));
        assert!(record.all().is_empty());
        d.advance(150);
        (60..240).for_each(|s| d.tick(at(s)));
        let text = record.all().concat();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 3, "{text}");
        assert_eq!(lines[0], "progress after 1 min 0 s: refine, 50 %, 1 min 0 s left");
        assert!(text.chars().all(|c| c == '\n' || !c.is_control()), "{text:?}");
    }

    #[test]
    fn long_names_leave_room_for_figures() {
        let name = shortened(&"ä".repeat(200));
        assert_eq!((name.chars().count(), name.ends_with('…')), (NAME_WIDTH, true));
    }

    /// The thread asks by itself, and ends with the meter.
    #[test]
    fn a_meter_updates_on_its_own() {
        let record = ShownRecord::default();
        let meter = Meter::with(Box::new(record.clone()), Duration::from_millis(1));
        meter.begin("reading", 0);
        while record.all().iter().filter(|l| l.starts_with("reading")).count() < 2 {
            std::thread::yield_now();
        }
        drop(meter);
        let line_count = record.all().len();
        std::thread::yield_now();
        assert_eq!(record.all().len(), line_count);
    }
}
