//! Numbers that look drawn, and are the same for ever.

/// A small generator (Knuth's MMIX constants).
pub struct Draw(pub u64);

impl Draw {
    /// The next 64 bits; the upper ones are the better ones.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0
    }
}
