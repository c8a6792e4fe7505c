//! What can be built of gates and stages: series, branches, merges, planes apart, windows, loops. All by free fall, so that every
//! place and time is known in closed form.

use crate::common::{Bench, DT, Drop, FLOOR, Frames, G, assert_faultless, assert_same, number};
use std::collections::BTreeSet;

const OUTPUT: &str = "[output]\nframes = \"1 ms\"\nformats = [\"lammps\"]\n";

/// A passage in free fall: plant time [s], place [m], velocity [m/s], spin [rad/s].
#[derive(Debug, Clone, Copy)]
struct Passage {
    time: f64,
    place: [f64; 3],
    velocity: [f64; 3],
    spin: [f64; 3],
}

/// When and how `drop` passes the height `plane` [m].
fn passage(drop: &Drop, plane: f64) -> Passage {
    let [x, y, z] = drop.place.map(|x| x * 1e-3);
    let [u, v, w] = drop.velocity;
    // z + w t - g t^2 / 2 = plane, the later root.
    let time = (w + (w * w + 2.0 * G * (z - plane)).sqrt()) / G;
    Passage { time, place: [x + u * time, y + v * time, plane], velocity: [u, v, w - G * time], spin: drop.spin }
}

impl Passage {
    /// Place and velocity `later` [s] after the passage, in free fall.
    fn later(&self, later: f64) -> ([f64; 3], [f64; 3]) {
        let ([x, y, z], [u, v, w]) = (self.place, self.velocity);
        ([x + u * later, y + v * later, z + w * later - 0.5 * G * later * later], [u, v, w - G * later])
    }
}

fn near(a: [f64; 3], b: [f64; 3], tolerance: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance)
}

/// Each of `expected` is where it must be in every frame from its passage until it comes near the floor, and nobody else is beyond
/// the plane. Identities are those of one particle each. Returns the identities in the order of `expected`.
///
/// Tolerance: some thousand additions of numbers below 1 m round to 1e-13 m; a time step missed is 1e-5 m.
fn falls_as_expected(frames: &Frames, expected: &[Passage], plane: f64) -> Vec<u64> {
    let mut ids: Vec<Option<u64>> = vec![None; expected.len()];
    let mut seen = vec![0; expected.len()];
    for (step, frame) in &frames.0 {
        let time = *step as f64 * DT;
        let mut beyond: BTreeSet<u64> =
            frame.iter().filter(|(_, row)| row.place[2] <= plane).map(|(id, _)| *id).collect();
        for (index, passage) in expected.iter().enumerate() {
            let later = time - passage.time;
            // A release is at the first time step after the passage.
            if later < DT {
                continue;
            }
            let (place, velocity) = passage.later(later);
            if place[2] < 5e-3 {
                beyond.retain(|id| ids[index] != Some(*id));
                continue;
            }
            let found = frame.iter().find(|(_, row)| near(row.place, place, 1e-11));
            let (id, row) = found.unwrap_or_else(|| panic!("nobody at {place:?} at {time} s: {frame:#?}"));
            assert!(near(row.velocity, velocity, 1e-10), "{row:?} is not {velocity:?}");
            assert!(near(row.spin, passage.spin, 1e-12), "{row:?} is not {:?}", passage.spin);
            assert_eq!(*ids[index].get_or_insert(*id), *id, "another identity at {time} s");
            assert!(beyond.remove(id), "two are at {place:?}");
            seen[index] += 1;
        }
        let early =
            |id: &u64| expected.iter().zip(&ids).any(|(p, own)| own.is_none_or(|own| own == *id) && time < p.time + DT);
        beyond.retain(|id| !early(id));
        assert!(beyond.is_empty(), "not expected at {time} s: {beyond:?}");
    }
    assert!(seen.iter().all(|count| *count > 5), "{seen:?}");
    let ids: Vec<u64> = ids.into_iter().map(Option::unwrap).collect();
    assert_eq!(ids.iter().collect::<BTreeSet<_>>().len(), ids.len(), "an identity twice: {ids:?}");
    ids
}

/// Six drops above 160 mm, oblique and spinning, that pass one after the other.
fn drops() -> Vec<Drop> {
    let drop = |k: u32| {
        let k = f64::from(k);
        Drop {
            place: [-50.0 + 20.0 * k, 6.0 * k, 165.0 + 11.0 * k],
            velocity: [0.05 * (k - 2.0), -0.03 * k, -0.1 * k],
            spin: [k, 2.0, -3.0 * k],
        }
    };
    (0..6).map(drop).collect()
}

fn passages(plane: f64) -> Vec<Passage> {
    drops().iter().map(|drop| passage(drop, plane)).collect()
}

fn end(seconds: f64) -> String {
    format!("[end]\ntime_s = {seconds}\n")
}

fn gate(name: &str, height: f64) -> String {
    format!(
        "[[gate]]\nname = \"{name}\"\npoint_mm = [0, 0, {height}]\nnormal = [0, 0, -1]\npaths = {{ every = 1, length_mm = 6 }}\n"
    )
}

/// One gate at 150 mm, replayed as `replay` says.
fn one_gate(seconds: f64, replay: &str) -> Bench {
    let bench = Bench::new();
    let feed = bench.drops("rain", &drops());
    let stages = format!(
        "[[stage]]\nname = \"above\"\nparts = []\nfeeds = [\"rain\"]\nrecords = [\"plane\"]\n\
         [[stage]]\nname = \"below\"\nparts = [\"floor\"]\nfeeds = []\n[[stage.replay]]\ngate = \"plane\"\n{replay}"
    );
    bench.write_scene("scene.toml", "", &[FLOOR, &feed, &end(seconds), OUTPUT, &gate("plane", 150.0), &stages]);
    bench
}

/// Gates without stages are a series. Catches a crossing of the second gate by one that is still a ghost of the first, times that
/// are lost from stage to stage.
#[test]
fn a_series_of_three_stages_falls_through() {
    let bench = Bench::new();
    let feed = bench.drops("rain", &drops());
    bench.write_scene("scene.toml", "", &[FLOOR, &feed, &end(0.25), OUTPUT, &gate("high", 150.0), &gate("low", 80.0)]);
    let summary = bench.run("a", &[]);
    let names: Vec<&str> = summary.list("/stages").iter().map(|stage| stage["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["before-high", "high-to-low", "after-low"]);
    assert_faultless(summary.replayed("high", "high-to-low"), 6);
    assert_faultless(summary.replayed("low", "after-low"), 6);
    let middle = falls_until(&bench.frames("a", "high-to-low"), &passages(0.15), 0.08 - 4.8e-3);
    let last = falls_as_expected(&bench.frames("a", "after-low"), &passages(0.08), 0.08);
    assert_eq!(middle, last, "identities stay");
    for (stream, plane) in [("before-high/streams/high", 0.15), ("high-to-low/streams/low", 0.08)] {
        let crossings = bench.crossings(&format!("a/stages/{stream}"));
        for (expected, id) in passages(plane).iter().zip(&last) {
            let row = crossings.iter().find(|row| row["id"].parse() == Ok(*id)).unwrap();
            let at = |name: &str| row[name].parse::<f64>().unwrap();
            assert!((at("time_s") - expected.time).abs() < 1e-12, "{row:?} is not {expected:?}");
            assert!(near(["x_m", "y_m", "z_m"].map(at), expected.place, 1e-12), "{row:?} is not {expected:?}");
        }
    }
}

/// As [`falls_as_expected`], where particles are taken out below `lowest` [m].
fn falls_until(frames: &Frames, expected: &[Passage], lowest: f64) -> Vec<u64> {
    let mut ids = Vec::new();
    for passage in expected {
        let mut own = BTreeSet::new();
        for (step, frame) in &frames.0 {
            let later = *step as f64 * DT - passage.time;
            let (place, _) = passage.later(later);
            if later < DT || place[2] < lowest {
                continue;
            }
            let found = frame.iter().find(|(_, row)| near(row.place, place, 1e-11));
            own.insert(*found.unwrap_or_else(|| panic!("nobody at {place:?} at step {step}")).0);
        }
        assert_eq!(own.len(), 1, "{own:?}");
        ids.extend(own);
    }
    ids
}

/// One stream into two stages, one of them at another place: neither disturbs the other.
#[test]
fn a_branch_gives_each_stage_all_of_the_stream() {
    let bench = one_gate(0.25, "");
    let more = "[[stage]]\nname = \"beside\"\nparts = [\"floor\"]\nfeeds = []\n[[stage.replay]]\ngate = \"plane\"\n\
                path = \"ballistic\"\nplace = { move_mm = [30, -20, -15] }\n";
    std::fs::write(bench.path("scene.toml"), bench.text("scene.toml") + more).unwrap();
    let summary = bench.run("a", &[]);
    assert_faultless(summary.replayed("plane", "below"), 6);
    assert_eq!(summary.replayed("plane", "beside")["arrivals"]["each_once"], true);
    let below = falls_as_expected(&bench.frames("a", "below"), &passages(0.15), 0.15);
    let moved: Vec<Passage> = passages(0.15)
        .into_iter()
        .map(|p| Passage { place: [p.place[0] + 0.03, p.place[1] - 0.02, p.place[2] - 0.015], ..p })
        .collect();
    let beside = falls_as_expected(&bench.frames("a", "beside"), &moved, 0.135);
    assert_eq!(below, beside, "one stream, one set of identities");
}

/// Two streams into one stage, with a feed of its own. Catches identities that meet, and one stream's ghosts steered by the other.
#[test]
fn a_merge_brings_two_streams_and_a_feed_together() {
    let bench = Bench::new();
    let all = drops();
    let high: Vec<Drop> =
        all[3..].iter().map(|d| Drop { place: [d.place[0], d.place[1], d.place[2] + 30.0], ..*d }).collect();
    let own = [Drop::new([90.0, 90.0, 60.0], [0.0, 0.0, 0.5])];
    let feeds = [bench.drops("left", &all[..3]), bench.drops("right", &high), bench.drops("own", &own)].concat();
    let stages = "[[stage]]\nname = \"one\"\nparts = []\nfeeds = [\"left\"]\nrecords = [\"a\"]\n\
                  [[stage]]\nname = \"two\"\nparts = []\nfeeds = [\"right\"]\nrecords = [\"b\"]\n\
                  [[stage]]\nname = \"both\"\nparts = [\"floor\"]\nfeeds = [\"own\"]\n\
                  [[stage.replay]]\ngate = \"a\"\n[[stage.replay]]\ngate = \"b\"\n";
    let gates = [gate("a", 150.0), gate("b", 170.0)].concat();
    bench.write_scene("scene.toml", "", &[FLOOR, &feeds, &end(0.25), OUTPUT, &gates, stages]);
    let summary = bench.run("m", &[]);
    assert_faultless(summary.replayed("a", "both"), 3);
    assert_faultless(summary.replayed("b", "both"), 3);
    let mut expected: Vec<Passage> = all[..3].iter().map(|drop| passage(drop, 0.15)).collect();
    expected.extend(high.iter().map(|drop| passage(drop, 0.17)));
    let frames = bench.frames("m", "both");
    let start = Passage { time: 0.0, place: [0.09, 0.09, 0.06], velocity: [0.0, 0.0, 0.5], spin: [0.0; 3] };
    expected.push(start);
    falls_until(&frames, &expected, 5e-3);
    assert_eq!(frames.ids().len(), 7);
    assert_eq!(summary.stage("both")["particles"], 7);
}

/// One stream through two stages and together again: the same identities come twice. They must be kept apart, or refused; silently
/// one of two particles is no result.
#[test]
fn a_stream_that_meets_itself_again_is_kept_apart() {
    let bench = Bench::new();
    let feed = bench.drops("rain", &drops());
    let through = |name: &str, gate: &str, x: f64| {
        format!(
            "[[stage]]\nname = \"{name}\"\nparts = []\nfeeds = []\nrecords = [\"{gate}\"]\n\
             [[stage.replay]]\ngate = \"top\"\nplace = {{ move_mm = [{x}, 0, 0] }}\n"
        )
    };
    let stages = [
        "[[stage]]\nname = \"above\"\nparts = []\nfeeds = [\"rain\"]\nrecords = [\"top\"]\n".to_owned(),
        through("left", "l", -70.0),
        through("right", "r", 70.0),
        "[[stage]]\nname = \"both\"\nparts = [\"floor\"]\nfeeds = []\n[[stage.replay]]\ngate = \"l\"\n[[stage.replay]]\ngate = \"r\"\n"
            .to_owned(),
    ]
    .concat();
    let gates = [gate("top", 150.0), gate("l", 90.0), gate("r", 90.0)].concat();
    bench.write_scene("scene.toml", "", &[FLOOR, &feed, &end(0.25), OUTPUT, &gates, &stages]);
    let summary = bench.run("a", &[]);
    for gate in ["l", "r"] {
        let arrivals = &summary.replayed(gate, "both")["arrivals"];
        assert_eq!((&arrivals["arrived"]["count"], &arrivals["each_once"]), (&6.into(), &true.into()), "{arrivals:#}");
    }
    let moved = |x: f64| {
        passages(0.09).into_iter().map(move |p| Passage { place: [p.place[0] + x, p.place[1], p.place[2]], ..p })
    };
    let expected: Vec<Passage> = moved(-0.07).chain(moved(0.07)).collect();
    falls_as_expected(&bench.frames("a", "both"), &expected, 0.09);
}

/// Catches a spin that is mirrored like a velocity, and an order of mirror, turn and move that is not the documented one.
#[test]
fn planes_apart_move_turn_and_mirror_the_stream() {
    for path in ["ballistic", "recorded"] {
        let bench = one_gate(
            0.25,
            &format!(
                "path = \"{path}\"\nplace = {{ rotate = {{ axis = [0, 0, 1], angle = \"90 deg\" }}, move_mm = [10, 20, -30] }}\n\
                 mirror = {{ point_mm = [5, 0, 0], normal = [1, 0, 0] }}\n"
            ),
        );
        bench.run("a", &[]);
        let moved: Vec<Passage> = passages(0.15)
            .into_iter()
            .map(|p| {
                // Mirrored in x = 5 mm: x -> 10 mm - x; the spin, a pseudovector, keeps its x and changes y and z. Then a
                // quarter turn, (x, y) -> (-y, x), then the move.
                let turn = |[x, y, z]: [f64; 3]| [-y, x, z];
                let [x, y, z] = turn([0.01 - p.place[0], p.place[1], p.place[2]]);
                let [u, v, w] = turn([-p.velocity[0], p.velocity[1], p.velocity[2]]);
                let spin = turn([p.spin[0], -p.spin[1], -p.spin[2]]);
                Passage { place: [x + 0.01, y + 0.02, z - 0.03], velocity: [u, v, w], spin, ..p }
            })
            .collect();
        falls_as_expected(&bench.frames("a", "below"), &moved, 0.12);
    }
}

#[test]
fn a_window_lets_only_its_passages_through() {
    let mut times: Vec<f64> = passages(0.15).iter().map(|p| p.time).collect();
    times.sort_by(f64::total_cmp);
    let (from, until) = (0.5 * (times[1] + times[2]), 0.5 * (times[3] + times[4]));
    let bench = one_gate(0.25, &format!("from_s = {from:?}\nuntil_s = {until:?}\n"));
    let summary = bench.run("a", &[]);
    let arrivals = &summary.replayed("plane", "below")["arrivals"];
    assert_eq!((&arrivals["arrived"]["count"], &arrivals["bit_equal"]), (&2.into(), &2.into()), "{arrivals:#}");
    assert_eq!(arrivals["exceptions"][0]["reason"], "outside_window", "{arrivals:#}");
    assert_eq!(arrivals["exceptions"][0]["count"], 4, "{arrivals:#}");
    assert_eq!(arrivals["each_once"], true);
    let expected: Vec<Passage> = passages(0.15).into_iter().filter(|p| (from..until).contains(&p.time)).collect();
    falls_as_expected(&bench.frames("a", "below"), &expected, 0.15);
}

/// Whole time steps, as the definition says: the first passage comes in the first time step.
fn first_passage_shift() -> f64 {
    let first = passages(0.15).iter().map(|p| p.time).fold(f64::INFINITY, f64::min);
    (first / DT).floor() * DT
}

#[test]
fn a_stream_can_begin_with_its_first_passage() {
    let bench = one_gate(0.25, "clock = \"first-passage\"\n");
    let summary = bench.run("a", &[]);
    assert_faultless(summary.replayed("plane", "below"), 6);
    let shift = first_passage_shift();
    let expected: Vec<Passage> = passages(0.15).into_iter().map(|p| Passage { time: p.time - shift, ..p }).collect();
    falls_as_expected(&bench.frames("a", "below"), &expected, 0.15);
}

/// Catches loops that share identities, and a gap that counts from something else than from passage to passage.
#[test]
fn loops_repeat_the_stream_with_a_gap() {
    for path in ["ballistic", "recorded"] {
        let bench =
            one_gate(0.6, &format!("path = \"{path}\"\nclock = \"first-passage\"\nloops = 3\ngap = \"30 ms\"\n"));
        // Without the floor, so that nobody bounces up into the next loop.
        let scene = bench.text("scene.toml").replace("parts = [\"floor\"]", "parts = []");
        std::fs::write(bench.path("scene.toml"), scene).unwrap();
        let summary = bench.run("a", &[]);
        assert_faultless(summary.replayed("plane", "below"), 18);
        let times: Vec<f64> = passages(0.15).iter().map(|p| p.time).collect();
        let first = times.iter().copied().fold(f64::INFINITY, f64::min);
        let last = times.iter().copied().fold(0.0, f64::max);
        // From the last passage of one loop to the first of the next, rounded up to whole time steps.
        let period = ((last - first + 0.03) / DT).ceil() * DT;
        let shift = first_passage_shift();
        let expected: Vec<Passage> = (0..3)
            .flat_map(|turn| {
                let later = f64::from(turn) * period - shift;
                passages(0.15).into_iter().map(move |p| Passage { time: p.time + later, ..p })
            })
            .collect();
        let ids = falls_as_expected(&bench.frames("a", "below"), &expected, 0.15);
        assert_eq!(ids.len(), 18);
    }
}

/// The base procedure of the patent: at its stored time a particle is created at the generation plane, and arrives later by the
/// time that it takes from there.
#[test]
fn timing_by_creation_is_later_by_the_way_through_the_zone() {
    let length = 6e-3;
    for path in ["constant", "ballistic"] {
        let bench = one_gate(0.25, &format!("path = \"{path}\"\ntiming = \"creation\"\nlength_mm = 6\n"));
        let summary = bench.run("a", &[]);
        let arrivals = &summary.replayed("plane", "below")["arrivals"];
        assert_eq!((&arrivals["arrived"]["count"], &arrivals["each_once"]), (&6.into(), &true.into()), "{arrivals:#}");
        let expected: Vec<Passage> = passages(0.15)
            .into_iter()
            .map(|p| {
                let speed = -p.velocity[2];
                let lead = if path == "constant" {
                    length / speed
                } else {
                    // length = v tau - g tau^2 / 2, told backwards from the passage.
                    (speed - (speed * speed - 2.0 * G * length).sqrt()) / G
                };
                Passage { time: p.time + lead, ..p }
            })
            .collect();
        falls_as_expected(&bench.frames("a", "below"), &expected, 0.15);
    }
}

/// A stored stream under another time step: no grid state fits, the passages must.
#[test]
fn a_stored_stream_is_replayed_with_another_time_step() {
    let bench = one_gate(0.25, "");
    bench.run("first", &["--stage", "above"]);
    for (number, path) in ["constant", "ballistic", "recorded"].iter().enumerate() {
        let scene = format!("again-{number}.toml");
        let stages = format!(
            "[[stage]]\nname = \"below\"\nparts = [\"floor\"]\nfeeds = []\n[[stage.replay]]\n\
             stream = \"first/stages/above/streams/plane\"\npath = \"{path}\"\nlength_mm = 6\n"
        );
        bench.write_scene(&scene, "", &[FLOOR, &end(0.25), OUTPUT, &stages]);
        let out = format!("again-{number}");
        let answer = bench.tollgate(&["run", &scene, "--out", &out, "--set", "solver.timestep=8e-6 s"]);
        assert_eq!(answer.code, 0, "{answer:?}");
        let summary = bench.summary(&out);
        let arrivals = &summary.replayed("plane", "below")["arrivals"];
        assert_eq!((&arrivals["arrived"]["count"], &arrivals["each_once"]), (&6.into(), &true.into()), "{arrivals:#}");
        let frames = bench.frames(&out, "below");
        let time = |step: u64| step as f64 * 8e-6;
        for p in passages(0.15) {
            let mut seen = 0;
            for (step, frame) in &frames.0 {
                let later = time(*step) - p.time;
                let (place, _) = p.later(later);
                if later > 8e-6 && place[2] > 5e-3 {
                    assert!(
                        frame.values().any(|row| near(row.place, place, 1e-11)),
                        "{path}: nobody at {place:?}: {frame:?}"
                    );
                    seen += 1;
                }
            }
            assert!(seen > 5, "{seen}");
        }
    }
}

/// Catches work that is cut by the number of threads, and maps whose order reaches a result.
#[test]
fn two_threads_give_the_bits_of_one() {
    let bench = Bench::hopper();
    let settings = ["--set", "end.time_s=0.2", "--set", "output.checkpoints=50 ms"];
    bench.run("one", &settings);
    let two = [&["run", "scene.toml", "--threads", "2", "--out", "two"], &settings[..]].concat();
    let answer = bench.tollgate(&two);
    assert_eq!(answer.code, 0, "{answer:?}");
    assert!(number(&bench.summary("one").recorded("outlet")["stream"]["crossings"]) > 50.0);
    assert_same(&bench.result("one"), &bench.result("two"));
}

/// Fill once, then cut the discharge: the particles come from another run's checkpoint, no feed is the scene's own. Catches
/// identities that are told apart by the number of feeds alone.
#[test]
fn a_cut_run_starts_from_a_checkpoint() {
    let bench = Bench::hopper();
    let text = bench.text("scene.toml");
    let [gates, output] = ["\n[[gate]]", "\n[solver]"].map(|section| text.find(section).unwrap());
    let opens = text.find("disappears").unwrap();
    let opens = opens..opens + text[opens..].find('\n').unwrap();
    let closed = text.replace(&text[opens.clone()], "").replace(&text[gates..output], "");
    std::fs::write(bench.path("fill.toml"), closed).unwrap();
    let answer = bench.tollgate(&["run", "fill.toml", "--out", "fill", "--set", "end.time=0.12 s"]);
    assert_eq!(answer.code, 0, "{answer:?}");
    let feed = text.find("[[feed]]").unwrap()..text.find("[[part]]").unwrap();
    let discharge = text.replace(&text[opens], "disappears = \"5 ms\"").replace(&text[feed], "");
    let discharge = discharge.replace("feeds = [\"fill\"]", "feeds = []");
    std::fs::write(bench.path("scene.toml"), discharge).unwrap();
    let from = ["--from", "fill/state.checkpoint", "--set", "end.time=0.12 s"];
    let summary = bench.run("split", &from);
    let count = summary.recorded("outlet")["stream"]["crossings"].as_u64().unwrap();
    assert!(count > 50, "{count}");
    assert_faultless(summary.replayed("outlet", "heap"), count);
    bench.run("whole", &[&from[..], &["--whole"]].concat());
    let (whole, heap) = (bench.frames("whole", "heap"), bench.frames("split", "heap"));
    let mut seen = 0;
    for (step, frame) in heap.0.iter().filter(|(_, frame)| !frame.is_empty()).take(5) {
        for (id, row) in frame {
            // As in the dense discharge: it starts at round-off, 1e-9 of a diameter of 4 mm.
            assert!(row.distance(whole.row(*step, *id)) < 4e-12, "{id} at {step}");
            seen += 1;
        }
    }
    assert!(seen > 50, "{seen}");
    let twice = ["stage.heap.replay.outlet.loops=2", "stage.heap.replay.outlet.gap=20 ms", "end.time=0.25 s"];
    let twice: Vec<&str> = twice.iter().flat_map(|setting| ["--set", setting]).collect();
    let looped = bench.run("loops", &[&from[..2], &twice[..]].concat());
    let arrivals = &looped.replayed("outlet", "heap")["arrivals"];
    let recorded = looped.recorded("outlet")["stream"]["crossings"].as_u64().unwrap();
    assert_eq!(arrivals["recorded"]["count"], 2 * recorded, "{arrivals:#}");
    assert_eq!(arrivals["each_once"], true, "{arrivals:#}");
    assert!(number(&arrivals["arrived"]["count"]) > recorded as f64, "{arrivals:#}");
}

/// Two gates of one stage, each into a stage of its own: a branch by place.
#[test]
fn a_stage_with_two_outlets_feeds_two_stages() {
    let bench = Bench::new();
    let feed = bench.drops("rain", &drops());
    let half = |name: &str, x: f64| {
        gate(name, 150.0).replace("point_mm = [0,", &format!("point_mm = [{x},"))
            + "aperture = { shape = \"rectangle\", side_a_mm = [200, 0, 0], side_b_mm = [0, 400, 0] }\n"
    };
    let gates = [half("left", -100.0), half("right", 100.0)].concat();
    let stages = "[[stage]]\nname = \"above\"\nparts = []\nfeeds = [\"rain\"]\nrecords = [\"left\", \"right\"]\n\
                  [[stage]]\nname = \"west\"\nparts = [\"floor\"]\nfeeds = []\n[[stage.replay]]\ngate = \"left\"\n\
                  [[stage]]\nname = \"east\"\nparts = [\"floor\"]\nfeeds = []\n[[stage.replay]]\ngate = \"right\"\n\
                  [[stage]]\nname = \"both\"\nparts = [\"floor\"]\nfeeds = []\n[[stage.replay]]\ngate = \"left\"\n\
                  [[stage.replay]]\ngate = \"right\"\n";
    bench.write_scene("scene.toml", "", &[FLOOR, &feed, &end(0.25), OUTPUT, &gates, stages]);
    let summary = bench.run("a", &[]);
    let (west, east): (Vec<Passage>, Vec<Passage>) = passages(0.15).into_iter().partition(|p| p.place[0] < 0.0);
    assert!(west.len() > 1 && east.len() > 1);
    for (gate, stage, expected) in [("left", "west", &west), ("right", "east", &east)] {
        assert_faultless(summary.replayed(gate, stage), expected.len() as u64);
        assert_faultless(summary.replayed(gate, "both"), expected.len() as u64);
        falls_as_expected(&bench.frames("a", stage), expected, 0.15);
    }
    let mut ids = falls_as_expected(&bench.frames("a", "both"), &[west, east].concat(), 0.15);
    ids.sort_unstable();
    assert_eq!(ids, (0..6).map(|serial| ids[0] + serial).collect::<Vec<_>>(), "identities are those of the feed");
}
