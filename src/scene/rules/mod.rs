//! What must hold between keys: one rule a file. Each has its identifier, its severity and its reason in `docs/rules.md`.

mod at_rest_never;
mod characteristic_velocity;
mod checkpoint_stages;
mod density_missing;
mod domain_empty;
mod duplicate_name;
mod elasticity_missing;
mod feed_crowded;
mod feed_in_geometry;
mod feed_outside_domain;
mod feed_stages;
mod feed_too_small;
mod feed_window;
mod gap_too_narrow;
mod gate_aperture;
mod gate_gravity;
mod gate_outside_domain;
mod gate_periodic;
mod gate_recorder;
mod gate_unused;
mod ghost_zone;
mod interval_below_timestep;
mod liggghts_cadence;
mod measure_outside_domain;
mod measure_upstream;
mod no_feed;
mod overlap;
mod pair_missing;
mod pair_twice;
mod path_storage;
mod periodic_extent;
mod periodic_part;
mod plane_problem;
mod region_surface;
mod replay_loops;
mod replay_window;
mod rigid_pair;
mod sieve;
mod size_cut;
mod size_order;
mod sleeping_gravity;
mod stage_cycle;
mod stage_empty;
mod stage_missing;
mod stiffness_law;
mod stl_surface;
mod stl_too_large;
mod stream_standing;
mod stream_turned;
mod trigger_order;
mod unused;
mod zone_length;

use super::Domain;
use super::diagnostics::Report;
use super::extent;
use super::gate::StreamSource;
use super::layout::Layout;
use super::meshes::Meshes;
use super::reader::join;
use super::resolve::{Draft, Located, PartDraft};
use super::tree::Table;
use crate::dem::feed::{Feed, FeedKind};
use crate::geometry::inspection::MeshReport;
use crate::geometry::part::{Surface, Trigger};
use crate::particle::ParticleClass;
use std::sync::Arc;

/// What a rule looks at.
pub(super) struct Subject<'a> {
    /// The scene so far.
    pub draft: &'a Draft,
    /// Its domain.
    pub domain: Domain,
    /// Largest diameter of any particle [m]; 0 where none is known.
    pub largest: f64,
    /// Stages and gates, with what lies around them.
    pub layout: Layout<'a>,
    /// For each part, what an inspection of its STL mesh says.
    pub inspections: Vec<Option<Arc<MeshReport>>>,
    /// The scene as written.
    pub written: &'a Table,
    /// Where findings go.
    pub report: &'a Report<'a>,
}

type Rule = fn(&Subject<'_>);

const RULES: &[Rule] = &[
    at_rest_never::check,
    characteristic_velocity::check,
    checkpoint_stages::check,
    density_missing::check,
    domain_empty::check,
    duplicate_name::check,
    elasticity_missing::check,
    feed_in_geometry::check,
    feed_outside_domain::check,
    feed_stages::check,
    feed_too_small::check,
    feed_window::check,
    gap_too_narrow::check,
    gate_aperture::check,
    gate_gravity::check,
    gate_outside_domain::check,
    gate_periodic::check,
    gate_recorder::check,
    gate_unused::check,
    ghost_zone::check,
    interval_below_timestep::check,
    liggghts_cadence::check,
    measure_outside_domain::check,
    measure_upstream::check,
    no_feed::check,
    pair_missing::check,
    pair_twice::check,
    path_storage::check,
    periodic_extent::check,
    periodic_part::check,
    plane_problem::check,
    region_surface::check,
    replay_loops::check,
    replay_window::check,
    rigid_pair::check,
    sieve::check,
    size_cut::check,
    size_order::check,
    sleeping_gravity::check,
    stage_cycle::check,
    stage_empty::check,
    stage_missing::check,
    stiffness_law::check,
    stl_surface::check,
    stl_too_large::check,
    stream_standing::check,
    stream_turned::check,
    trigger_order::check,
    zone_length::check,
    // These two are last: they need a scene without errors.
    unused::check,
    feed_crowded::check,
];

/// Checks every rule on a scene that was `written` so.
pub(super) fn check(written: &Table, draft: &Draft, domain: Domain, meshes: &Meshes, report: &Report<'_>) {
    let inspection = |(number, part): (usize, &Located<PartDraft>)| match (&part.item.file, &part.item.part.surface) {
        (Some(_), Surface::Mesh(mesh)) => Some(meshes.inspection(number, mesh)),
        _ => None,
    };
    let inspections = draft.parts.iter().enumerate().map(inspection).collect();
    let largest = extent::largest_diameter(&draft.classes, &draft.feeds);
    let subject = Subject { draft, domain, largest, layout: layout(draft, largest), inspections, written, report };
    for rule in RULES {
        rule(&subject);
    }
}

/// Who belongs where, as far as the scene has been resolved.
fn layout(draft: &Draft, largest: f64) -> Layout<'_> {
    let stages = &draft.stages.stages;
    let ends = stages.iter().filter_map(|stage| stage.item.end).chain(draft.end).map(|end| end.time);
    Layout {
        gates: draft.gates.iter().map(|gate| &gate.item).collect(),
        stages: stages.iter().map(|stage| &stage.item).collect(),
        parts: draft.parts.iter().map(|part| &part.item.part).collect(),
        feeds: draft.feeds.iter().map(|feed| &feed.item).collect(),
        largest,
        end: ends.fold(0.0, f64::max),
    }
}

impl Subject<'_> {
    /// True where a stored stream brings particles.
    fn has_stored_stream(&self) -> bool {
        let mut replays = self.draft.stages.stages.iter().flat_map(|stage| &stage.item.replays);
        replays.any(|replay| matches!(replay.source, StreamSource::Folder(_)))
    }

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
        self.report.error(rule, &self.written.place_of_path(path), what, next);
    }

    fn warning(&self, rule: &'static str, path: &str, what: String, next: impl Into<String>) {
        self.report.warning(rule, &self.written.place_of_path(path), what, next);
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
