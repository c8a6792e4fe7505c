//! How far a run is: one line on stderr, renewed in place on a terminal.
//!
//! The one place from which the library speaks while it works. Off a terminal it is silent unless asked to be verbose,
//! and then writes a plain line now and again, so that logs stay readable.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

/// How much is said.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Verbosity {
    /// Nothing: for `--json` and tests.
    Silent,
    /// A line that is renewed in place on a terminal; nothing elsewhere.
    #[default]
    Normal,
    /// As `Normal`; plain lines where stderr is no terminal.
    Verbose,
}

/// How far the run is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Status {
    /// Plant time [s].
    pub time: f64,
    /// Time steps done since the run or its resume started.
    pub steps: u64,
    /// Particles in the scene.
    pub particles: u64,
}

/// Shows how far a run is.
pub struct Progress {
    estimate: Estimate,
    started: Instant,
    shown: Option<Duration>,
    output: Output,
}

enum Output {
    Silent,
    Terminal(ProgressBar),
    Lines(Box<dyn Write + Send>),
}

impl std::fmt::Debug for Progress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Progress").field("estimate", &self.estimate).finish_non_exhaustive()
    }
}

impl Progress {
    /// Progress of a run from plant time `from` to `end` [s], on stderr.
    #[must_use]
    pub fn on_stderr(verbosity: Verbosity, from: f64, end: f64) -> Self {
        let output = match verbosity {
            Verbosity::Silent => Output::Silent,
            _ if std::io::stderr().is_terminal() => Output::Terminal(bar()),
            Verbosity::Normal => Output::Silent,
            Verbosity::Verbose => Output::Lines(Box::new(std::io::stderr())),
        };
        Self::new(output, from, end)
    }

    /// Progress as plain lines into `sink`, one every [`Progress::LINE_INTERVAL`].
    #[must_use]
    pub fn as_lines(sink: Box<dyn Write + Send>, from: f64, end: f64) -> Self {
        Self::new(Output::Lines(sink), from, end)
    }

    /// Wall time between two plain lines.
    pub const LINE_INTERVAL: Duration = Duration::from_secs(10);
    /// Wall time between two drawings on a terminal.
    const DRAW_INTERVAL: Duration = Duration::from_millis(200);

    fn new(output: Output, from: f64, end: f64) -> Self {
        Self { estimate: Estimate::new(from, end), started: Instant::now(), shown: None, output }
    }

    /// Tells how far the run is; cheap enough to be called every few steps.
    pub fn update(&mut self, status: Status) {
        self.update_at(self.started.elapsed(), status);
    }

    fn update_at(&mut self, wall: Duration, status: Status) {
        let interval = match self.output {
            Output::Silent => return,
            Output::Terminal(_) => Self::DRAW_INTERVAL,
            Output::Lines(_) => Self::LINE_INTERVAL,
        };
        if self.shown.is_some_and(|shown| wall.saturating_sub(shown) < interval) {
            return;
        }
        self.shown = Some(wall);
        self.estimate.update(wall.as_secs_f64(), status);
        self.show(wall);
    }

    fn show(&mut self, wall: Duration) {
        let line = self.estimate.line(wall.as_secs_f64());
        match &mut self.output {
            Output::Silent => {}
            Output::Terminal(bar) => {
                bar.set_position((1000.0 * self.estimate.share()) as u64);
                bar.set_message(line);
            }
            // Progress is a courtesy: a closed stderr must not end a run.
            Output::Lines(sink) => drop(writeln!(sink, "{line}")),
        }
    }

    /// Says something in between (a warning, an event) without disturbing the line; silent where all else is.
    pub fn say(&mut self, text: &str) {
        match &mut self.output {
            Output::Silent => {}
            Output::Terminal(bar) => bar.println(text),
            Output::Lines(sink) => drop(writeln!(sink, "{text}")),
        }
    }

    /// Ends the display with a last look at the run.
    pub fn finish(&mut self, status: Status) {
        let wall = self.started.elapsed();
        self.estimate.update(wall.as_secs_f64(), status);
        self.show(wall);
        if let Output::Terminal(bar) = &self.output {
            bar.abandon();
        }
        self.output = Output::Silent;
    }
}

fn bar() -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::stderr_with_hz(5));
    if let Ok(style) = ProgressStyle::with_template("{bar:24} {msg}") {
        bar.set_style(style);
    }
    bar
}

/// Rates and the remaining time. Rates are means over the recent past, since they change while a scene fills.
#[derive(Debug, Clone, PartialEq)]
struct Estimate {
    from: f64,
    end: f64,
    status: Status,
    /// Wall time of the last update [s].
    wall: f64,
    /// Plant time per wall time [-].
    pace: Option<f64>,
    /// Time steps per wall time [1/s].
    steps_rate: Option<f64>,
}

impl Estimate {
    /// Wall time over which rates are averaged [s].
    const MEMORY: f64 = 15.0;

    fn new(from: f64, end: f64) -> Self {
        let status = Status { time: from, ..Status::default() };
        Self { from, end, status, wall: 0.0, pace: None, steps_rate: None }
    }

    fn update(&mut self, wall: f64, status: Status) {
        let interval = wall - self.wall;
        if interval > 0.0 {
            let weight = 1.0 - (-interval / Self::MEMORY).exp();
            let mean = |old: Option<f64>, new: f64| Some(old.map_or(new, |old| old + weight * (new - old)));
            self.pace = mean(self.pace, (status.time - self.status.time) / interval);
            let steps = status.steps.saturating_sub(self.status.steps);
            self.steps_rate = mean(self.steps_rate, steps as f64 / interval);
            self.wall = wall;
        }
        self.status = status;
    }

    fn share(&self) -> f64 {
        let span = self.end - self.from;
        if span > 0.0 { ((self.status.time - self.from) / span).clamp(0.0, 1.0) } else { 1.0 }
    }

    /// Remaining wall time [s], once there is a pace.
    fn remaining(&self) -> Option<f64> {
        let pace = self.pace.filter(|&pace| pace > 0.0)?;
        Some((self.end - self.status.time).max(0.0) / pace)
    }

    fn line(&self, wall: f64) -> String {
        let Status { time, particles, .. } = self.status;
        let rate = self.steps_rate.map_or_else(|| "-".to_owned(), |rate| format!("{rate:.0}"));
        let remaining = self.remaining().map_or_else(|| "-".to_owned(), duration);
        format!(
            "{time:.4} of {:.4} s ({:.1} %), {particles} particles, {rate} steps/s, wall {}, eta {remaining}",
            self.end,
            100.0 * self.share(),
            duration(wall),
        )
    }
}

/// 75 s as 1:15, 3675 s as 1:01:15.
fn duration(seconds: f64) -> String {
    let total = seconds.round().clamp(0.0, 1e9) as u64;
    let (hours, minutes, seconds) = (total / 3600, total / 60 % 60, total % 60);
    if hours > 0 { format!("{hours}:{minutes:02}:{seconds:02}") } else { format!("{minutes}:{seconds:02}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    #[derive(Clone, Default)]
    struct Sink(Arc<Mutex<Vec<u8>>>);

    impl Write for Sink {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.lock().unwrap().extend(bytes);
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    impl Sink {
        fn text(&self) -> String {
            String::from_utf8(self.0.lock().unwrap().clone()).unwrap()
        }
    }

    #[test]
    fn a_steady_run_ends_when_it_was_said_to_end() {
        let (from, end, pace) = (1.0, 5.0, 0.02);
        let mut estimate = Estimate::new(from, end);
        for second in 1..50 {
            let wall = f64::from(second);
            estimate.update(wall, Status { time: from + pace * wall, steps: 100 * second as u64, particles: 7 });
            let remaining = (end - from) / pace - wall;
            approx::assert_relative_eq!(estimate.remaining().unwrap(), remaining, max_relative = 1e-9);
        }
        let line = estimate.line(49.0);
        assert_eq!(line, "1.9800 of 5.0000 s (24.5 %), 7 particles, 100 steps/s, wall 0:49, eta 2:31");
    }

    #[test]
    fn a_slower_run_is_noticed_within_its_memory() {
        let mut estimate = Estimate::new(0.0, 100.0);
        estimate.update(10.0, Status { time: 10.0, steps: 10, particles: 0 });
        for second in 11..=(10 + 5 * Estimate::MEMORY as u32) {
            let wall = f64::from(second);
            estimate.update(wall, Status { time: 10.0 + 0.1 * (wall - 10.0), steps: 0, particles: 0 });
        }
        // Five memories: the old pace of 1 is left with a weight of e^-5.
        let pace = 0.1 + 0.9 * (-5.0_f64).exp();
        approx::assert_relative_eq!(estimate.pace.unwrap(), pace, max_relative = 1e-9);
    }

    #[test]
    fn lines_come_at_intervals_and_at_the_end() {
        let sink = Sink::default();
        let mut progress = Progress::as_lines(Box::new(sink.clone()), 0.0, 1.0);
        for second in 0..35_u32 {
            let status = Status { time: f64::from(second) / 100.0, steps: 1, particles: 3 };
            progress.update_at(Duration::from_secs(second.into()), status);
        }
        assert_eq!(sink.text().lines().count(), 4, "at 0, 10, 20 and 30 s:\n{}", sink.text());
        progress.say("gate opened");
        progress.finish(Status { time: 1.0, steps: 9, particles: 3 });
        progress.say("after the end");
        let text = sink.text();
        let last: Vec<&str> = text.lines().skip(4).collect();
        assert_eq!(last[0], "gate opened");
        assert!(last[1].contains("(100.0 %)") && last.len() == 2, "{text}");
    }

    #[test]
    fn silence_is_silent() {
        let mut progress = Progress::on_stderr(Verbosity::Silent, 0.0, 1.0);
        progress.update(Status::default());
        assert!(matches!(progress.output, Output::Silent));
    }

    #[test]
    fn durations_read_like_clocks() {
        assert_eq!(duration(75.0), "1:15");
        assert_eq!(duration(3675.4), "1:01:15");
        assert_eq!(duration(f64::INFINITY), "277777:46:40", "clamped");
    }
}
