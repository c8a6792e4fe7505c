//! Wall time by phase of the time step.

use std::time::Duration;

/// Wall time spent in each phase since the start.
#[derive(Debug, Clone, Copy, Default)]
pub struct PhaseTimes {
    /// Feeds.
    pub feeds: Duration,
    /// Cells, pair lists, candidates of parts.
    pub neighborhood: Duration,
    /// Contacts between particles and with parts.
    pub contacts: Duration,
    /// Motion.
    pub integration: Duration,
    /// Watchdog.
    pub watchdog: Duration,
}

impl PhaseTimes {
    /// All phases together.
    #[must_use]
    pub fn total(&self) -> Duration {
        self.feeds + self.neighborhood + self.contacts + self.integration + self.watchdog
    }
}
