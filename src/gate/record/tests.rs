use super::*;
use crate::geometry::plane::{Aperture, GatePlane};
use crate::math::vec3;
use crate::scene::gate::{Exclusion, PathRecording};
use approx::assert_relative_eq;

const GRAVITY: Vec3 = vec3(0.0, 0.0, -9.81);
const TIMESTEP: f64 = 1e-3;
const DIAMETER: f64 = 0.1;

/// A gate in the plane z = 0, passed downwards.
fn gate() -> Gate {
    Gate {
        name: "outlet".to_owned(),
        plane: GatePlane {
            point: Vec3::zeros(),
            normal: vec3(0.0, 0.0, -1.0),
            aperture: Aperture::Disc { radius: 1.0 },
        },
        passage: PassingPoint::Centre,
        exclusion: Exclusion { mode: ExclusionMode::Buffer, length: 0.2 },
        paths: Some(PathRecording { every: 2, length: 0.3 }),
        returning: Fate::Keep,
        sitting: Fate::Keep,
    }
}

fn recorder(gate: &Gate, role: Role) -> Recorder {
    Recorder::new(gate, role, GRAVITY, TIMESTEP, DIAMETER, Cadence::NATIVE)
}

fn id(serial: u64) -> ParticleId {
    ParticleId::new(3, serial)
}

fn seen(serial: u64, place: Vec3) -> Seen {
    let motion = Motion {
        position: place,
        velocity: vec3(0.0, 0.0, -1.0),
        spin: Vec3::zeros(),
        acceleration: GRAVITY,
        spin_acceleration: Vec3::zeros(),
    };
    Seen { id: id(serial), radius: DIAMETER / 2.0, motion }
}

/// Looks at one particle at the given heights, one a time step from `first`.
fn follow(recorder: &mut Recorder, first: u64, heights: &[f64]) -> Vec<Look> {
    let look =
        |(index, &z): (usize, &f64)| recorder.look(first + index as u64, [seen(1, vec3(0.0, 0.0, z))].into_iter());
    heights.iter().enumerate().map(look).collect()
}

fn crossing_of(recorder: &mut Recorder, serial: u64) -> Crossing {
    let state = ParticleState {
        id: id(serial),
        material: 0,
        radius: DIAMETER / 2.0,
        density: 1000.0,
        position: Vec3::zeros(),
        velocity: Vec3::zeros(),
        spin: Vec3::zeros(),
    };
    recorder.crossing(state, Vec3::zeros(), Vec3::zeros(), Vec::new())
}

fn crossings(looks: &[Look]) -> Vec<usize> {
    looks.iter().enumerate().filter(|(_, look)| !look.crossed.is_empty()).map(|(index, _)| index).collect()
}

#[test]
fn a_crossing_is_the_first_change_of_sign_inside_the_aperture() {
    let mut watch = recorder(&gate(), Role::HandOver);
    let looks = follow(&mut watch, 1, &[0.02, 0.01, -0.01, -0.02, 0.005, -0.01, -0.03]);
    assert_eq!(crossings(&looks), [2], "recorded once ever");
    assert_eq!((watch.tally().recorded, watch.tally().returned), (1, 1));
    assert_relative_eq!(watch.tally().returned_farthest_m, 0.005);
    // Exactly on the plane has passed; a path that turns just before has not.
    assert_eq!(crossings(&follow(&mut recorder(&gate(), Role::HandOver), 1, &[0.01, 0.0, 0.01])), [1]);
    let mut watch = recorder(&gate(), Role::HandOver);
    assert_eq!(crossings(&follow(&mut watch, 1, &[0.01, 1e-300, 0.01])), Vec::<usize>::new());
    assert_eq!(watch.tally(), RecordTally::default());
}

#[test]
fn passing_beside_the_aperture_is_nothing_and_coming_round_it_is_counted() {
    let mut watch = recorder(&gate(), Role::HandOver);
    for (step, (x, z)) in (1..).zip([(1.5, 0.01), (1.5, -0.01), (1.5, -0.02), (1.2, -0.03)]) {
        assert_eq!(watch.look(step, [seen(1, vec3(x, 0.0, z))].into_iter()), Look::default());
    }
    assert_eq!(watch.tally(), RecordTally::default());
    watch.look(5, [seen(1, vec3(0.9, 0.0, -0.03))].into_iter());
    watch.look(6, [seen(1, vec3(0.9, 0.0, -0.03))].into_iter());
    assert_eq!((watch.tally().recorded, watch.tally().came_around), (0, 1));
    // Back upstream it has still not passed: its next crossing is its first.
    watch.look(7, [seen(1, vec3(0.9, 0.0, 0.01))].into_iter());
    assert_eq!(watch.look(8, [seen(1, vec3(0.9, 0.0, -0.01))].into_iter()).crossed, [id(1)]);
    // Where the place at the plane decides: it goes into the aperture and passes outside of it.
    let mut watch = recorder(&gate(), Role::HandOver);
    let mut slanted = seen(2, vec3(1.02, 0.0, 0.01));
    slanted.motion.velocity = vec3(-40.0, 0.0, -40.0);
    watch.look(1, [slanted].into_iter());
    assert!(watch.look(2, [seen(2, vec3(0.98, 0.0, -0.03))].into_iter()).crossed.is_empty(), "at z = 0 it was at 1.01");
}

#[test]
fn the_lowest_point_passes_a_radius_earlier() {
    let lowest = Gate { passage: PassingPoint::LowestPoint, ..gate() };
    let heights = [0.07, 0.055, 0.045, 0.01, -0.01];
    assert_eq!(crossings(&follow(&mut recorder(&lowest, Role::HandOver), 1, &heights)), [2]);
    assert_eq!(crossings(&follow(&mut recorder(&gate(), Role::HandOver), 1, &heights)), [4]);
}

/// A particle on a spring: z = 0.02 + 0.05 cos(w t), x = 0.3 sin(w t) / w + ..., spin = sin(w t); passes z = 0 on its way down.
fn swinging(time: f64) -> Motion {
    let rate = 30.0;
    let (sine, cosine) = (rate * time).sin_cos();
    Motion {
        position: vec3(0.1 * sine, 0.0, 0.02 + 0.05 * cosine),
        velocity: vec3(0.1 * rate * cosine, 0.0, -0.05 * rate * sine),
        spin: vec3(0.0, sine, 0.0),
        acceleration: vec3(-0.1 * rate * rate * sine, 0.0, -0.05 * rate * rate * cosine),
        spin_acceleration: vec3(0.0, rate * cosine, 0.0),
    }
}

#[test]
fn the_passage_is_of_second_order_at_least() {
    let rate = 30.0_f64;
    let true_time = (-0.02_f64 / 0.05).acos() / rate;
    let errors = |timestep: f64| {
        let mut watch = Recorder::new(&gate(), Role::HandOver, GRAVITY, timestep, DIAMETER, Cadence::NATIVE);
        for step in 0.. {
            let motion = swinging(step as f64 * timestep);
            let look = watch.look(step, [Seen { id: id(1), radius: 0.05, motion }].into_iter());
            if !look.crossed.is_empty() {
                let passage = crossing_of(&mut watch, 1).passage;
                let there = swinging(true_time);
                return [
                    (passage.time - true_time).abs(),
                    (passage.position - there.position).norm(),
                    (passage.velocity - there.velocity).norm() / rate,
                    (passage.spin - there.spin).norm(),
                ];
            }
        }
        unreachable!()
    };
    // The place of a passage within its time step differs from one dt to the next, so the bound is tested, not the ratio. From
    // exact states at the step's start a place errs by at most dt^3 |x'''| / 6, a velocity by dt^3 |v'''| / 12: third order.
    for timestep in [1e-3, 5e-4, 2.5e-4, 1.25e-4] {
        let angle = rate * timestep;
        let bound = angle.powi(3) / 6.0 * 0.12;
        let [time, place, velocity, spin] = errors(timestep);
        // The normal speed is at least 0.05 w sqrt(1 - 0.4^2) there.
        assert!(time <= bound / (0.04 * rate), "time {time} at {timestep}");
        assert!(place <= 4.0 * bound, "place {place} at {timestep}");
        assert!(velocity <= 4.0 * bound, "velocity {velocity} at {timestep}");
        assert!(spin <= 4.0 * angle.powi(3) / 6.0, "spin {spin} at {timestep}");
    }
}

#[test]
fn on_the_plane_at_a_time_step_the_passage_is_the_grid_state() {
    let mut watch = recorder(&gate(), Role::HandOver);
    watch.look(6, [seen(1, vec3(0.0, 0.0, 0.01))].into_iter());
    let on = Seen { id: id(1), radius: 0.05, motion: swinging(0.123) };
    let on = Seen { motion: Motion { position: vec3(0.2, 0.1, 0.0), ..on.motion }, ..on };
    assert_eq!(watch.look(7, [on].into_iter()).crossed, [id(1)]);
    let passage = crossing_of(&mut watch, 1).passage;
    let Motion { position, velocity, spin, .. } = on.motion;
    assert_eq!(passage, Passage { time: 7.0 * TIMESTEP, position, velocity, spin });
}

#[test]
fn a_path_has_every_kth_motion_since_the_particle_came_last() {
    let mut watch = recorder(&gate(), Role::HandOver);
    // The first crossing, so that paths are kept from then on.
    watch.look(1, [seen(9, vec3(0.0, 0.0, 0.01))].into_iter());
    watch.look(2, [seen(9, vec3(0.0, 0.0, -0.01))].into_iter());
    // In at 0.29, out at 0.31 and in again at step 5; every second step is stored: 6, 8, 10.
    let heights = [0.29, 0.31, 0.28, 0.2, 0.15, 0.1, 0.05, 0.01, -0.01];
    let looks = follow(&mut watch, 3, &heights);
    assert_eq!(crossings(&looks), [8]);
    let crossing = crossing_of(&mut watch, 1);
    let places: Vec<f64> = crossing.path.iter().map(|motion| motion.position.z).collect();
    assert_eq!((crossing.step, crossing.path_start), (11, 6));
    assert_eq!(places, [0.2, 0.1, 0.01]);
}

#[test]
fn before_the_first_crossing_only_the_newest_motions_are_kept() {
    let mut watch = recorder(&gate(), Role::HandOver);
    let mut heights: Vec<f64> = (0..40).map(|index| 0.2 - 0.004 * f64::from(index)).collect();
    heights.extend([0.02, -0.01]);
    follow(&mut watch, 0, &heights);
    let crossing = crossing_of(&mut watch, 1);
    // Every second step, the last one 40; ghosts enter at step 32 at the latest, so that all are there at the release.
    assert_eq!((crossing.step, crossing.path_start, crossing.path.len()), (41, 40 - 2 * 17, 18));
    assert!(crossing.path_start <= 32);
    assert_eq!(crossing.path[17].position.z, 0.02);
}

#[test]
fn a_handing_over_run_freezes_and_excludes_and_a_whole_run_only_looks() {
    let constant = Gate { exclusion: Exclusion { mode: ExclusionMode::Constant, length: 0.2 }, ..gate() };
    let heights: Vec<f64> = (0..40).map(|index| 0.05 - 0.01 * f64::from(index)).collect();
    let looks = follow(&mut recorder(&constant, Role::HandOver), 0, &heights);
    let frozen: Vec<usize> = (0..40).filter(|&step| !looks[step].freeze.is_empty()).collect();
    let excluded: Vec<usize> = (0..40).filter(|&step| !looks[step].exclude.is_empty()).collect();
    assert_eq!(frozen, crossings(&looks));
    // z = -0.2 is reached at step 25; the next multiple of 32 is 32.
    assert_eq!(excluded, [32]);
    let mut watch = recorder(&gate(), Role::HandOver);
    let looks = follow(&mut watch, 0, &heights[..33]);
    assert!(looks.iter().all(|look| look.freeze.is_empty()), "a buffer freezes nothing");
    assert_eq!((watch.tally().excluded, watch.tally().still_in_run), (1, 0));
    let stern = Gate { returning: Fate::Error, sitting: Fate::Delete, ..constant };
    let mut watch = recorder(&stern, Role::Observe);
    let mut back = heights.clone();
    back.extend([0.1; 20]);
    let looks = follow(&mut watch, 0, &back);
    let quiet = |look: &Look| look.freeze.is_empty() && look.exclude.is_empty() && look.delete.is_empty();
    assert!(looks.iter().all(|look| quiet(look) && look.error.is_none()));
    assert_eq!((watch.tally().recorded, watch.tally().returned, watch.tally().excluded), (1, 1, 0));
}

#[test]
fn one_that_returns_or_sits_has_the_chosen_fate() {
    let back = [0.01, -0.01, 0.01, 0.03, 1.0];
    let looks = follow(&mut recorder(&Gate { returning: Fate::Error, ..gate() }, Role::HandOver), 13, &back);
    let text = looks[2].error.as_ref().unwrap();
    assert!(text.contains("gate \"outlet\": particle 1 of feed 3 came back") && text.contains("0.015 s"), "{text}");
    let mut watch = recorder(&Gate { returning: Fate::Delete, ..gate() }, Role::HandOver);
    let looks = follow(&mut watch, 29, &back);
    // Step 32 is the hand-over.
    assert_eq!(looks[3].delete, [id(1)]);
    assert_eq!((watch.tally().deleted, watch.tally().still_in_run), (1, 0));
    let mut watch = recorder(&gate(), Role::HandOver);
    follow(
        &mut watch,
        13,
        &[0.01, -0.01, 0.01, 0.5, 0.8, 0.9, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 5.0],
    );
    assert_eq!((watch.tally().returned, watch.tally().deleted), (1, 0));
    assert_relative_eq!(watch.tally().returned_farthest_m, 5.0);

    let mut watch = recorder(&Gate { sitting: Fate::Delete, ..gate() }, Role::HandOver);
    let looks = follow(&mut watch, 31, &[-0.05, -0.05, -0.05]);
    assert_eq!((&looks[0].delete, &looks[1].delete), (&vec![], &vec![id(1)]));
    assert_eq!((watch.tally().sitting_at_start, watch.tally().deleted), (1, 1));
    let looks = follow(&mut recorder(&Gate { sitting: Fate::Error, ..gate() }, Role::HandOver), 0, &[-0.05]);
    assert!(looks[0].error.as_ref().unwrap().contains("lies behind it at the start"));
    // Far behind the plane one is found at the next hand-over, and kept by default.
    let mut watch = recorder(&gate(), Role::HandOver);
    let looks = follow(&mut watch, 1, &[-0.9; 40]);
    assert!(looks.iter().all(|look| *look == Look::default()));
    assert_eq!((watch.tally().came_around, watch.tally().sitting_at_start), (1, 0));
}

#[test]
fn one_lost_behind_the_plane_is_counted_and_grazing_too() {
    let mut watch = recorder(&gate(), Role::HandOver);
    watch.look(1, [seen(1, vec3(0.0, 0.0, 0.01))].into_iter());
    let mut grazing = seen(1, vec3(0.0, 0.0, 0.0));
    grazing.motion.velocity = vec3(1.0, 0.0, 0.0);
    assert_eq!(watch.look(2, [grazing].into_iter()).crossed, [id(1)]);
    watch.count_removed([id(1), id(2)].into_iter());
    let tally = watch.tally();
    assert_eq!((tally.grazing, tally.lost_after_crossing, tally.still_in_run), (1, 1, 0));
}

#[test]
fn the_profile_tells_where_the_flow_is_free() {
    let mut watch = recorder(&gate(), Role::HandOver);
    let mut pressed = seen(2, vec3(0.0, 0.0, -0.03));
    pressed.motion.acceleration = GRAVITY * 0.5;
    watch.look(32, [seen(1, vec3(0.0, 0.0, -0.03)), pressed, seen(3, vec3(0.0, 0.0, -0.19))].into_iter());
    watch.look(33, [pressed].into_iter());
    let bins = watch.tally().free_flow;
    let found: Vec<(u64, f64)> = bins.iter().map(|bin| (bin.samples, bin.contact_share)).collect();
    assert_eq!(found, [(2, 0.5), (1, 0.0)]);
    let ballistic = Gate { exclusion: Exclusion { mode: ExclusionMode::Ballistic, length: 0.2 }, ..gate() };
    let mut watch = recorder(&ballistic, Role::HandOver);
    watch.look(32, [pressed].into_iter());
    assert!(watch.tally().free_flow.is_empty(), "ghosts tell nothing about the flow");
}

/// A crowd that goes up and down through the plane, one after the other.
fn crowd(step: u64) -> Vec<Seen> {
    (0..20)
        .map(|serial| {
            let phase = step as f64 * 0.013 + serial as f64 * 0.7;
            let mut one = seen(serial, vec3(0.06 * serial as f64, 0.0, 0.35 * phase.sin() + 0.05));
            one.motion.spin = vec3(phase, 1.0, 0.0);
            one
        })
        .collect()
}

#[test]
fn a_restored_recorder_goes_on_bit_for_bit() {
    let gate = Gate { returning: Fate::Delete, ..gate() };
    let look = |watch: &mut Recorder, step: u64| {
        let mut present = crowd(step);
        // The order in which a solver shows its particles is its own affair.
        if step.is_multiple_of(3) {
            present.reverse();
        }
        let look = watch.look(step, present.into_iter());
        let crossings: Vec<Crossing> = look.crossed.iter().map(|id| crossing_of(watch, id.serial())).collect();
        (look, crossings)
    };
    let mut whole = recorder(&gate, Role::HandOver);
    let found: Vec<_> = (0..900).map(|step| look(&mut whole, step)).collect();
    assert!(found.iter().map(|(_, crossings)| crossings.len()).sum::<usize>() > 10);
    for stop in [1, 100, 257, 512] {
        let mut first = recorder(&gate, Role::HandOver);
        (0..stop).for_each(|step| drop(look(&mut first, step)));
        let mut second = recorder(&gate, Role::HandOver);
        second.restore(&first.state()).unwrap();
        assert_eq!(second.state(), first.state());
        let rest: Vec<_> = (stop..900).map(|step| look(&mut second, step)).collect();
        assert!(rest == found[stop as usize..], "differs after a stop at {stop}");
        assert_eq!(second.tally(), whole.tally());
        assert_eq!(second.state(), whole.state());
    }
    let mut damaged = whole.state();
    damaged.reals[0].1.pop();
    assert!(recorder(&gate, Role::HandOver).restore(&damaged).is_err());
    assert!(recorder(&gate, Role::HandOver).restore(&RecorderState::default()).is_err());
}

#[test]
fn samples_that_lie_apart_give_the_same_crossings_as_all_time_steps() {
    // Free fall: the polynomial between two samples is the parabola.
    let cadence = Cadence { look: 20, hand_over: 100 };
    let timestep = 1e-5;
    let at = |step: u64| {
        let time = step as f64 * timestep;
        let mut one = seen(1, vec3(0.3 * time, 0.0, 0.004 - 0.5 * 9.81 * time * time));
        one.motion.velocity = vec3(0.3, 0.0, -9.81 * time);
        one
    };
    let gate = Gate { paths: Some(PathRecording { every: 30, length: 0.002 }), ..gate() };
    let run = |cadence: Cadence| {
        let mut watch = Recorder::new(&gate, Role::HandOver, GRAVITY, timestep, 0.004, cadence);
        // Somebody has passed before, so that paths are kept.
        watch.tally.recorded = 1;
        (0..).step_by(cadence.look as usize).find_map(|step| {
            let look = watch.look(step, [at(step)].into_iter());
            (!look.crossed.is_empty()).then(|| crossing_of(&mut watch, 1))
        })
    };
    let (coarse, fine) = (run(cadence).unwrap(), run(Cadence::NATIVE).unwrap());
    assert_eq!(coarse.step, fine.step.next_multiple_of(20));
    assert_relative_eq!(coarse.passage.time, fine.passage.time, epsilon = 1e-14);
    assert_relative_eq!((coarse.passage.position - fine.passage.position).norm(), 0.0, epsilon = 1e-14);
    assert_relative_eq!((coarse.passage.velocity - fine.passage.velocity).norm(), 0.0, epsilon = 1e-12);
    // Stored every 30 time steps, or every 40, where samples are.
    assert_eq!((fine.path_start % 30, coarse.path_start % 40), (0, 0));
    for (crossing, every) in [(&fine, 30), (&coarse, 40)] {
        for (motion, step) in crossing.path.iter().zip((crossing.path_start..).step_by(every)) {
            assert_eq!(*motion, at(step).motion);
        }
        let last = crossing.path_start + (crossing.path.len() as u64 - 1) * every as u64;
        assert!(last < crossing.step && last + every as u64 >= crossing.step);
    }
    assert_eq!(stored_paths(gate.paths, cadence).unwrap().every, 40);
    assert_eq!(stored_paths(gate.paths, Cadence::NATIVE), gate.paths);
}

#[test]
fn a_recorder_of_samples_hands_over_at_its_own_times_and_forgets_who_was_away() {
    let cadence = Cadence { look: 20, hand_over: 100 };
    let mut watch = Recorder::new(&gate(), Role::HandOver, GRAVITY, TIMESTEP, DIAMETER, cadence);
    let mut look = |step: u64, z: f64| watch.look(step, [seen(1, vec3(0.0, 0.0, z))].into_iter());
    assert!(look(0, 0.05).crossed.is_empty());
    assert_eq!(look(20, -0.05).crossed, [id(1)]);
    assert!(look(80, -0.3).exclude.is_empty(), "no hand-over");
    assert_eq!(look(100, -0.3).exclude, [id(1)]);
    // Seen before the plane, away for a sample, behind it: it did not pass here just now.
    let mut watch = Recorder::new(&gate(), Role::HandOver, GRAVITY, TIMESTEP, DIAMETER, cadence);
    watch.look(120, [seen(2, vec3(0.0, 0.0, 0.05))].into_iter());
    watch.look(140, std::iter::empty());
    assert!(watch.look(160, [seen(2, vec3(0.0, 0.0, -0.05))].into_iter()).crossed.is_empty());
    assert_eq!((watch.tally().recorded, watch.tally().came_around), (0, 1));
}
