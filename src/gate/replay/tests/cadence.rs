//! Stages that look at their gates every few time steps only.

use super::*;

const EVERY_FIVE: Cadence = Cadence { look: 5, hand_over: 20 };

fn case(path: PathMode, same_backend: bool) -> Case {
    let mut case = Case::new(crossings(), Replay { path, ..replay() });
    case.stage.cadence = EVERY_FIVE;
    case.same_backend = same_backend;
    case
}

/// The stream as a solver records it that looks every five steps: the grid state is the first one of those behind the plane.
fn at_looks(mut crossings: Vec<Crossing>) -> Vec<Crossing> {
    for crossing in &mut crossings {
        let step = crossing.step.next_multiple_of(EVERY_FIVE.look);
        let there = falling(crossing.passage.time, 1.0, step as f64 * DT);
        (crossing.state.position, crossing.state.velocity) = (there.position, there.velocity);
        crossing.step = step;
    }
    crossings
}

#[test]
fn a_release_waits_for_the_first_look_and_is_moved_on_to_it() {
    for path in [PathMode::Constant, PathMode::Ballistic, PathMode::Recorded] {
        let case = case(path, false);
        let mut replayer = case.open();
        assert!(!replayer.is_exact());
        let log = run(&mut replayer, 0, 800);
        assert_eq!((log.releases.len(), replayer.is_finished()), (60, true));
        for crossing in &case.crossings {
            let id = crossing.state.id;
            let ((step, release), (entered, entry)) = (&log.releases[&id], &log.entries[&id]);
            assert_eq!((step % 5, entered % 20, release.exact), (0, 0, false));
            let time = *step as f64 * DT;
            assert!((0.0..5.0 * DT).contains(&(time - crossing.passage.time)), "{time}");
            // All of these fall freely.
            let there = falling(crossing.passage.time, 1.0, time);
            assert_relative_eq!(release.state.position, there.position, epsilon = 1e-14);
            assert_relative_eq!(release.state.velocity, there.velocity, epsilon = 1e-13);
            // A solver that moves the ghost by itself ends in the very state of the release.
            let way = time - *entered as f64 * DT;
            let (position, velocity) = (entry.motion.position, entry.motion.velocity);
            match path {
                PathMode::Constant => {
                    assert_eq!(velocity, release.state.velocity);
                    assert_relative_eq!(position + velocity * way, release.state.position, epsilon = 1e-15);
                }
                PathMode::Ballistic => {
                    let end = position + velocity * way + GRAVITY * (0.5 * way * way);
                    assert_relative_eq!(end, release.state.position, epsilon = 1e-15);
                    assert_relative_eq!(velocity + GRAVITY * way, release.state.velocity, epsilon = 1e-15);
                }
                _ => {}
            }
            // Up to 20 steps before the generation plane.
            assert!((LENGTH - 1e-12..LENGTH + 0.02 * 1.2).contains(&position.z), "{path:?}: entered at {}", position.z);
        }
    }
}

#[test]
fn grid_states_of_the_same_backend_at_looks_come_back_to_the_bit_in_every_loop() {
    for path in [PathMode::Constant, PathMode::Ballistic, PathMode::Recorded] {
        let mut case = case(path, true);
        case.crossings = at_looks(crossings());
        case.replay.loops = 3;
        case.replay.gap = 0.0123;
        case.replay.clock = Clock::FirstPassage;
        let mut replayer = case.open();
        assert!(replayer.is_exact());
        let log = run(&mut replayer, 0, 3000);
        assert_eq!(log.releases.len(), 180);
        for (id, (step, release)) in &log.releases {
            let crossing = case.crossings.iter().find(|crossing| crossing.state.id.serial() == id.serial()).unwrap();
            assert_eq!((step % 5, release.exact), (0, true));
            assert_eq!(release.state.position, crossing.state.position);
            assert_eq!(release.state.velocity, crossing.state.velocity);
        }
    }
}

#[test]
fn grid_states_between_looks_are_moved_on_under_their_force() {
    let mut case = case(PathMode::Recorded, true);
    let push = vec3(0.3, 0.0, 0.0);
    case.crossings.iter_mut().for_each(|crossing| crossing.force = push);
    let mut replayer = case.open();
    assert!(!replayer.is_exact(), "not all releases are grid states");
    let log = run(&mut replayer, 0, 800);
    let mass = Body::Sphere.mass(RADIUS, 2000.0);
    let mut stored = 0;
    for crossing in &case.crossings {
        let (step, release) = &log.releases[&crossing.state.id];
        assert_eq!(*step, crossing.step.next_multiple_of(5));
        assert_eq!(release.exact, crossing.step.is_multiple_of(5));
        stored += u64::from(release.exact);
        let later = (step - crossing.step) as f64 * DT;
        let acceleration = GRAVITY + push / mass;
        let place = crossing.state.position + crossing.state.velocity * later + acceleration * (0.5 * later * later);
        assert_relative_eq!(release.state.position, place, epsilon = 1e-15);
        assert_relative_eq!(release.state.velocity, crossing.state.velocity + acceleration * later, epsilon = 1e-15);
        assert_eq!(release.force, push);
    }
    assert!((1..60).contains(&stored), "{stored}");
}

#[test]
fn a_ghost_s_motion_leads_to_its_release() {
    let case = case(PathMode::Recorded, false);
    let mut replayer = case.open();
    let log = run(&mut case.open(), 0, 800);
    for step in (0..=800).step_by(5) {
        let due = replayer.due(step).unwrap();
        for id in replayer.ghosts() {
            let (release, wanted) = &log.releases[&id];
            let next = replayer.motion_to_release(id, step + 5).unwrap();
            if *release == step + 5 {
                assert_eq!((next.position, next.velocity), (wanted.state.position, wanted.state.velocity));
            } else {
                assert_eq!(Some(next), replayer.motion(id, step + 5));
            }
        }
        for release in due.release {
            assert_eq!(replayer.motion_to_release(release.state.id, step), None, "no ghost any more");
        }
    }
}
