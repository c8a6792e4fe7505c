//! What the scene's feeds bring to a LIGGGHTS case, batch by batch: the draws of our own solver, made in advance.
//!
//! A fill or file enters at the batch at or after its start. A particle of a stream that is due between two batches enters at the
//! later one, moved on in free fall. What depends on how particles move in between cannot be told in advance and is refused.

use super::Schedule;
use crate::backend::BackendError;
use crate::backend::native::feeds::{Fed, FeedsInAdvance};
use crate::dem::feed::{FeedKind, FeedReport};
use crate::particle::ParticleState;
use crate::scene::Scene;

/// The feeds of a scene, asked batch by batch.
#[derive(Debug)]
pub struct BatchFeeds<'a> {
    scene: &'a Scene,
    schedule: Schedule,
    feeds: FeedsInAdvance,
    /// The next time step to be asked for.
    next: u64,
    /// Whether anything has been brought at an earlier time step.
    has_brought: bool,
    /// Fills that have not begun, as indices of feeds.
    fills: Vec<usize>,
}

impl<'a> BatchFeeds<'a> {
    /// The feeds before the first batch.
    #[must_use]
    pub fn new(scene: &'a Scene, schedule: Schedule) -> Self {
        let is_fill = |index: &usize| matches!(scene.feeds[*index].kind, FeedKind::Fill { .. });
        Self {
            scene,
            schedule,
            feeds: FeedsInAdvance::new(scene, schedule.timestep),
            next: 0,
            has_brought: false,
            fills: (0..scene.feeds.len()).filter(is_fill).collect(),
        }
    }

    /// What enters at the batch at time step `step`; `occupied` where particles have come from elsewhere, too.
    ///
    /// # Errors
    /// When that cannot be told in advance.
    pub fn batch(&mut self, step: u64, occupied: bool) -> Result<Vec<ParticleState>, BackendError> {
        let mut entering = Vec::new();
        while self.next <= step {
            if self.feeds.is_finished() {
                self.next = step + 1;
                break;
            }
            let (at, fed) = (self.next, self.feeds.advance());
            self.next += 1;
            self.look_at_fills(at)?;
            if let Some(late) = fed.iter().find(|fed| !fed.falls)
                && (self.has_brought || occupied)
            {
                return Err(self.crowded(late));
            }
            self.has_brought |= !fed.is_empty();
            let later = (step - at) as f64 * self.schedule.timestep;
            for Fed { state, falls } in fed {
                entering.push(if falls && later > 0.0 { self.moved_on(&state, later)? } else { state });
            }
        }
        Ok(entering)
    }

    fn moved_on(&mut self, state: &ParticleState, later: f64) -> Result<ParticleState, BackendError> {
        let moved = self.feeds.fallen(state, later);
        let every = self.schedule.cadence.hand_over;
        let part = self.feeds.touches(&moved.position, moved.radius).map(str::to_owned);
        match part {
            None => Ok(moved),
            Some(part) => Err(BackendError::Incapable(format!(
                "feed '{}': particle {} is due {:.3} ms before LIGGGHTS' next batch and would touch part '{part}' by then; set \
                 liggghts.batch_every lower than {every}, or move the feed's face away from the part",
                self.name(moved.id.feed() as usize),
                moved.id.serial(),
                1e3 * later
            ))),
        }
    }

    /// A fill that begins now and has to be repeated brings what depends on the particles' motion.
    fn look_at_fills(&mut self, step: u64) -> Result<(), BackendError> {
        let time = self.schedule.time(step);
        let end = self.schedule.time(self.schedule.steps);
        let (scene, feeds) = (self.scene, &self.feeds);
        let mut repeated = None;
        self.fills.retain(|&index| {
            let FeedKind::Fill { start, interval, until, .. } = scene.feeds[index].kind else { return false };
            if time < start {
                return true;
            }
            if start + interval <= until.min(end) && feeds.reports()[index].shortfall.is_some() {
                repeated = Some(index);
            }
            false
        });
        repeated.map_or(Ok(()), |index| {
            Err(BackendError::Incapable(format!(
                "feed '{}' does not bring its amount at once, and what it brings later depends on how the region empties, which \
                 LIGGGHTS does not tell in advance; enlarge its region, lower its amount, or compute this stage with the native \
                 solver",
                self.name(index)
            )))
        })
    }

    fn crowded(&self, late: &Fed) -> BackendError {
        BackendError::Incapable(format!(
            "feed '{}' fills its region after other particles have entered, and nobody can tell in advance where these are by \
             then; let it begin at time 0, take a stream through a face instead, or compute this stage with the native solver",
            self.name(late.state.id.feed() as usize)
        ))
    }

    fn name(&self, feed: usize) -> &str {
        self.scene.feeds.get(feed).map_or("", |feed| feed.name.as_str())
    }

    /// Asked against brought up to the last batch, for each feed in the scene's order.
    #[must_use]
    pub fn reports(&self) -> Vec<FeedReport> {
        self.feeds.reports()
    }

    /// True once nothing more will come.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.feeds.is_finished()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::native::processor::Processor;
    use crate::backend::native::setup::setup;
    use crate::dem::simulation::Simulation;
    use crate::gate::Cadence;
    use crate::plan::plan;
    use crate::scene::read_text;
    use std::path::Path;

    /// A barrel with a floor; feeds follow.
    const HEAD: &str = r#"
version = 1
seed = 4
[domain]
min_mm = [-100, -100, -10]
max_mm = [100, 100, 400]
[contact]
law = "hertz-mindlin"
[material.glass]
density = "2500 kg/m3"
youngs_modulus = "1 MPa"
poissons_ratio = 0.25
[material.wall]
youngs_modulus = "rigid"
[[pair]]
between = ["glass", "glass"]
restitution = 0.5
friction = 0.5
[[pair]]
between = ["glass", "wall"]
restitution = 0.5
friction = 0.4
[particle.bead]
material = "glass"
diameter = { uniform_mm = [3, 6] }
[[part]]
name = "floor"
material = "wall"
shape = "plane"
point_mm = [0, 0, 0]
normal = [0, 0, 1]
[[part]]
name = "bar"
material = "wall"
shape = "box"
min_mm = [-5, -60, 60]
max_mm = [5, 60, 66]
[solver]
overlap_limit = 0.9
timestep = "4e-5 s"
[end]
time = "0.2 s"
"#;
    const FILL: &str = "[[feed]]\nname = \"fill\"\nkind = \"fill\"\nparticle = \"bead\"\n\
                        region = { shape = \"box\", min_mm = [-40, -40, 70], max_mm = [40, 40, 110] }\namount = 400\n";
    const STREAM: &str = "[[feed]]\nname = \"spout\"\nkind = \"stream\"\nparticle = \"bead\"\n\
                          face = { shape = \"disc\", centre_mm = [0, 0, 300], normal = [0, 0, -1], radius = \"15 mm\" }\n\
                          rate = \"2000 1/s\"\nvelocity_m_per_s = [0, 0, -0.4]\n";

    fn scene(feeds: &str) -> Scene {
        let text = format!("{HEAD}{feeds}");
        read_text(&text, "feeds.toml", Path::new("."), &[]).unwrap_or_else(|found| panic!("{found:?}")).0
    }

    fn schedule(hand_over: u64) -> Schedule {
        Schedule { timestep: 4e-5, cadence: Cadence { look: hand_over, hand_over }, steps: 2000 }
    }

    fn native(scene: &Scene) -> Simulation {
        Simulation::new(setup(scene, &plan(scene, None), Processor::new(Some(1), None)))
    }

    fn by_id(mut states: Vec<ParticleState>) -> Vec<ParticleState> {
        states.sort_by_key(|state| state.id);
        states
    }

    #[test]
    fn a_fill_at_time_0_is_that_of_our_own_solver_around_the_parts() {
        let scene = scene(FILL);
        let mut simulation = native(&scene);
        simulation.prepare();
        let mut feeds = BatchFeeds::new(&scene, schedule(100));
        let found = feeds.batch(0, false).unwrap();
        assert_eq!(by_id(found), by_id(simulation.particles()));
        assert_eq!(feeds.reports(), simulation.feed_reports());
        assert!(feeds.reports()[0].inserted_count > 300 && feeds.is_finished());
        assert_eq!(feeds.batch(100, false).unwrap(), []);
    }

    /// The way to the floor takes 0.2 s: so long all that the stream has brought falls freely in the solver, too. The face is too
    /// small for the rate, so that particles wait for others to make way.
    #[test]
    fn a_stream_is_that_of_our_own_solver_moved_on_to_the_batch() {
        let scene = scene(&STREAM.replace("300]", "390]").replace("2000", "6000"));
        let mut simulation = native(&scene);
        simulation.prepare();
        let mut feeds = BatchFeeds::new(&scene, schedule(25));
        let mut known = Vec::new();
        for batch in 0..=80 {
            // What is due at the batch itself enters the solver with the next time step.
            while simulation.steps_done() <= 25 * batch {
                simulation.step().unwrap();
            }
            let there = simulation.particles();
            let new = by_id(there.into_iter().filter(|state| !known.contains(&state.id)).collect());
            let found = by_id(feeds.batch(25 * batch, false).unwrap());
            assert_eq!(new.len(), found.len(), "batch {batch}");
            for (one, other) in new.iter().zip(&found) {
                assert_eq!((one.id, one.radius, one.density), (other.id, other.radius, other.density));
                // Round-off of up to 26 additions below 1 m.
                let next = feeds.feeds.fallen(other, 4e-5);
                assert!((one.position - next.position).norm() < 1e-14, "{one:?} {next:?}");
                assert!((one.velocity - next.velocity).norm() < 1e-14, "{one:?} {next:?}");
            }
            known.extend(found.iter().map(|state| state.id));
        }
        assert!((100..400).contains(&known.len()), "of 481 that were due {} came", known.len());
        assert_eq!(feeds.reports(), simulation.feed_reports());
    }

    fn refusal(feeds: &str, hand_over: u64) -> String {
        let scene = scene(feeds);
        let mut feeds = BatchFeeds::new(&scene, schedule(hand_over));
        let refused = (0..20).find_map(|batch| feeds.batch(hand_over * batch, false).err());
        let Some(BackendError::Incapable(text)) = refused else { panic!("{refused:?}") };
        text
    }

    #[test]
    fn what_depends_on_the_particles_motion_is_refused_with_advice() {
        let repeated = FILL.replace("amount = 400", "amount = 4000\ninterval = \"20 ms\"");
        let text = refusal(&repeated, 100);
        assert!(
            text.contains("feed 'fill' does not bring its amount at once") && text.contains("native solver"),
            "{text}"
        );
        let late = format!("{STREAM}{}", FILL.replace("amount", "start = \"10 ms\"\namount"));
        let text = refusal(&late, 100);
        assert!(text.contains("feed 'fill' fills its region after other particles"), "{text}");
        // Right above the bar, 10 mm less one radius: 25 ms at 0.4 m/s and more.
        let near = STREAM.replace("300]", "72]").replace("15 mm", "4 mm").replace("2000", "20");
        let text = refusal(&near, 1000);
        assert!(text.contains("would touch part 'bar'") && text.contains("lower than 1000"), "{text}");
    }

    #[test]
    fn a_late_fill_into_an_empty_scene_enters_at_the_next_batch() {
        let scene = scene(&FILL.replace("amount", "start = \"10 ms\"\namount"));
        let mut feeds = BatchFeeds::new(&scene, schedule(100));
        // 10 ms are 250 time steps.
        let counts: Vec<usize> = (0..5).map(|batch| feeds.batch(100 * batch, false).unwrap().len()).collect();
        assert!(counts[3] > 300, "{counts:?}");
        assert_eq!([counts[0], counts[1], counts[2], counts[4]], [0; 4]);
    }
}
