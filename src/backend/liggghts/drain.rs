//! Keeps the pipes of a process empty, so that it never waits for us: into a file, and line by line to whoever watches.

use super::screen::{Line, Screen};
use std::fs::File;
use std::io::{self, Read, Write};
use std::sync::mpsc::Sender;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Shortest and longest wait for more of what is printed: lines come one by one, and a look at each would cost more than the line.
/// Who prints much is looked at more often, since a full pipe holds it up.
const GATHER: [Duration; 2] = [Duration::from_millis(1), Duration::from_millis(16)];

/// News from the threads that drain.
pub(super) enum News {
    Printed(Line),
    /// What is printed cannot be kept.
    Unwritten(io::Error),
}

/// Keeps a pipe empty: into the file, and line by line to whoever waits for it.
pub(super) fn drain_output(pipe: impl Read, file: &Mutex<File>, sender: &Sender<News>) -> Screen {
    let mut screen = Screen::default();
    let mut open: Vec<u8> = Vec::new();
    let mut tell = |line: &[u8]| {
        let line = screen.read(&String::from_utf8_lossy(line));
        if line != Line::Other {
            // Nobody waits any more where the case was given up; the pipe is drained nonetheless.
            drop(sender.send(News::Printed(line)));
        }
    };
    drain(pipe, file, sender, |bytes| {
        open.extend_from_slice(bytes);
        let mut start = 0;
        while let Some(length) = open[start..].iter().position(|&byte| byte == b'\n') {
            tell(&open[start..start + length]);
            start += length + 1;
        }
        open.drain(..start);
    });
    if !open.is_empty() {
        tell(&open);
    }
    screen
}

/// The end of what came through the pipe.
pub(super) fn drain_errors(pipe: impl Read, file: &Mutex<File>, sender: &Sender<News>) -> Vec<u8> {
    const KEPT: usize = 1 << 14;
    let mut last = Vec::new();
    drain(pipe, file, sender, |bytes| {
        last.extend_from_slice(bytes);
        last.drain(..last.len().saturating_sub(KEPT));
    });
    last
}

fn drain(mut pipe: impl Read, file: &Mutex<File>, sender: &Sender<News>, mut take: impl FnMut(&[u8])) {
    let mut block = vec![0; 1 << 16];
    let mut is_written = true;
    let [shortest, longest] = GATHER;
    let mut wait = shortest;
    loop {
        let length = match pipe.read(&mut block) {
            Ok(0) => return,
            Ok(length) => length,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(_) => return,
        };
        take(&block[..length]);
        if is_written {
            let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
            if let Err(error) = file.write_all(&block[..length]) {
                is_written = false;
                drop(sender.send(News::Unwritten(error)));
            }
        }
        // The pipe, which holds as much as a block, keeps what comes meanwhile.
        wait = if length < block.len() / 4 { (2 * wait).min(longest) } else { (wait / 2).max(shortest) };
        if length < block.len() / 2 {
            std::thread::sleep(wait);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::stage::EndReason;
    use std::sync::mpsc::channel;

    #[test]
    fn lines_are_whole_however_the_pipe_cuts_them() {
        struct Crumbs<'a>(&'a [u8]);
        impl Read for Crumbs<'_> {
            fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
                let length = self.0.len().min(3);
                buffer[..length].copy_from_slice(&self.0[..length]);
                self.0 = &self.0[length..];
                Ok(length)
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("screen");
        let text = b"Step Atoms KinEng\n 5 2 0.25\nWARNING: \xff\xfe odd\ntollgate end time 5";
        let (sender, news) = channel();
        drain_output(Crumbs(text), &Mutex::new(File::create(&place).unwrap()), &sender);
        drop(sender);
        let lines: Vec<Line> =
            news.iter().map(|news| if let News::Printed(line) = news { line } else { Line::Other }).collect();
        let expected = [
            Line::Thermo { step: 5, atoms: 2, kinetic_energy: 0.25 },
            Line::Warning("\u{fffd}\u{fffd} odd".into()),
            Line::End { reason: EndReason::Time, step: 5 },
        ];
        assert_eq!(lines, expected);
        assert_eq!(std::fs::read(&place).unwrap(), text);
    }
}
