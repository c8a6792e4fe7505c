//! What must hold between keys: one rule a file. Each has its identifier, its severity and its reason in `docs/rules.md`.

mod at_rest_never;
mod characteristic_velocity;
mod density_missing;
mod domain_empty;
mod duplicate_name;
mod elasticity_missing;
mod feed_crowded;
mod feed_in_geometry;
mod feed_outside_domain;
mod feed_too_small;
mod feed_window;
mod gap_too_narrow;
mod interval_below_timestep;
mod measure_outside_domain;
mod no_feed;
mod overlap;
mod pair_missing;
mod pair_twice;
mod periodic_extent;
mod periodic_part;
mod plane_problem;
mod region_surface;
mod rigid_pair;
mod sieve;
mod size_cut;
mod size_order;
mod stiffness_law;
mod stl_surface;
mod stl_too_large;
mod stream_standing;
mod trigger_order;
mod unused;

use super::Domain;
use super::diagnostics::Report;
use super::extent;
use super::reader::join;
use super::resolve::{Draft, Located, PartDraft};
use crate::dem::feed::{Feed, FeedKind};
use crate::geometry::inspection::MeshReport;
use crate::geometry::part::{Surface, Trigger};
use crate::particle::ParticleClass;

/// What a rule looks at.
pub(super) struct Subject<'a> {
    /// The scene so far.
    pub draft: &'a Draft,
    /// Its domain.
    pub domain: Domain,
    /// Largest diameter of any particle [m]; 0 where none is known.
    pub largest: f64,
    /// For each part, what an inspection of its STL mesh says.
    pub inspections: Vec<Option<MeshReport>>,
    /// Where findings go.
    pub report: &'a Report,
}

type Rule = fn(&Subject<'_>);

const RULES: &[Rule] = &[
    at_rest_never::check,
    characteristic_velocity::check,
    density_missing::check,
    domain_empty::check,
    duplicate_name::check,
    elasticity_missing::check,
    feed_in_geometry::check,
    feed_outside_domain::check,
    feed_too_small::check,
    feed_window::check,
    gap_too_narrow::check,
    interval_below_timestep::check,
    measure_outside_domain::check,
    no_feed::check,
    pair_missing::check,
    pair_twice::check,
    periodic_extent::check,
    periodic_part::check,
    plane_problem::check,
    region_surface::check,
    rigid_pair::check,
    sieve::check,
    size_cut::check,
    size_order::check,
    stiffness_law::check,
    stl_surface::check,
    stl_too_large::check,
    stream_standing::check,
    trigger_order::check,
    // These two are last: they need a scene without errors.
    unused::check,
    feed_crowded::check,
];

/// Checks every rule.
pub(super) fn check(draft: &Draft, domain: Domain, report: &Report) {
    let inspections = draft
        .parts
        .iter()
        .map(|part| match (&part.item.file, &part.item.part.surface) {
            (Some(_), Surface::Mesh(mesh)) => Some(mesh.inspect()),
            _ => None,
        })
        .collect();
    let subject =
        Subject { draft, domain, largest: extent::largest_diameter(&draft.classes, &draft.feeds), inspections, report };
    for rule in RULES {
        rule(&subject);
    }
}

impl Subject<'_> {
    /// The class that a feed draws from.
    fn class(&self, index: usize) -> Option<&ParticleClass> {
        self.draft.classes.get(index)?.item.as_ref()
    }

    /// Smallest and largest diameter that a feed brings in [m].
    fn diameters(&self, feed: &Feed) -> Option<(f64, f64)> {
        match &feed.kind {
            FeedKind::Fill { class, .. } | FeedKind::Stream { class, .. } => {
                Some(extent::diameter_range(&self.class(*class)?.diameter))
            }
            FeedKind::File { particles } => {
                let sizes = particles.iter().map(|particle| 2.0 * particle.radius);
                let range = sizes.fold((f64::INFINITY, 0.0_f64), |(low, high), d| (low.min(d), high.max(d)));
                (range.1 > 0.0).then_some(range)
            }
        }
    }

    /// Name of a material.
    fn material(&self, index: u16) -> &str {
        self.draft.materials.get(usize::from(index)).map_or("?", |material| &material.name)
    }

    fn error(&self, rule: &'static str, path: &str, what: String, next: impl Into<String>) {
        self.report.error(rule, &self.report.place(path), what, next);
    }

    fn warning(&self, rule: &'static str, path: &str, what: String, next: impl Into<String>) {
        self.report.warning(rule, &self.report.place(path), what, next);
    }

    /// Materials of all particles, each once, ascending.
    fn particle_materials(&self) -> Vec<u16> {
        let mut found: Vec<u16> =
            self.draft.classes.iter().filter_map(|class| class.item.as_ref()).map(|class| class.material).collect();
        for feed in &self.draft.feeds {
            if let FeedKind::File { particles } = &feed.item.kind {
                found.extend(particles.iter().map(|particle| particle.material));
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Parts that are there at plant time `time` [s], whatever waits for a condition left out.
    fn parts_at(&self, time: f64) -> impl Iterator<Item = &Located<PartDraft>> {
        self.draft.parts.iter().filter(move |part| {
            let part = &part.item.part;
            let begun = match part.appears {
                Trigger::Always => true,
                Trigger::At { time: begin } => begin <= time,
                Trigger::Never | Trigger::AtRest(_) => false,
            };
            let ended = match part.disappears {
                Trigger::Always => true,
                Trigger::At { time: end } => end <= time,
                Trigger::Never | Trigger::AtRest(_) => false,
            };
            begun && !ended
        })
    }
}

/// Millimetres for messages: four digits are enough to recognise a figure.
fn mm(length: f64) -> String {
    format!("{} mm", round(1e3 * length))
}

/// `value` with four digits, without zeros at the end.
fn round(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let digits = (3 - value.abs().log10().floor() as i64).clamp(0, 12);
    let text = format!("{value:.*}", digits as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::{mm, round};

    #[test]
    fn figures_have_four_digits() {
        assert_eq!(mm(0.0042), "4.2 mm");
        assert_eq!(round(1234.56), "1235");
        assert_eq!(round(0.123_456), "0.1235");
        assert_eq!(round(120_000.0), "120000");
        assert_eq!(round(0.0), "0");
    }
}
