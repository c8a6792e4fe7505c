//! A thread that writes what it is handed while the solver goes on.
//!
//! One order is in hand at most: who has the next one waits for the last one first, so that memory stays bounded and an error comes
//! no later than that.

use crate::storage::StorageError;
use std::io;
use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::thread::{Builder, JoinHandle};

/// The thread and the order that it has in hand. Dropped, it ends that order first.
#[derive(Debug)]
pub struct BackgroundWriter<T> {
    orders: Option<SyncSender<T>>,
    outcomes: Receiver<Result<(), StorageError>>,
    thread: Option<JoinHandle<()>>,
    is_busy: bool,
}

impl<T: Send + 'static> BackgroundWriter<T> {
    /// Starts the thread, which calls `write` for each order.
    ///
    /// # Errors
    /// When the system has no thread to give.
    pub fn start(mut write: impl FnMut(T) -> Result<(), StorageError> + Send + 'static) -> io::Result<Self> {
        let (orders, incoming) = sync_channel(1);
        let (outgoing, outcomes) = sync_channel(1);
        let work = move || {
            for order in incoming {
                // Nobody asks any more: the run has ended by another error.
                if outgoing.send(write(order)).is_err() {
                    return;
                }
            }
        };
        let thread = Builder::new().name("tollgate-frames".to_owned()).spawn(work)?;
        Ok(Self { orders: Some(orders), outcomes, thread: Some(thread), is_busy: false })
    }

    /// Hands an order over, once the last one is done.
    ///
    /// # Errors
    /// That of the last order.
    pub fn hand_over(&mut self, order: T) -> Result<(), StorageError> {
        self.wait()?;
        self.is_busy = self.orders.as_ref().is_some_and(|orders| orders.send(order).is_ok());
        if self.is_busy { Ok(()) } else { self.fall_with_the_thread() }
    }

    /// Waits until everything handed over is written.
    ///
    /// # Errors
    /// That of the last order.
    pub fn wait(&mut self) -> Result<(), StorageError> {
        if !self.is_busy {
            return Ok(());
        }
        let outcome = self.outcomes.recv();
        self.is_busy = false;
        outcome.unwrap_or_else(|_| self.fall_with_the_thread())
    }

    /// Says whether the order in hand has failed already, without waiting for it.
    ///
    /// # Errors
    /// That of the last order.
    pub fn heed(&mut self) -> Result<(), StorageError> {
        if !self.is_busy {
            return Ok(());
        }
        let outcome = self.outcomes.try_recv();
        self.is_busy = matches!(outcome, Err(TryRecvError::Empty));
        match outcome {
            Ok(outcome) => outcome,
            Err(TryRecvError::Empty) => Ok(()),
            Err(TryRecvError::Disconnected) => self.fall_with_the_thread(),
        }
    }

    /// The thread ends before it is told to by a panic only, which is then that of the whole run.
    fn fall_with_the_thread(&mut self) -> Result<(), StorageError> {
        match self.thread.take().map(JoinHandle::join) {
            Some(Err(panic)) => resume_unwind(panic),
            _ => unreachable!("the thread writes until its orders end"),
        }
    }
}

impl<T> Drop for BackgroundWriter<T> {
    fn drop(&mut self) {
        // The thread ends with its orders.
        self.orders = None;
        if let Some(thread) = self.thread.take() {
            // Its panic has been told already, and another one may be under way here.
            drop(thread.join());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use std::sync::{Arc, Mutex, mpsc};
    use std::time::Duration;

    fn failure(order: u32) -> StorageError {
        StorageError::system("write", Path::new(&format!("frame {order}")), io::ErrorKind::StorageFull.into())
    }

    /// A writer that ends each order when it is let, and what it has written.
    fn gated() -> (BackgroundWriter<u32>, mpsc::Sender<()>, Arc<Mutex<Vec<u32>>>) {
        let (gate, open) = mpsc::channel::<()>();
        let written = Arc::new(Mutex::new(Vec::new()));
        let held = Arc::clone(&written);
        let writer = BackgroundWriter::start(move |order| {
            let _ = open.recv();
            if order == 13 {
                return Err(failure(order));
            }
            held.lock().unwrap().push(order);
            Ok(())
        });
        (writer.unwrap(), gate, written)
    }

    #[test]
    fn the_caller_goes_on_while_an_order_is_in_hand_and_all_is_written_in_order() {
        let (mut writer, gate, written) = gated();
        writer.hand_over(1).unwrap();
        writer.heed().unwrap();
        assert!(written.lock().unwrap().is_empty(), "the order ended before it was let");
        gate.send(()).unwrap();
        writer.wait().unwrap();
        assert_eq!(*written.lock().unwrap(), [1]);
        for order in 2..6 {
            gate.send(()).unwrap();
            writer.hand_over(order).unwrap();
            // Only the last one may be in hand still.
            assert!(written.lock().unwrap().len() + 1 >= order as usize);
        }
        writer.wait().unwrap();
        assert_eq!(*written.lock().unwrap(), [1, 2, 3, 4, 5]);
    }

    #[test]
    fn what_was_handed_over_is_written_before_the_writer_goes() {
        let (mut writer, gate, written) = gated();
        writer.hand_over(1).unwrap();
        drop(gate);
        drop(writer);
        assert_eq!(*written.lock().unwrap(), [1]);
    }

    #[test]
    fn an_error_comes_at_the_next_order_or_the_end_or_when_asked_for() {
        for ask in [BackgroundWriter::wait, |writer: &mut BackgroundWriter<u32>| writer.hand_over(14)] {
            let (mut writer, gate, _) = gated();
            writer.hand_over(13).unwrap();
            writer.heed().unwrap();
            drop(gate);
            assert_eq!(ask(&mut writer).unwrap_err().to_string(), failure(13).to_string());
            writer.wait().unwrap();
        }
        let (mut writer, gate, _) = gated();
        writer.hand_over(13).unwrap();
        drop(gate);
        let seen = (0..10_000).find_map(|_| {
            std::thread::sleep(Duration::from_millis(1));
            writer.heed().err()
        });
        assert_eq!(seen.unwrap().to_string(), failure(13).to_string());
    }

    #[test]
    #[should_panic(expected = "a mistake of ours")]
    fn a_panic_of_the_thread_is_one_of_the_run() {
        let mut writer: BackgroundWriter<()> = BackgroundWriter::start(|()| panic!("a mistake of ours")).unwrap();
        writer.hand_over(()).unwrap();
        drop(writer.wait());
    }
}
