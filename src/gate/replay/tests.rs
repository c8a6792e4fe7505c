mod cadence;

use super::*;
use crate::gate::crossing::{ContactPartner, Passage};
use crate::gate::{Cadence, HAND_OVER_STEPS};
use crate::geometry::plane::Aperture;
use crate::math::vec3;
use crate::scene::gate::{BackingUp, Clock, Fate, StreamSource, Timing};
use approx::assert_relative_eq;
use std::cell::Cell;
use std::rc::Rc;

const GRAVITY: Vec3 = vec3(0.0, 0.0, -9.81);
const DT: f64 = 1e-3;
const RADIUS: f64 = 0.01;
const LENGTH: f64 = 0.03;

#[derive(Debug)]
struct Chunks {
    chunks: Vec<Vec<Crossing>>,
    reads: Rc<Cell<usize>>,
}

impl CrossingSource for Chunks {
    fn chunk_count(&self) -> usize {
        self.chunks.len()
    }
    fn chunk(&mut self, index: usize) -> Result<Vec<Crossing>, StorageError> {
        self.reads.set(self.reads.get() + 1);
        Ok(self.chunks[index].clone())
    }
}

/// Where particle `serial` is at `time` [s]: in free fall through z = 0 at its own passage time with `speed` [m/s].
fn falling(passage: f64, speed: f64, time: f64) -> Motion {
    let late = time - passage;
    Motion {
        position: vec3(0.1, 0.0, 0.0) + vec3(0.0, 0.0, -speed) * late + GRAVITY * (0.5 * late * late),
        velocity: vec3(0.0, 0.0, -speed) + GRAVITY * late,
        spin: vec3(0.0, 5.0, 0.0),
        acceleration: GRAVITY,
        spin_acceleration: Vec3::zeros(),
    }
}

/// A crossing at `passage` [s] with a path of every 4th time step.
fn crossing(serial: u64, passage: f64, speed: f64) -> Crossing {
    let step = schedule::first_step_at(passage, DT) as u64;
    let grid = falling(passage, speed, step as f64 * DT);
    let there = falling(passage, speed, passage);
    let state = ParticleState {
        id: ParticleId::new(2, serial),
        material: 1,
        radius: RADIUS,
        density: 2000.0,
        position: grid.position,
        velocity: grid.velocity,
        spin: grid.spin,
    };
    let path_start = (step.saturating_sub(80) / 4 + 1) * 4;
    Crossing {
        step,
        state,
        force: Vec3::zeros(),
        torque: Vec3::zeros(),
        passage: Passage { time: passage, position: there.position, velocity: there.velocity, spin: there.spin },
        contacts: Vec::new(),
        path: (path_start..step).step_by(4).map(|at| falling(passage, speed, at as f64 * DT)).collect(),
        path_start,
    }
}

fn crossings() -> Vec<Crossing> {
    // No passage lies on a time step, where round-off would decide.
    (0..60).map(|serial| crossing(serial, 0.2003 + 0.00713 * serial as f64, 1.0)).collect()
}

fn facts(crossings: &[Crossing], chunks: &[Vec<Crossing>]) -> StreamFacts {
    let times = || crossings.iter().map(|crossing| crossing.passage.time);
    StreamFacts {
        plane: GatePlane { point: Vec3::zeros(), normal: vec3(0.0, 0.0, -1.0), aperture: Aperture::Unbounded },
        passage: PassingPoint::Centre,
        timestep: DT,
        every: Some(4),
        first_passage: times().fold(f64::INFINITY, f64::min),
        last_passage: times().fold(0.0, f64::max),
        same_backend: true,
        chunks: chunks.iter().map(|chunk| (chunk[0].step, chunk[chunk.len() - 1].step)).collect(),
        namespace: 3,
    }
}

fn replay() -> Replay {
    Replay {
        source: StreamSource::Gate(0),
        path: PathMode::Recorded,
        length: LENGTH,
        clock: Clock::Plant,
        timing: Timing::Arrival,
        window: [0.0, f64::INFINITY],
        loops: 1,
        gap: 0.0,
        transform: Transform::IDENTITY,
        leaving: Fate::Keep,
        backing_up: BackingUp::Stop,
        compliance: 0.001,
    }
}

fn shifted(transform: &Transform, mut crossing: Crossing) -> Crossing {
    crossing.state.position += transform.translation;
    crossing.passage.position += transform.translation;
    crossing.path.iter_mut().for_each(|motion| motion.position += transform.translation);
    // The marker of the plane keeps its normal.
    crossing
}

fn stage() -> ReplayStage {
    ReplayStage {
        timestep: DT,
        gravity: GRAVITY,
        body: Body::Sphere,
        cadence: Cadence::NATIVE,
        feed_offset: 0,
        largest_diameter: 2.0 * RADIUS,
        start_step: 0,
        transform: shifted,
    }
}

struct Case {
    crossings: Vec<Crossing>,
    replay: Replay,
    stage: ReplayStage,
    same_backend: bool,
}

impl Case {
    fn new(crossings: Vec<Crossing>, replay: Replay) -> Self {
        Self { crossings, replay, stage: stage(), same_backend: true }
    }

    fn try_open(&self) -> Result<(Replayer, Rc<Cell<usize>>), StorageError> {
        let chunks: Vec<Vec<Crossing>> = self.crossings.chunks(7).map(<[_]>::to_vec).collect();
        let reads = Rc::new(Cell::new(0));
        let facts = StreamFacts { same_backend: self.same_backend, ..facts(&self.crossings, &chunks) };
        let source = Box::new(Chunks { chunks, reads: Rc::clone(&reads) });
        Ok((Replayer::new(source, facts, &self.replay, self.stage)?, reads))
    }

    fn open(&self) -> Replayer {
        self.try_open().unwrap().0
    }
}

/// Time step of every entry and release by identity.
#[derive(Debug, Default)]
struct Log {
    entries: BTreeMap<ParticleId, (u64, GhostEntry)>,
    releases: BTreeMap<ParticleId, (u64, Release)>,
    tethers: BTreeMap<ParticleId, u64>,
}

fn run(replayer: &mut Replayer, from: u64, until: u64) -> Log {
    let mut log = Log::default();
    for step in from..=until {
        let due = replayer.due(step).unwrap();
        for entry in due.insert {
            assert!(log.entries.insert(entry.state.id, (step, entry)).is_none(), "entered twice");
        }
        for id in due.tether {
            assert!(log.tethers.insert(id, step).is_none(), "tethered twice");
        }
        for release in due.release {
            let id = release.state.id;
            assert!(log.entries.contains_key(&id), "released without having entered");
            assert!(log.releases.insert(id, (step, release)).is_none(), "released twice");
        }
    }
    log
}

#[test]
fn an_exact_replay_releases_the_stored_bits_at_their_own_step() {
    for path in [PathMode::Constant, PathMode::Ballistic, PathMode::Recorded] {
        let case = Case::new(crossings(), Replay { path, ..replay() });
        let mut replayer = case.open();
        let log = run(&mut replayer, 0, 700);
        assert!(replayer.is_exact() && replayer.is_finished());
        assert_eq!(log.releases.len(), 60);
        for crossing in &case.crossings {
            let (step, release) = &log.releases[&crossing.state.id];
            assert_eq!((*step, &release.state, release.exact), (crossing.step, &crossing.state, true));
            let (entered, entry) = &log.entries[&crossing.state.id];
            assert_eq!(entered % HAND_OVER_STEPS, 0);
            assert!(entered < step, "always before its release");
            assert_eq!((entry.motion.position, entry.motion.velocity), (entry.state.position, entry.state.velocity));
            // Up to a hand-over before the generation plane, at less than 1.1 m/s.
            let way = entry.motion.position.z;
            assert!(
                (LENGTH - 1e-12..LENGTH + HAND_OVER_STEPS as f64 * DT * 1.1).contains(&way),
                "{path:?}: entered at {way}"
            );
        }
        let tally = replayer.tally();
        assert_eq!((tally.expected, tally.inserted, tally.released, tally.begun_at_start), (60, 60, 60, 0));
    }
}

#[test]
fn a_recorded_ghost_is_on_its_true_path_and_others_are_left_to_the_solver() {
    let case = Case::new(crossings(), replay());
    let mut replayer = case.open();
    let mut checked = 0;
    for step in 0..700 {
        replayer.due(step).unwrap();
        for crossing in &case.crossings {
            let Some(motion) = replayer.motion(crossing.state.id, step) else { continue };
            let there = falling(crossing.passage.time, 1.0, step as f64 * DT);
            // A parabola is within the quintic's reach: round-off only.
            assert_relative_eq!(motion.position, there.position, epsilon = 1e-14);
            assert_relative_eq!(motion.velocity, there.velocity, epsilon = 1e-12);
            let stored = crossing.path.iter().find(|motion| motion.position == there.position);
            if step % 4 == 0 && step >= crossing.path_start {
                assert_eq!(Some(&motion), stored);
            }
            checked += 1;
        }
    }
    assert!(checked > 60 * 20);
    let mut straight = Case::new(crossings(), Replay { path: PathMode::Constant, ..replay() }).open();
    straight.due(192).unwrap();
    assert!(!straight.ghosts().is_empty() && straight.ghosts().iter().all(|&id| straight.motion(id, 192).is_none()));
}

#[test]
fn what_is_short_between_two_looks_enters_at_the_look_before_its_release() {
    let mut quick = crossing(1, 0.2003, 1.0);
    // Steps 193 to 200: no look between the path's start and the crossing at 201.
    (quick.path_start, quick.path) = (196, quick.path.split_off(quick.path.len() - 2));
    let mut replayer = Case::new(vec![quick.clone()], replay()).open();
    let log = run(&mut replayer, 0, 300);
    let (entered, entry) = log.entries[&quick.state.id];
    assert_eq!((entered, quick.step), (192, 201));
    let first = quick.path[0];
    assert_relative_eq!(entry.motion.position, first.position - first.velocity * (4.0 * DT), epsilon = 1e-15);
    assert_eq!(replayer.tally().short_paths, 1);
    // A path that is longer than that, but shorter than the zone, starts at the next look.
    let mut short = crossing(2, 0.2303, 1.0);
    (short.path_start, short.path) = (212, short.path.split_off(short.path.len() - 5));
    let log = run(&mut Case::new(vec![short.clone()], replay()).open(), 0, 300);
    assert_eq!(log.entries[&short.state.id].0, 224);
}

#[test]
fn slow_grazing_and_turning_ghosts_have_a_beginning() {
    // 0.01 m/s: 3 s before; at the start it is 0.2 s before.
    let mode = |path, speed| {
        let case = Case::new(vec![crossing(1, 0.2, speed)], Replay { path, ..replay() });
        let mut replayer = case.open();
        let log = run(&mut replayer, 0, 300);
        let entry = log.entries[&case.crossings[0].state.id];
        (entry.0, entry.1.motion, replayer.tally())
    };
    let (entered, motion, tally) = mode(PathMode::Constant, 0.01);
    assert_eq!((entered, tally.begun_at_start), (0, 1));
    assert_relative_eq!(motion.position.z, 0.01 * 0.2, epsilon = 1e-9);
    let (entered, motion, tally) = mode(PathMode::Ballistic, 0.1);
    // The apex lies 0.1 / 9.81 = 10.2 ms before the passage, at step 189; the look before is 160.
    assert_eq!((entered, tally.apex_starts), (160, 1));
    assert_relative_eq!(motion.velocity.z, -0.1 + 9.81 * 0.04, epsilon = 1e-9);
    let (entered, _, tally) = mode(PathMode::Constant, -0.001);
    assert_eq!((entered, tally.without_entry, tally.released), (192, 1, 1));
}

#[test]
fn clocks_windows_and_loops_shift_by_whole_steps() {
    let window = [0.25, 0.45];
    let plan = Replay { clock: Clock::FirstPassage, window, loops: 3, gap: 0.0123, ..replay() };
    let case = Case::new(crossings(), plan);
    let mut replayer = case.open();
    let log = run(&mut replayer, 0, 2000);
    let inside: Vec<&Crossing> =
        case.crossings.iter().filter(|one| (0.25..=0.45).contains(&one.passage.time)).collect();
    assert_eq!(log.releases.len(), 3 * inside.len());
    let (first, last) = (inside[0].passage.time, inside[inside.len() - 1].passage.time);
    let period = schedule::first_step_at(last - first + 0.0123, DT) as u64;
    for round in 0..3 {
        for crossing in &inside {
            let id = ParticleId::new(2 + 3 * round, crossing.state.id.serial());
            let (step, release) = &log.releases[&id];
            assert!(release.exact);
            assert_eq!(release.state, ParticleState { id, ..crossing.state });
            assert_eq!(*step, crossing.step - (first / DT).floor() as u64 + u64::from(round) * period);
        }
    }
    // The first passage happens in the first time step.
    assert_eq!(log.releases.values().map(|(step, _)| *step).min(), Some(1));
    let tally = replayer.tally();
    assert_eq!((tally.expected, tally.outside_window), (180, 3 * (60 - inside.len() as u64)));
    assert!(replayer.is_finished());
}

#[test]
fn another_time_step_passes_at_the_stored_time() {
    let mut case = Case::new(crossings(), replay());
    case.stage.timestep = 0.7e-3;
    for path in [PathMode::Constant, PathMode::Ballistic, PathMode::Recorded] {
        case.replay.path = path;
        let mut replayer = case.open();
        assert!(!replayer.is_exact());
        let log = run(&mut replayer, 0, 1000);
        for crossing in &case.crossings {
            let (step, release) = &log.releases[&crossing.state.id];
            let time = *step as f64 * 0.7e-3;
            assert!(time >= crossing.passage.time && time - 0.7e-3 < crossing.passage.time && !release.exact);
            // All of these fall freely, so the state is that of the true path.
            let there = falling(crossing.passage.time, 1.0, time);
            assert_relative_eq!(release.state.position, there.position, epsilon = 1e-14);
            assert_relative_eq!(release.state.velocity, there.velocity, epsilon = 1e-13);
        }
        let grid =
            Case { same_backend: false, crossings: crossings(), replay: case.replay.clone(), stage: stage() }.open();
        assert!(!grid.is_exact(), "a foreign stream has no grid states of this solver");
    }
}

#[test]
fn timed_by_creation_a_ghost_starts_when_it_once_passed() {
    let plan = Replay { path: PathMode::Constant, timing: Timing::Creation, clock: Clock::FirstPassage, ..replay() };
    let case = Case::new(crossings(), plan);
    let log = run(&mut case.open(), 0, 900);
    let shift = (case.crossings[0].passage.time / DT).floor() * DT;
    for crossing in &case.crossings {
        let created = crossing.passage.time - shift;
        // 30 mm at 1 m/s.
        let passes = created + LENGTH;
        let (step, release) = &log.releases[&crossing.state.id];
        assert_eq!(*step as i64, schedule::first_step_at(passes, DT));
        assert!(!release.exact);
        let (entered, entry) = &log.entries[&crossing.state.id];
        let way = LENGTH - (*entered as f64 * DT - created);
        assert_relative_eq!(entry.motion.position.z, way, epsilon = 1e-12);
    }
    let recorded = Case::new(crossings(), Replay { timing: Timing::Creation, ..replay() });
    assert!(recorded.try_open().is_err());
}

#[test]
fn a_moved_stream_passes_the_moved_plane() {
    let translation = vec3(1.0, 2.0, 3.0);
    let plan = Replay { transform: Transform { translation, ..Transform::IDENTITY }, ..replay() };
    let case = Case::new(crossings(), plan);
    let mut replayer = case.open();
    let log = run(&mut replayer, 0, 700);
    assert!(!replayer.is_exact());
    for crossing in &case.crossings {
        let (step, release) = &log.releases[&crossing.state.id];
        assert_eq!((*step, release.state.position), (crossing.step, crossing.state.position + translation));
        assert!(log.entries[&crossing.state.id].1.motion.position.z >= 3.0 + LENGTH - 1e-12);
    }
}

#[test]
fn contacts_keep_their_partners_names() {
    let mut touching = crossing(1, 0.2003, 1.0);
    touching.force = vec3(0.0, 0.0, 0.3);
    let partner = ContactPartner::Particle(ParticleId::new(1, 7));
    let zero = Vec3::zeros();
    touching.contacts = vec![StoredContact {
        partner,
        point: zero,
        normal: vec3(0.0, 0.0, 1.0),
        overlap: 1e-5,
        normal_force: zero,
        tangential_force: zero,
        tangential_memory: vec3(1.0, 2.0, 3.0),
        rolling_memory: zero,
    }];
    let mut case = Case::new(vec![touching.clone()], Replay { loops: 2, gap: 1.0, ..replay() });
    case.stage.feed_offset = 10;
    let log = run(&mut case.open(), 0, 2000);
    for (round, (id, (_, release))) in log.releases.iter().enumerate() {
        let offset = 10 + 3 * round as u32;
        assert_eq!(*id, ParticleId::new(2 + offset, 1));
        assert_eq!(release.contacts[0].partner, ContactPartner::Particle(ParticleId::new(1 + offset, 7)));
        assert_eq!(release.contacts[0].tangential_memory, touching.contacts[0].tangential_memory);
        assert_eq!(release.force, touching.force);
    }
    // Off the grid the passage is moved on under the stored force: a = F/m + g.
    case.stage.timestep = 0.9e-3;
    case.replay.loops = 1;
    let log = run(&mut case.open(), 0, 2000);
    let (step, release) = log.releases.values().next().unwrap();
    let late = *step as f64 * 0.9e-3 - touching.passage.time;
    let acceleration = touching.force / Body::Sphere.mass(RADIUS, 2000.0) + GRAVITY;
    assert_relative_eq!(release.state.velocity, touching.passage.velocity + acceleration * late, epsilon = 1e-14);
    case.replay.loops = 1 << 23;
    assert!(case.try_open().is_err(), "more identities than there are");
}

#[test]
fn a_compliant_ghost_is_tethered_one_diameter_within_the_zone() {
    let case = Case::new(crossings(), Replay { path: PathMode::Compliant, ..replay() });
    let mut replayer = case.open();
    let log = run(&mut replayer, 0, 700);
    for crossing in &case.crossings {
        let id = &crossing.state.id;
        let tethered = log.tethers[id];
        let height = |step: u64| falling(crossing.passage.time, 1.0, step as f64 * DT).position.z;
        // L2 - d = 10 mm before the plane.
        assert!(height(tethered) < 0.01 && height(tethered - 1) >= 0.01);
        assert!(log.entries[id].0 < tethered && tethered < log.releases[id].0);
        assert!(!log.releases[id].1.exact);
    }
    // With a zone of one diameter there is nothing left to tether in.
    let thin = Case::new(crossings(), Replay { path: PathMode::Compliant, length: 2.0 * RADIUS, ..replay() });
    assert!(run(&mut thin.open(), 0, 700).tethers.is_empty());
}

#[test]
fn chunks_are_read_when_needed_and_a_slow_one_does_not_bring_all_others() {
    let mut list: Vec<Crossing> = (0..700).map(|serial| crossing(serial, 3.0 + 0.071 * serial as f64, 1.0)).collect();
    // One of the last crosses at 1 mm/s and enters 30 s before.
    list[690] = crossing(690, 3.0 + 0.071 * 690.0, 0.001);
    let case = Case::new(list, Replay { path: PathMode::Constant, ..replay() });
    let (mut replayer, reads) = case.try_open().unwrap();
    assert_eq!(reads.get(), 100, "one pass");
    let (mut most, mut released) = (0, 0);
    for step in 0..60_000 {
        released += replayer.due(step).unwrap().release.len();
        most = most.max(replayer.pending.len() + replayer.ghosts.len());
    }
    assert_eq!(released, 700);
    // A chunk's seven, those of a second one that has begun, and the slow one; a few ghosts on their way.
    assert!(most < 24, "{most} crossings were held at once");
    assert!(reads.get() < 100 + 100 + 120, "{} reads", reads.get());
    assert!(replayer.is_finished());
}

#[test]
fn seeking_gives_the_state_of_having_run_there() {
    for path in [PathMode::Constant, PathMode::Ballistic, PathMode::Recorded, PathMode::Compliant] {
        let plan = Replay { path, loops: 2, gap: 0.01, window: [0.21, 0.5], ..replay() };
        let mut case = Case::new(crossings(), plan);
        case.stage.start_step = 190;
        for stop in [190, 191, 256, 333, 512, 900] {
            let mut whole = case.open();
            run(&mut whole, 190, stop);
            let mut sought = case.open();
            run(&mut sought, 190, 700);
            sought.seek(stop).unwrap();
            assert_eq!(sought.tally(), whole.tally());
            assert_eq!((sought.ghosts(), sought.tethered()), (whole.ghosts(), whole.tethered()));
            for step in stop + 1..1100 {
                assert_eq!(sought.due(step).unwrap(), whole.due(step).unwrap(), "{path:?} from {stop} at {step}");
            }
            assert!(whole.is_finished());
        }
    }
}

#[test]
fn what_passed_before_the_stage_begins_is_left_out_and_counted() {
    let mut case = Case::new(crossings(), replay());
    case.stage.start_step = 304;
    let mut replayer = case.open();
    let log = run(&mut replayer, 304, 700);
    let before = case.crossings.iter().filter(|crossing| crossing.step < 304).count() as u64;
    let tally = replayer.tally();
    assert_eq!((tally.before_start, tally.released), (before, 60 - before));
    assert_eq!(log.releases.len() as u64, 60 - before);
    assert!(tally.begun_at_start >= 1);
    let pathless = Case::new(crossings(), replay());
    let chunks = vec![pathless.crossings.clone()];
    let facts = StreamFacts { every: None, ..facts(&pathless.crossings, &chunks) };
    let source = Box::new(Chunks { chunks, reads: Rc::new(Cell::new(0)) });
    let error = Replayer::new(source, facts, &pathless.replay, pathless.stage).unwrap_err();
    assert!(error.to_string().contains("no paths"), "{error}");
}

#[test]
fn a_chunk_that_is_read_again_brings_nobody_twice() {
    // One chunk over 11 s: what is more than half of it ahead is left for a second reading.
    let times = [0.3003, 0.3503, 4.0003, 8.0003, 11.0003];
    let list: Vec<Crossing> = (0..).zip(times).map(|(serial, time)| crossing(serial, time, 1.0)).collect();
    let case = Case::new(list, replay());
    let (mut replayer, reads) = case.try_open().unwrap();
    // `run` refuses whoever enters or is released twice.
    let log = run(&mut replayer, 0, 12_000);
    assert_eq!(log.releases.len(), times.len());
    assert!(reads.get() > 2 && replayer.is_finished(), "{} reads", reads.get());
    assert_eq!(replayer.tally().released, replayer.tally().expected);
}
