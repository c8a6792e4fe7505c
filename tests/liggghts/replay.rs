//! Streams of our own solver, replayed on the real binary from what `prepare` wrote: the deck around it is as small as one can be.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;
use tempfile::TempDir;
use tollgate::backend::liggghts::replay::{
    ARRIVALS_DUMP, Prepared, RELEASE, RELEASE_NEXT, STEER_NEXT, STEER_SET, define, leave, prepare,
};
use tollgate::backend::liggghts::{Schedule, files, groups};
use tollgate::backend::stage::{ReplayOrder, ReplayResult};
use tollgate::gate::Cadence;
use tollgate::gate::crossing::Crossing;
use tollgate::gate::ledger::Exception;
use tollgate::gate::stream::reader::StreamReader;
use tollgate::gate::stream::writer::{Closing, StreamWriter};
use tollgate::math::{Vec3, vec3};
use tollgate::output::progress::Verbosity;
use tollgate::particle::ParticleId;
use tollgate::run::{RunRequest, run};
use tollgate::scene::Scene;
use tollgate::scene::gate::PathMode;
use tollgate::stage::split::stage_jobs;

const CADENCE: Cadence = Cadence { look: 5, hand_over: 20 };
/// Time step of the small hopper [s].
const DT: f64 = 4e-5;
/// Gravity [m/s2].
const G: f64 = 9.81;
const STEPS: u64 = 6000;

fn hopper() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes/gate/hopper.toml")
}

/// The small hopper's stream, recorded once for all tests by our own solver.
fn recorded() -> &'static Path {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let request = RunRequest {
            scene: hopper(),
            out: Some(folder.path().join("out")),
            threads: Some(1),
            stages: vec!["hopper".to_owned()],
            replicates: 1,
            verbosity: Verbosity::Silent,
            ..RunRequest::default()
        };
        run(&request, &AtomicBool::new(false)).unwrap();
        folder
    });
    folder.path()
}

fn stream() -> PathBuf {
    recorded().join("out/stages/hopper/streams/outlet")
}

fn crossings(stream: &Path) -> Vec<Crossing> {
    StreamReader::open(stream).unwrap().crossings().map(Result::unwrap).collect()
}

/// The stage that replays it, and how.
fn heap(path: PathMode, stream: PathBuf) -> (Scene, ReplayOrder) {
    let (scene, _) = tollgate::scene::read(&hopper(), &[]).unwrap();
    let job = stage_jobs(&scene).into_iter().find(|job| job.name == "heap").unwrap();
    let mut replay = job.replays[0].clone();
    replay.path = path;
    let order = ReplayOrder { name: "outlet".to_owned(), replay, stream, feed_offset: 0, feed_numbers: 1 };
    (job.scene, order)
}

fn schedule() -> Schedule {
    Schedule { timestep: DT, cadence: CADENCE, steps: STEPS }
}

/// The head of a deck: two materials, a floor, and the groups and integrators of all kinds of ghosts.
const HEAD: &str = "\
atom_style granular
atom_modify map array sort 0 0
boundary f f f
newton off
communicate single vel yes
units si
processors * * 1
region domain block -0.06 0.06 -0.06 0.06 0.09 0.32 units box
create_box 2 domain
neighbor 0.001 bin
neigh_modify delay 0
soft_particles yes
fix m1 all property/global youngsModulus peratomtype 1e6 1e6
fix m2 all property/global poissonsRatio peratomtype 0.25 0.25
fix m3 all property/global coefficientRestitution peratomtypepair 2 0.4 0.4 0.4 0.4
fix m4 all property/global coefficientFriction peratomtypepair 2 0.5 0.5 0.5 0.5
pair_style gran model hertz tangential history
pair_coeff * *
timestep 4e-05
group active id > 0
group ghost_constant subtract all all
group ghost_ballistic subtract all all
group ghost_recorded subtract all all
group released subtract all all
fix floor all wall/gran model hertz tangential history primitive type 1 zplane 0.14
fix move active nve/sphere
fix straight ghost_constant nve/noforce
fix driven ghost_recorded nve/noforce
fix falling ghost_ballistic nve
fix nothing ghost_ballistic setforce 0 0 0
fix weight all gravity 9.81 vector 0 0 -1
thermo_style custom step atoms ke
thermo_modify lost ignore norm no
";

/// A deck by the rules of what `prepare` writes.
fn deck(prepared: &Prepared) -> String {
    let ghosts = prepared.ghosts;
    let kinds = [
        (ghosts.constant, groups::CONSTANT),
        (ghosts.ballistic, groups::BALLISTIC),
        (ghosts.recorded, groups::RECORDED),
    ];
    let kinds = kinds.iter().filter(|(there, _)| *there).map(|(_, group)| *group);
    let mut at_first: Vec<String> = Vec::new();
    at_first.extend(ghosts.recorded.then(|| STEER_SET.to_owned()));
    at_first.extend(RELEASE.map(str::to_owned));
    at_first.extend(kinds.map(leave));
    at_first.push(ARRIVALS_DUMP.to_owned());
    let mut later = at_first.clone();
    later.insert(0, RELEASE_NEXT.to_owned());
    if ghosts.recorded {
        later.insert(0, STEER_NEXT.to_owned());
    }
    let every: Vec<String> = later.iter().map(|command| format!("\"{command}\"")).collect();
    let Cadence { look, hand_over } = CADENCE;
    let run = format!("run {hand_over} pre no post no every {look} {}\n", every.join(" "));
    let mut text = HEAD.to_owned();
    let enters = |step| step == 0 || prepared.particles.iter().any(|entered| entered.step == step);
    for step in (0..STEPS).step_by(hand_over as usize) {
        if enters(step) {
            let _ = writeln!(text, "include {}/{step}.in", files::BATCHES);
        }
        if step == 0 {
            for command in define(ghosts.recorded).iter().chain(&at_first) {
                let _ = writeln!(text, "{command}");
            }
        }
        text.push_str(&run);
    }
    text
}

fn compute(case: &Path, ranks: u32) {
    let mut command = if ranks == 1 { Command::new("stdbuf") } else { Command::new("mpirun") };
    if ranks > 1 {
        command.args(["--allow-run-as-root", "--oversubscribe", "-np", &ranks.to_string(), "stdbuf"]);
    }
    let output = command.args(["-oL", "liggghts", "-in", files::DECK]).current_dir(case).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    let mut end: Vec<&str> = text.lines().rev().take(12).collect();
    end.reverse();
    assert!(
        output.status.success() && !text.contains("ERROR"),
        "{end:#?}\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

/// Prepares, computes and accounts for a replay; what is left is the case, for those who look for themselves.
fn replayed(path: PathMode, stream: PathBuf, ranks: u32) -> (TempDir, BTreeMap<u32, ParticleId>, ReplayResult) {
    let (scene, order) = heap(path, stream);
    let case = tempfile::tempdir().unwrap();
    let prepared = prepare(&scene, &[order], &schedule(), case.path()).unwrap();
    std::fs::write(case.path().join(files::DECK), deck(&prepared)).unwrap();
    compute(case.path(), ranks);
    let ids = (1..).zip(prepared.tags.ids().iter().copied()).collect();
    let mut results = prepared.finish(case.path(), STEPS).unwrap();
    (case, ids, results.pop().unwrap())
}

/// Rows of `arrivals.dump`: time step, place, velocity and spin by tag, read without the library.
fn arrivals(case: &Path) -> BTreeMap<u32, (u64, [Vec3; 3])> {
    let text = std::fs::read_to_string(case.join(files::ARRIVALS)).unwrap();
    let mut found = BTreeMap::new();
    for snapshot in text.split("ITEM: TIMESTEP\n").skip(1) {
        let step: u64 = snapshot.lines().next().unwrap().parse().unwrap();
        for line in snapshot.lines().skip_while(|line| !line.starts_with("ITEM: ATOMS")).skip(1) {
            let row: Vec<f64> = line.split_whitespace().map(|field| field.parse().unwrap()).collect();
            let vector = |from: usize| vec3(row[from], row[from + 1], row[from + 2]);
            assert!(found.insert(row[0] as u32, (step, [vector(4), vector(7), vector(10)])).is_none());
        }
    }
    found
}

/// First look at or after a time, as a time step.
fn look_at(time: f64) -> u64 {
    ((time / DT).ceil() as u64).next_multiple_of(CADENCE.look)
}

/// A passage of our own solver moved on to the look at which it is released: free, or under the stored force.
fn moved_on(crossing: &Crossing) -> (u64, [Vec3; 3]) {
    let (state, passage) = (&crossing.state, &crossing.passage);
    let mass = 4.0 / 3.0 * std::f64::consts::PI * state.radius.powi(3) * state.density;
    let (mut acceleration, mut spin_up) = (vec3(0.0, 0.0, -G), Vec3::zeros());
    if !crossing.contacts.is_empty() {
        acceleration += crossing.force / mass;
        spin_up += crossing.torque / (0.4 * mass * state.radius * state.radius);
    }
    let step = look_at(passage.time);
    let later = step as f64 * DT - passage.time;
    let place = passage.position + passage.velocity * later + acceleration * (0.5 * later * later);
    (step, [place, passage.velocity + acceleration * later, passage.spin + spin_up * later])
}

/// Everything that can arrive does, at its sample, within the bars.
fn arrives(path: PathMode, ranks: u32) {
    let (case, ids, result) = replayed(path, stream(), ranks);
    let (found, crossings) = (arrivals(case.path()), crossings(&stream()));
    let due: Vec<&Crossing> = crossings.iter().filter(|crossing| look_at(crossing.passage.time) <= STEPS).collect();
    assert!(due.len() > 100 && due.iter().any(|crossing| !crossing.contacts.is_empty()), "{}", due.len());
    assert_eq!(found.len(), due.len());
    let tags: BTreeMap<ParticleId, u32> = ids.iter().map(|(tag, id)| (*id, *tag)).collect();
    for crossing in due.iter() {
        let (step, [place, velocity, spin]) = moved_on(crossing);
        let (at, [x, v, w]) = found[&tags[&crossing.state.id]];
        // A bar of the backend; the closed form above is the library's up to round-off of numbers below 1 m, 2 m/s and 500 rad/s.
        assert_eq!(at, step, "{:?}", crossing.state.id);
        assert!((x - place).norm() <= 1e-12, "{path:?}: {:e}", (x - place).norm());
        assert!((v - velocity).norm() <= 1e-12, "{path:?}: {:e}", (v - velocity).norm());
        assert!((w - spin).norm() <= 1e-11, "{path:?}: {:e}", (w - spin).norm());
    }
    // Against what was wanted, the library compares to the bit where the bars ask for that: any deviation is in the list.
    let report = &result.arrivals;
    let wrong = |reason| !matches!(reason, Exception::OutsideWindow | Exception::OnItsWay);
    assert!(!report.exceptions.iter().any(|entry| wrong(entry.reason)), "{report:?}");
    assert!(report.sums_exact && report.each_once, "{report:?}");
    assert_eq!((result.tally.released, report.arrived.count), (due.len() as u64, due.len() as u64));
    assert!(report.largest_deviation_m <= 1e-12 && !result.exact, "{report:?}");
    if path == PathMode::Recorded {
        assert_eq!(report.bit_equal, due.len() as u64, "{report:?}");
    }
}

#[test]
fn constant_ghosts_arrive_with_their_velocity_bit_for_bit() {
    arrives(PathMode::Constant, 1);
}

#[test]
fn falling_ghosts_arrive_where_they_passed() {
    arrives(PathMode::Ballistic, 1);
}

#[test]
fn recorded_ghosts_arrive_with_the_bits_that_were_wanted() {
    arrives(PathMode::Recorded, 1);
}

#[test]
fn recorded_ghosts_arrive_the_same_on_two_ranks() {
    arrives(PathMode::Recorded, 2);
}

/// The stream as LIGGGHTS would have recorded it: grid states at multiples of the look.
fn as_recorded_by_liggghts(folder: &Path) -> PathBuf {
    let reader = StreamReader::open(&stream()).unwrap();
    let mut origin = reader.manifest().origin.clone();
    origin.backend = tollgate::backend::liggghts::NAME.to_owned();
    let place = folder.join("foreign");
    let mut writer = StreamWriter::create(&place, origin).unwrap();
    let mut all = Vec::new();
    for crossing in reader.crossings() {
        let mut crossing = crossing.unwrap();
        // Paths are stored every time step: cut back to one that ends at a look.
        let step = crossing.step / CADENCE.look * CADENCE.look;
        let Some(index) = step.checked_sub(crossing.path_start).map(|index| index as usize) else { continue };
        if let Some(motion) = crossing.path.get(index).copied() {
            crossing.state.position = motion.position;
            crossing.state.velocity = motion.velocity;
            crossing.state.spin = motion.spin;
            crossing.path.truncate(index);
            crossing.step = step;
        }
        all.push(crossing);
    }
    all.sort_by_key(|crossing| (crossing.step, crossing.state.id));
    all.into_iter().for_each(|crossing| writer.push(crossing).unwrap());
    writer.finish(Closing::default()).unwrap();
    place
}

#[test]
fn grid_states_of_liggghts_come_back_to_the_bit_at_their_own_step() {
    let folder = tempfile::tempdir().unwrap();
    let place = as_recorded_by_liggghts(folder.path());
    let (case, ids, result) = replayed(PathMode::Recorded, place.clone(), 1);
    let found = arrivals(case.path());
    let tags: BTreeMap<ParticleId, u32> = ids.iter().map(|(tag, id)| (*id, *tag)).collect();
    let mut exact = 0;
    for crossing in crossings(&place).iter().filter(|crossing| crossing.step <= STEPS) {
        let (step, [x, v, w]) = found[&tags[&crossing.state.id]];
        assert_eq!(step, crossing.step);
        assert_eq!((x, v, w), (crossing.state.position, crossing.state.velocity, crossing.state.spin));
        exact += 1;
    }
    assert!(exact > 100 && result.exact, "{exact} {:?}", result.arrivals);
    assert_eq!(result.arrivals.bit_equal, exact);
}

/// What LIGGGHTS would have written of a case, cut off and tampered with.
#[test]
fn a_damaged_dump_of_arrivals_is_refused_and_whoever_is_missing_is_listed() {
    let (scene, order) = heap(PathMode::Constant, stream());
    let case = tempfile::tempdir().unwrap();
    let prepare = || prepare(&scene, std::slice::from_ref(&order), &schedule(), case.path()).unwrap();
    let prepared = prepare();
    std::fs::write(case.path().join(files::DECK), deck(&prepared)).unwrap();
    compute(case.path(), 1);
    let place = case.path().join(files::ARRIVALS);
    let whole = std::fs::read_to_string(&place).unwrap();
    let refused = |text: &str, reason: &str| {
        std::fs::write(&place, text).unwrap();
        let error = prepare().finish(case.path(), STEPS).unwrap_err();
        let shown = error.to_string();
        assert!(shown.contains("arrivals.dump") && shown.contains(reason) && shown.contains("liggghts -in"), "{shown}");
    };
    let row = whole.lines().find(|line| line.split(' ').count() >= 13 && !line.starts_with("ITEM")).unwrap();
    let at = whole.find(row).unwrap();
    refused(&whole[..at + row.len() / 2], "a half-written line");
    refused(&whole.replacen(row, &row.replacen(' ', " x", 1), 1), "is not a whole number");
    refused(&whole.replacen("ITEM: BOX", "ITEM: COX", 1), "expected a line that starts with \"ITEM: \"");
    let late = format!(
        "ITEM: TIMESTEP\n{}\nITEM: NUMBER OF ATOMS\n0\nITEM: BOX BOUNDS ff ff ff\n0 1\n0 1\n0 1\nITEM: ATOMS id\n",
        STEPS + 100
    );
    refused(&format!("{whole}{late}"), "it goes on to time step");
    // One arrival taken away, another one two samples late.
    let count = whole[..at].rfind("ITEM: NUMBER OF ATOMS\n").unwrap() + "ITEM: NUMBER OF ATOMS\n".len();
    let number: u32 = whole[count..].lines().next().unwrap().parse().unwrap();
    let fewer =
        whole[count..].replacen(&number.to_string(), &(number - 1).to_string(), 1).replacen(&format!("{row}\n"), "", 1);
    std::fs::write(&place, format!("{}{fewer}", &whole[..count])).unwrap();
    let report = prepare().finish(case.path(), STEPS).unwrap().remove(0).arrivals;
    let lost = report.exceptions.iter().find(|entry| entry.reason == Exception::LostInZone).unwrap();
    assert_eq!((lost.count, report.each_once), (1, false), "{report:?}");
    let tag: u32 = row.split(' ').next().unwrap().parse().unwrap();
    assert_eq!(lost.first, [prepare().tags.id(tag).unwrap()]);
}

/// 60 000 samples of recorded paths: what is held at once are the ghosts on their way and some numbers for every particle.
#[test]
fn the_memory_of_a_long_case_is_bounded() {
    let (scene, order) = heap(PathMode::Recorded, stream());
    let case = tempfile::tempdir().unwrap();
    let cadence = Cadence { look: 1, hand_over: 20 };
    let schedule = Schedule { timestep: 0.1 * DT, cadence, steps: 60_000 };
    let before = resident();
    let prepared = prepare(&scene, &[order], &schedule, case.path()).unwrap();
    let grown = resident().saturating_sub(before);
    let written = std::fs::metadata(case.path().join("paths/px")).unwrap().len();
    assert!(prepared.entered > 100 && written > 4_000_000, "{} {written}", prepared.entered);
    // Nine files of that size; other tests of this process take some.
    assert!(grown < 30_000_000, "{grown} bytes for {written} bytes of each path");
    let samples = std::fs::read_to_string(case.path().join("paths/release")).unwrap();
    let sections = samples.lines().filter(|line| !line.contains(' ')).count();
    assert_eq!(sections, 60_002, "one a sample from step 0 on, and a spare one");
}

/// Memory of this process [bytes].
fn resident() -> u64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap();
    let pages: u64 = text.split_whitespace().nth(1).unwrap().parse().unwrap();
    4096 * pages
}
