//! Threads for the chunks' work; what they compute never depends on how many there are.
//!
//! A time step hands work out three times, for some ten or hundred microseconds each. A thread that falls asleep in between wakes too
//! late to be of use: these wait awake for a while. Measured in `docs/decisions/threads-that-wait-awake.md`.

use std::any::Any;
use std::cell::UnsafeCell;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// How long a thread waits awake: longer than anything that a time step does in between on one thread, but for new lists and files.
const AWAKE: Duration = Duration::from_micros(500);
/// Looks at the ticket between two looks at the clock, when others may have the processor.
const LOOKS: u32 = 64;
/// How long a thread without items of its own leaves the others theirs. In a thin cloud a round takes as long, and an item taken from another
/// processor's cache longer than it is worth (`docs/decisions/threads-that-wait-awake.md`).
const PATIENCE: Duration = Duration::from_micros(50);
/// Items that can be handed out one by one; of more, several go together.
const SLOTS: usize = 256;

/// A fixed number of threads.
///
/// Rounds go over the items there and back in turns, each thread over the same part of them as long as it is not behind: what a round
/// leaves in a processor's cache, the next one finds there.
pub struct Threads {
    pool: Option<Pool>,
    /// Which way the next round without a pool goes.
    back: AtomicBool,
}

/// The threads besides the caller's own.
struct Pool {
    desk: Arc<Desk>,
    workers: Vec<JoinHandle<()>>,
    /// Held by who has handed work out.
    busy: Mutex<()>,
}

/// Where work is handed out.
struct Desk {
    ticket: AtomicU64,
    /// The last round in which each item was taken.
    taken: Vec<AtomicU32>,
    /// Items of the present round that are done.
    done: AtomicUsize,
    /// The present round's work. Changed only while no item of a round is taken and not done.
    work: UnsafeCell<Option<Work>>,
    /// What the first item that panicked said.
    panic: Mutex<Option<Box<dyn Any + Send>>>,
    /// Which workers sleep.
    asleep: Vec<AtomicBool>,
    closing: AtomicBool,
}

/// What to do with an item; it lives while the round does.
type Work = *const (dyn Fn(usize) + Sync);

// SAFETY: `work` is written by the holder of `busy` between rounds alone, and read by who has taken an item of the present one; what it
// points to may be shared.
unsafe impl Sync for Desk {}
// SAFETY: as above.
unsafe impl Send for Desk {}

/// Items of which part of a round.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Whose {
    Own,
    Anybodys,
}

/// A round's number, how many items it has, and how many of them are taken.
#[derive(Clone, Copy)]
struct Ticket {
    round: u32,
    count: u16,
    taken: u16,
}

impl Ticket {
    fn number(self) -> u64 {
        u64::from(self.round) << 32 | u64::from(self.count) << 16 | u64::from(self.taken)
    }

    const fn of(number: u64) -> Self {
        Self { round: (number >> 32) as u32, count: (number >> 16) as u16, taken: number as u16 }
    }

    const fn is_open(self) -> bool {
        self.taken < self.count
    }

    /// The items in the order in which thread `thread` of `threads` wants them: its own part, there or back, then, if `whose` says so,
    /// those of the others, from the end that they come to last.
    fn wanted(self, thread: usize, threads: usize, whose: Whose) -> impl Iterator<Item = usize> {
        let (count, back) = (usize::from(self.count), self.round % 2 == 1);
        let parts = threads.min(count);
        let turns = if whose == Whose::Own { parts.min(1) } else { parts };
        let part = move |number: usize| number * count / parts..(number + 1) * count / parts;
        (0..turns).flat_map(move |turn| {
            let (items, backwards) = (part((thread + turn) % parts), back != (turn > 0));
            let last = items.end + items.start;
            items.map(move |item| if backwards { last - 1 - item } else { item })
        })
    }
}

impl Desk {
    fn ticket(&self) -> Ticket {
        Ticket::of(self.ticket.load(Ordering::SeqCst))
    }

    /// Takes an item of a round for a thread. Whoever has one keeps the round from ending.
    fn take(&self, round: u32, thread: usize, whose: Whose) -> Option<usize> {
        let ticket = self.ticket();
        if !ticket.is_open() || ticket.round != round {
            return None;
        }
        let is_mine = |item: &usize| {
            let last = self.taken[*item].load(Ordering::SeqCst);
            // What was taken in a later round than this one is seen to be by the ticket; what is being taken in this one, by the exchange.
            let is_free = last != ticket.round && self.ticket().round == ticket.round;
            is_free
                && self.taken[*item].compare_exchange(last, ticket.round, Ordering::SeqCst, Ordering::SeqCst).is_ok()
        };
        let item = ticket.wanted(thread, self.asleep.len() + 1, whose).find(is_mine)?;
        // Still the same round: it lasts until this item is done.
        self.ticket.fetch_add(1, Ordering::SeqCst);
        Some(item)
    }

    /// Works on items of the present round while there are any.
    fn serve(&self, thread: usize) {
        let round = self.ticket().round;
        let own = self.work_on(round, thread, Whose::Own);
        let is_over = || !self.ticket().is_open() || self.ticket().round != round;
        // Whom nobody sees at work is held up. Awake all the time: who gives its processor away gets it back after milliseconds.
        let others_work = usize::from(self.ticket().taken) > own;
        let started = Instant::now();
        while others_work && !is_over() && started.elapsed() < PATIENCE {
            std::hint::spin_loop();
        }
        self.work_on(round, thread, Whose::Anybodys);
    }

    /// Works on items of a round while there are any; how many.
    fn work_on(&self, round: u32, thread: usize, whose: Whose) -> usize {
        let mut count = 0;
        while let Some(item) = self.take(round, thread, whose) {
            // SAFETY: the round that the item is of lasts until it is done, and its work with it.
            let work = unsafe { (*self.work.get()).map(|work| &*work) };
            let outcome = catch_unwind(AssertUnwindSafe(|| work.iter().for_each(|work| work(item))));
            if let Err(said) = outcome {
                self.panic.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(said);
            }
            self.done.fetch_add(1, Ordering::SeqCst);
            count += 1;
        }
        count
    }

    /// Whether worker `number` has a part in a round of so many items: the caller takes one, each worker before it another.
    const fn concerns(ticket: Ticket, number: usize) -> bool {
        number + 1 < ticket.count as usize
    }

    /// Serves until closed; sleeps where there has been nothing to do for a while, and at once where rounds have too few items.
    fn attend(&self, number: usize) {
        while !self.closing.load(Ordering::SeqCst) {
            self.serve(number + 1);
            let wanted = || {
                let ticket = self.ticket();
                ticket.is_open() && Self::concerns(ticket, number) || self.closing.load(Ordering::SeqCst)
            };
            let patience = if Self::concerns(self.ticket(), number) { AWAKE } else { Duration::ZERO };
            if !wait_awake(wanted, Some(patience)) {
                self.asleep[number].store(true, Ordering::SeqCst);
                // Who opens a round does so before looking for sleepers: one of both sees the other.
                if !wanted() {
                    thread::park();
                }
                self.asleep[number].store(false, Ordering::SeqCst);
            }
        }
    }
}

/// Waits awake until `holds`, for as long as said; true where it does.
fn wait_awake(holds: impl Fn() -> bool, at_most: Option<Duration>) -> bool {
    let started = Instant::now();
    loop {
        for _ in 0..LOOKS {
            if holds() {
                return true;
            }
            std::hint::spin_loop();
        }
        if at_most.is_some_and(|limit| started.elapsed() > limit) {
            return false;
        }
        // There may be more threads than processors.
        thread::yield_now();
    }
}

impl Pool {
    fn new(count: usize) -> Self {
        let desk = Arc::new(Desk {
            ticket: AtomicU64::new(0),
            taken: (0..SLOTS).map(|_| AtomicU32::new(0)).collect(),
            done: AtomicUsize::new(0),
            work: UnsafeCell::new(None),
            panic: Mutex::new(None),
            asleep: (0..count).map(|_| AtomicBool::new(false)).collect(),
            closing: AtomicBool::new(false),
        });
        let start = |number: usize| {
            let desk = Arc::clone(&desk);
            let name = format!("tollgate-{}", number + 1);
            thread::Builder::new().name(name).spawn(move || desk.attend(number)).expect("the system starts threads")
        };
        let workers = (0..count).map(start).collect();
        Self { desk, workers, busy: Mutex::new(()) }
    }

    /// `work` on the items 0 .. `count`, shared with the workers. Returns when all are done.
    fn share(&self, count: u16, work: &(dyn Fn(usize) + Sync)) {
        // Work that hands out work, or another caller: alone.
        let Ok(held) = self.busy.try_lock() else { return (0..usize::from(count)).for_each(work) };
        let desk = &*self.desk;
        let work: *const (dyn Fn(usize) + Sync + '_) = work;
        // SAFETY: the last round is over, so nobody looks at its work; this one's outlives it, since all items are waited for below.
        unsafe { *desk.work.get() = Some(std::mem::transmute::<*const (dyn Fn(usize) + Sync + '_), Work>(work)) };
        desk.done.store(0, Ordering::SeqCst);
        let round = desk.ticket().round.wrapping_add(1);
        // Numbers come again after 2^32 rounds.
        for slot in desk.taken[..usize::from(count)].iter().filter(|slot| slot.load(Ordering::SeqCst) == round) {
            slot.store(round.wrapping_sub(1), Ordering::SeqCst);
        }
        desk.ticket.store(Ticket { round, count, taken: 0 }.number(), Ordering::SeqCst);
        self.wake(usize::from(count) - 1);
        desk.serve(0);
        wait_awake(|| desk.done.load(Ordering::SeqCst) == usize::from(count), None);
        let said = desk.panic.lock().unwrap_or_else(PoisonError::into_inner).take();
        drop(held);
        if let Some(said) = said {
            resume_unwind(said);
        }
    }

    /// Wakes those of the first `count` workers that sleep.
    fn wake(&self, count: usize) {
        let sleepers = self.workers.iter().zip(&self.desk.asleep).take(count);
        sleepers.filter(|(_, asleep)| asleep.load(Ordering::SeqCst)).for_each(|(worker, _)| worker.thread().unpark());
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        self.desk.closing.store(true, Ordering::SeqCst);
        self.wake(self.workers.len());
        for worker in self.workers.drain(..) {
            // It cannot panic: what work says is caught.
            drop(worker.join());
        }
    }
}

impl fmt::Debug for Threads {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let further = self.pool.as_ref().map_or(0, |pool| pool.workers.len());
        formatter.debug_struct("Threads").field("count", &(further + 1)).finish()
    }
}

impl Threads {
    /// `count` threads, the caller's own among them.
    ///
    /// # Panics
    /// When the system refuses to start threads.
    #[must_use]
    pub fn new(count: usize) -> Self {
        Self { pool: (count > 1).then(|| Pool::new(count - 1)), back: AtomicBool::new(false) }
    }

    /// `work(0)`, `work(1)`, ... `work(count - 1)`, in the order of the numbers; they are computed in any order.
    ///
    /// # Panics
    /// Where `work` does.
    pub fn map<R: Send + Sync>(&self, count: usize, work: impl Fn(usize) -> R + Sync) -> Vec<R> {
        let Some(pool) = self.pool.as_ref().filter(|_| count > 1) else { return (0..count).map(work).collect() };
        let results: Vec<OnceLock<R>> = (0..count).map(|_| OnceLock::new()).collect();
        let slots = count.min(SLOTS);
        pool.share(slots as u16, &|slot| {
            for item in (slot..count).step_by(slots) {
                // Every item is taken once.
                drop(results[item].set(work(item)));
            }
        });
        results.into_iter().filter_map(OnceLock::into_inner).collect()
    }

    /// `work` on every item.
    ///
    /// # Panics
    /// Where `work` does.
    pub fn for_each<T: Send>(&self, items: Vec<T>, work: impl Fn(T) + Sync) {
        if self.pool.is_none() {
            let back = self.back.fetch_xor(true, Ordering::Relaxed);
            return if back { items.into_iter().rev().for_each(work) } else { items.into_iter().for_each(work) };
        }
        let items: Vec<Mutex<Option<T>>> = items.into_iter().map(|item| Mutex::new(Some(item))).collect();
        self.map(items.len(), |number| {
            let item = items[number].lock().unwrap_or_else(PoisonError::into_inner).take();
            item.into_iter().for_each(&work);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_is_done_once_and_in_its_place() {
        for count in [1, 2, 3, 9] {
            let threads = Threads::new(count);
            for items in [0, 1, 2, 5, 100, 1000] {
                let times: Vec<AtomicUsize> = (0..items).map(|_| AtomicUsize::new(0)).collect();
                let found = threads.map(items, |item| {
                    times[item].fetch_add(1, Ordering::Relaxed);
                    item * item
                });
                assert_eq!(found, (0..items).map(|item| item * item).collect::<Vec<_>>());
                assert!(times.iter().all(|times| times.load(Ordering::Relaxed) == 1));
            }
        }
    }

    #[test]
    fn threads_go_over_their_own_parts_there_and_back() {
        let wanted = |round: u32, thread: usize| -> Vec<usize> {
            Ticket { round, count: 4, taken: 0 }.wanted(thread, 2, Whose::Anybodys).collect()
        };
        assert_eq!(wanted(0, 0), [0, 1, 3, 2]);
        assert_eq!(wanted(0, 1), [2, 3, 1, 0]);
        assert_eq!(wanted(1, 0), [1, 0, 2, 3]);
        assert_eq!(wanted(1, 1), [3, 2, 0, 1]);
        let own: Vec<usize> = Ticket { round: 1, count: 4, taken: 0 }.wanted(1, 2, Whose::Own).collect();
        assert_eq!(own, [3, 2]);
        // More threads than items: one each.
        let first = |thread: usize| Ticket { round: 0, count: 3, taken: 0 }.wanted(thread, 9, Whose::Own).next();
        assert_eq!([0, 1, 2, 5].map(first), [Some(0), Some(1), Some(2), Some(2)]);
    }

    #[test]
    fn many_rounds_lose_nothing_with_sleep_in_between_too() {
        let threads = Threads::new(3);
        let sum = AtomicUsize::new(0);
        for round in 0..20_000 {
            threads.for_each(vec![1, 2, 3, 4], |item| {
                sum.fetch_add(item, Ordering::Relaxed);
            });
            if round % 4000 == 0 {
                thread::sleep(4 * AWAKE);
            }
        }
        assert_eq!(sum.into_inner(), 200_000);
    }

    #[test]
    fn threads_beyond_the_number_of_items_sleep_while_the_others_work() {
        let threads = Threads::new(9);
        let asleep =
            || threads.pool.as_ref().unwrap().desk.asleep[1..].iter().all(|asleep| asleep.load(Ordering::SeqCst));
        threads.map(9, |item| item);
        let started = Instant::now();
        let mut seen = 0;
        // Rounds come much faster than who waits awake would fall asleep.
        while seen < 1000 {
            threads.map(2, |item| item);
            seen = if asleep() { seen + 1 } else { 0 };
            assert!(started.elapsed() < Duration::from_secs(20), "threads without work stay awake");
        }
        assert_eq!(threads.map(40, |item| item).len(), 40);
    }

    #[test]
    fn several_work_at_the_same_time() {
        let threads = Threads::new(2);
        let here = AtomicUsize::new(0);
        // Each of the two waits for the other: one thread alone would never come to an end.
        threads.for_each(vec![(), ()], |()| {
            here.fetch_add(1, Ordering::SeqCst);
            assert!(wait_awake(|| here.load(Ordering::SeqCst) == 2, Some(Duration::from_secs(20))));
        });
    }

    #[test]
    fn what_a_thread_does_not_come_to_another_one_takes() {
        let (threads, caller) = (Threads::new(2), thread::current().id());
        let happens = |flag: &AtomicBool| wait_awake(|| flag.load(Ordering::SeqCst), Some(Duration::from_secs(20)));
        for round in 0..20 {
            let begun = AtomicBool::new(false);
            let done: Vec<AtomicBool> = (0..4).map(|_| AtomicBool::new(false)).collect();
            threads.map(4, |item| {
                if thread::current().id() == caller {
                    assert!(happens(&begun), "round {round}: the worker takes no part");
                } else {
                    // Held up in one item of its part until the other one is done, which then only the caller can do.
                    begun.store(true, Ordering::SeqCst);
                    assert!(happens(&done[[1, 0, 3, 2][item]]), "round {round}: nobody does the other item");
                }
                done[item].store(true, Ordering::SeqCst);
            });
        }
    }

    #[test]
    fn work_may_hand_out_work_and_callers_may_be_several() {
        let threads = Threads::new(2);
        let inner = |item: usize| threads.map(3, |other| item + other).into_iter().sum::<usize>();
        assert_eq!(threads.map(4, inner), [3, 6, 9, 12]);
        thread::scope(|scope| {
            let callers: Vec<_> = (0..4).map(|_| scope.spawn(|| threads.map(50, |item| item).len())).collect();
            assert!(callers.into_iter().all(|caller| caller.join().unwrap() == 50));
        });
    }

    #[test]
    fn a_panic_comes_out_and_leaves_the_threads_fit() {
        let threads = Threads::new(3);
        for _ in 0..50 {
            let outcome = catch_unwind(AssertUnwindSafe(|| {
                threads.map(6, |item| assert!(item != 4, "item {item}"));
            }));
            let said = outcome.unwrap_err();
            assert!(said.downcast_ref::<String>().unwrap().starts_with("item 4"));
            assert_eq!(threads.map(3, |item| item), [0, 1, 2]);
        }
    }
}
