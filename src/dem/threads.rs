//! Threads for the chunks' work; what they compute never depends on how many there are.

use rayon::prelude::*;

/// A fixed number of threads.
#[derive(Debug)]
pub struct Threads {
    pool: Option<rayon::ThreadPool>,
}

impl Threads {
    /// `count` threads; one means the caller's own.
    ///
    /// # Panics
    /// When the system refuses to start threads.
    #[must_use]
    pub fn new(count: usize) -> Self {
        let build = || rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("the system starts threads");
        Self { pool: (count > 1).then(build) }
    }

    /// `work(0)`, `work(1)`, ... `work(count - 1)`, in the order of the numbers.
    pub fn map<R: Send>(&self, count: usize, work: impl Fn(usize) -> R + Sync) -> Vec<R> {
        match &self.pool {
            Some(pool) if count > 1 => pool.install(|| (0..count).into_par_iter().with_max_len(1).map(&work).collect()),
            _ => (0..count).map(work).collect(),
        }
    }

    /// `work` on every item.
    pub fn for_each<T: Send>(&self, items: Vec<T>, work: impl Fn(T) + Sync) {
        match &self.pool {
            Some(pool) if items.len() > 1 => pool.install(|| items.into_par_iter().with_max_len(1).for_each(&work)),
            _ => items.into_iter().for_each(work),
        }
    }
}
