//! How much of the processor a run takes. Nothing of it changes a bit of the result.

use crate::math::lanes::SimdLevel;
use std::collections::BTreeSet;
use std::fs;

/// Threads and instruction set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Processor {
    /// Threads.
    pub threads: usize,
    /// Instruction set of the contact kernels.
    pub simd: SimdLevel,
}

impl Processor {
    /// As asked for; else one thread a physical core, and the fastest instruction set that is there.
    #[must_use]
    pub fn new(threads: Option<usize>, simd: Option<SimdLevel>) -> Self {
        Self { threads: threads.unwrap_or_else(physical_cores), simd: simd.unwrap_or_else(SimdLevel::best) }
    }
}

/// Physical cores that this process may run on; logical ones where the system does not tell. The second thread of a core shares
/// its arithmetic units, which the kernels fill alone.
#[must_use]
pub fn physical_cores() -> usize {
    let logical = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let allowed = rustix::thread::sched_getaffinity(None).ok();
    let Some(allowed) = allowed else { return logical };
    let topology =
        |cpu: usize, name: &str| fs::read_to_string(format!("/sys/devices/system/cpu/cpu{cpu}/topology/{name}")).ok();
    let mut cores = BTreeSet::new();
    for cpu in (0..rustix::thread::CpuSet::MAX_CPU).filter(|&cpu| allowed.is_set(cpu)) {
        let (Some(package), Some(core)) = (topology(cpu, "physical_package_id"), topology(cpu, "core_id")) else {
            return logical;
        };
        cores.insert((package, core));
    }
    // A quota of processor time may allow less.
    cores.len().clamp(1, logical)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn physical_cores_are_no_more_than_logical_ones() {
        let logical = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        assert!((1..=logical).contains(&physical_cores()));
    }
}
