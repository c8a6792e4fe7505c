//! How worn the neighbour lists are, and how wide the inner ones are made.

use super::neighborhood::ListSettings;
use serde::{Deserialize, Serialize};

/// Share of the skin that the first inner list keeps, when nothing is known of the motion yet.
const FIRST_SHARE: f64 = 0.2;
/// Largest share that one keeps, so that the outer list outlives several of them, and the smallest.
const WIDEST_SHARE: f64 = 0.3;
const NARROWEST_SHARE: f64 = 1e-3;
/// What it costs to look at a pair of the outer list when the inner one is made, where a pair that is apart costs 1 in every time step:
/// of 1.3, 3 and 6, 3 was the fastest in a settled bed and in one of sizes 1:10, by 1 or 2 %.
const LOOK_AT_PAIR: f64 = 3.0;
/// Time steps between two looks whether the inner list is much wider than it should be: enough for the mean way of a step.
const LOOK: u64 = 16;
/// How many times wider that is. At twice the skin that fits, pairs that are apart and looks together cost a quarter more.
const MUCH_WIDER: f64 = 2.0;
/// Share of a skin used up at which a list is renewed rather than measured again.
pub(super) const RENEW_SHARE: f64 = 0.5;

/// How far anybody may have moved since the lists were made.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Wear {
    /// Upper bound on how far any particle is from where it was when the outer list was made [m].
    pub since_outer: f64,
    /// The same of the inner list [m].
    pub since_inner: f64,
    /// Upper bound on the approach of particles and parts since their candidates were collected [m].
    pub towards_parts: f64,
    /// Time steps since the inner list was made.
    steps_since_inner: u64,
    /// Pairs of the outer list that were looked at then, and those of the inner one that were apart.
    looked_at: usize,
    apart: usize,
    /// Skin of the inner list [m].
    pub inner_skin: f64,
}

impl Wear {
    /// Of lists that are not made yet.
    pub const fn new(settings: &ListSettings) -> Self {
        let inner_skin = FIRST_SHARE * settings.skin;
        Self {
            since_outer: 0.0,
            since_inner: 0.0,
            towards_parts: 0.0,
            steps_since_inner: 0,
            looked_at: 0,
            apart: 0,
            inner_skin,
        }
    }

    /// Books a motion: no particle moved farther than `particles` [m], no part's surface farther than `parts` [m].
    pub fn note_motion(&mut self, particles: f64, parts: f64) {
        self.since_outer += particles;
        self.since_inner += particles;
        self.towards_parts += particles + parts;
    }

    /// Books a time step.
    pub const fn note_step(&mut self) {
        self.steps_since_inner += 1;
    }

    /// Says that the inner list has been made of `looked_at` pairs; `apart` of those that it holds are.
    pub const fn note_inner(&mut self, looked_at: usize, apart: usize) {
        (self.since_inner, self.steps_since_inner) = (0.0, 0);
        (self.looked_at, self.apart) = (looked_at, apart);
    }

    /// The inner skin s [m] that fits the motion since the inner list was made: s = sqrt(2 v c n / k).
    ///
    /// v is how far particles move in a time step [m]. The n pairs of the outer list are looked at once in the s / (2 v) time steps
    /// that an inner list lives, at a cost of c n; the k s pairs of the inner list that are apart cost 1 each in every time step, where
    /// k [1/m] is what the last list had of them per skin. The sum is least where both cost the same.
    pub fn fitting_inner_skin(&self, skin: f64) -> f64 {
        if self.steps_since_inner == 0 {
            return self.inner_skin;
        }
        let speed = self.since_inner / self.steps_since_inner as f64;
        let cost = LOOK_AT_PAIR * self.looked_at as f64;
        let fitting = (2.0 * speed * cost * self.inner_skin / self.apart as f64).sqrt();
        // Not a number where nobody moves and nobody is apart: any skin fits.
        fitting.min(WIDEST_SHARE * skin).max(NARROWEST_SHARE * skin)
    }

    /// Whether the inner list holds many more pairs than it needs.
    pub fn inner_is_wide(&self, skin: f64) -> bool {
        self.steps_since_inner > 0
            && self.steps_since_inner.is_multiple_of(LOOK)
            && self.inner_skin > MUCH_WIDER * self.fitting_inner_skin(skin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SKIN: f64 = 1e-3;

    fn settings() -> ListSettings {
        let domain = crate::math::Bounds { minimum: [0.0; 3], maximum: [1.0; 3] };
        ListSettings { skin: SKIN, domain, periodic: [false; 3], remembers: true, remembers_rolling: false }
    }

    /// Lists of so many pairs, after `steps` time steps in each of which particles moved by `way` [m].
    fn worn(looked_at: usize, apart: usize, way: f64, steps: u64) -> Wear {
        let mut wear = Wear::new(&settings());
        wear.note_inner(looked_at, apart);
        for _ in 0..steps {
            wear.note_motion(way, 0.0);
            wear.note_step();
        }
        wear
    }

    #[test]
    fn the_skin_that_fits_costs_least() {
        let (looked_at, apart, way) = (100_000, 20_000, 1e-7);
        let fitting = worn(looked_at, apart, way, 50).fitting_inner_skin(SKIN);
        let per_skin = apart as f64 / (FIRST_SHARE * SKIN);
        let cost = |skin: f64| LOOK_AT_PAIR * looked_at as f64 * 2.0 * way / skin + per_skin * skin;
        assert!(cost(fitting) < cost(0.99 * fitting) && cost(fitting) < cost(1.01 * fitting), "{fitting}");
        // A list twice as wide holds twice the pairs that are apart.
        let wider = Wear { inner_skin: 2.0 * FIRST_SHARE * SKIN, ..worn(looked_at, 2 * apart, way, 50) };
        assert!((wider.fitting_inner_skin(SKIN) / fitting - 1.0).abs() < 1e-12, "the skin that was had an effect");
    }

    #[test]
    fn where_nothing_is_known_or_nobody_moves_it_stays_within_bounds() {
        let first = FIRST_SHARE * SKIN;
        assert_eq!(worn(100, 10, 0.0, 0).fitting_inner_skin(SKIN), first, "nothing is known yet");
        assert_eq!(worn(100, 10, 0.0, 50).fitting_inner_skin(SKIN), NARROWEST_SHARE * SKIN, "nobody moves");
        for (looked_at, apart, way) in [(100, 0, 1e-7), (100, 0, 0.0), (0, 0, 0.0), (100, 10, 1e-3)] {
            let fitting = worn(looked_at, apart, way, 50).fitting_inner_skin(SKIN);
            assert_eq!(fitting, WIDEST_SHARE * SKIN, "{looked_at} {apart} {way}");
        }
    }

    #[test]
    fn a_list_much_wider_than_it_should_be_is_noticed_at_a_look() {
        let wide: Vec<u64> = (0..50).filter(|&steps| worn(100, 100, 1e-9, steps).inner_is_wide(SKIN)).collect();
        assert_eq!(wide, [16, 32, 48]);
        assert!(!worn(100, 100, 1e-4, 16).inner_is_wide(SKIN), "they move so fast that it is none too wide");
    }
}
