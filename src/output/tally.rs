//! How far a list of tasks is: one line on stderr, renewed in place on a terminal; off a terminal plain lines, if asked for.

use super::progress::Verbosity;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

/// Shows how far a list of tasks is.
#[derive(Debug)]
pub struct Tally {
    output: Output,
    started: Instant,
    /// Share of the work that was done at the first look.
    first: Option<f64>,
    said: Option<String>,
}

#[derive(Debug)]
enum Output {
    Silent,
    Terminal(ProgressBar),
    Lines,
}

impl Tally {
    /// On stderr.
    #[must_use]
    pub fn on_stderr(verbosity: Verbosity) -> Self {
        let output = match verbosity {
            Verbosity::Silent => Output::Silent,
            _ if std::io::stderr().is_terminal() => {
                let bar = ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::stderr());
                let style = ProgressStyle::with_template("[{bar:24}] {msg}");
                bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> "));
                Output::Terminal(bar)
            }
            Verbosity::Normal => Output::Silent,
            Verbosity::Verbose => Output::Lines,
        };
        Self { output, started: Instant::now(), first: None, said: None }
    }

    /// So many of `all` tasks are `done`, `running` and `failed`; `share` of the predicted work is done.
    pub fn update(&mut self, done: usize, all: usize, running: usize, failed: usize, share: f64) {
        let first = *self.first.get_or_insert(share);
        let counts = line(done, all, running, failed);
        let rest =
            remaining(self.started.elapsed(), first, share).map_or_else(String::new, |rest| format!(", {rest} left"));
        match &self.output {
            Output::Silent => {}
            Output::Terminal(bar) => {
                bar.set_position((1000.0 * share.clamp(0.0, 1.0)) as u64);
                bar.set_message(counts + &rest);
            }
            // Progress is a courtesy: a closed stderr must not end a campaign.
            Output::Lines if self.said.as_ref() != Some(&counts) => {
                drop(writeln!(std::io::stderr(), "{counts}{rest}"));
                self.said = Some(counts);
            }
            Output::Lines => {}
        }
    }

    /// Says something in between.
    pub fn say(&self, text: &str) {
        match &self.output {
            Output::Silent => {}
            Output::Terminal(bar) => bar.println(text),
            Output::Lines => drop(writeln!(std::io::stderr(), "{text}")),
        }
    }
}

impl Drop for Tally {
    fn drop(&mut self) {
        if let Output::Terminal(bar) = &self.output {
            bar.finish_and_clear();
        }
    }
}

fn line(done: usize, all: usize, running: usize, failed: usize) -> String {
    let failures = if failed == 0 { String::new() } else { format!(", {failed} failed or held up") };
    format!("{done} of {all} stages, {running} running{failures}")
}

/// Time that the rest takes at the speed so far, once something has been done.
fn remaining(elapsed: Duration, first: f64, share: f64) -> Option<String> {
    let done = share - first;
    if done <= 0.0 {
        return None;
    }
    let seconds = elapsed.as_secs_f64() * (1.0 - share).max(0.0) / done;
    Some(if seconds < 90.0 {
        format!("{seconds:.0} s")
    } else if seconds < 5400.0 {
        format!("{:.0} min", seconds / 60.0)
    } else {
        format!("{:.1} h", seconds / 3600.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rest_goes_by_what_was_done_here() {
        let after = Duration::from_secs(100);
        assert_eq!(remaining(after, 0.5, 0.5), None, "nothing done yet");
        // A tenth in 100 s, four tenths to go.
        assert_eq!(remaining(after, 0.5, 0.6).unwrap(), "7 min");
        assert_eq!(remaining(after, 0.0, 1.0).unwrap(), "0 s");
        assert_eq!(line(3, 11, 2, 0), "3 of 11 stages, 2 running");
        assert_eq!(line(3, 11, 2, 1), "3 of 11 stages, 2 running, 1 failed or held up");
    }
}
