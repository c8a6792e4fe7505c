//! Memory that a particle takes, the whole program seen from outside.

use super::common::Bench;
use std::fmt::Write as _;
use std::fs;

const SCENE: &str = r#"
[domain]
min_mm = [0, 0, 0]
max_mm = [200, 200, 200]

[[feed]]
name = "lattice"
kind = "file"
file = "lattice.csv"

[solver.models]
rolling_resistance = false

[end]
time = "1 ms"

[output]
frames = "0.1 ms"
series = "1 ms"
checkpoints = "0.2 ms"
"#;

/// Spheres of 4 mm that touch their six neighbours, all on their way at 2 m/s: 2 mm in a run, so that lists are made anew, more
/// than once for any skin up to their radius, while frames are written.
fn lattice(edge: u32) -> String {
    let mut table = "x_m,y_m,z_m,radius_m,vz_m_per_s,material\n".to_owned();
    for index in 0..edge.pow(3) {
        let [x, y, z] =
            [index % edge, index / edge % edge, index / edge.pow(2)].map(|n| (f64::from(n) + 0.5) * 0.999 * 4e-3);
        writeln!(table, "{x:?},{y:?},{z:?},2e-3,2,glass").unwrap();
    }
    table
}

/// Bytes by `docs/theory/memory.md` with 3 pairs a particle in both lists and 3 contacts, and an eighth of the pairs twice, as they
/// cross between chunks: what is held all the time; then the most of what is there for a moment.
fn bytes_per_particle() -> f64 {
    let pairs = 3.0 * 1.125;
    let particle = 32.0 + 3.0 * 64.0 + 8.0 + 8.0;
    let (references, cells, start) = (48.0, 25.0, 104.0);
    let (outer, inner) = (12.0 * pairs, 2.0 * 52.0 * pairs);
    let held = particle + references + cells + start + outer + inner;
    let (frame, memories) = (2.0 * 104.0 + 24.0 + 4.0, 2.0 * 3.0 * 56.0 + 8.0);
    let checkpoint = (30.0 + 3.0) * 8.0 + 48.0 * pairs;
    held + f64::max(frame + memories, checkpoint)
}

#[test]
fn a_particle_takes_no_more_memory_than_its_arrays_say() {
    let bench = Bench::with(&[SCENE]);
    let peak = |edge: u32, out: &str| {
        fs::write(bench.path("lattice.csv"), lattice(edge)).unwrap();
        let summary = bench.run(out, &["--set", "solver.timestep=20 us"]);
        assert_eq!(summary.number("/stages/0/particles"), f64::from(edge.pow(3)));
        summary.number("/stages/0/peak_memory_bytes")
    };
    // The difference: what the program takes by itself does not count.
    let (small, large) = (20, 34);
    let bytes = (peak(large, "large") - peak(small, "small")) / f64::from(large.pow(3) - small.pow(3));
    // Lists that grow take up to twice their length, and the allocator keeps what it gets back.
    let bound = 1.25 * bytes_per_particle();
    assert!(bytes < bound, "{bytes:.0} bytes a particle, {bound:.0} by the arrays");
    // Less than half of it would mean that the run did not do what it is here for.
    assert!(bytes > 0.5 * bytes_per_particle(), "{bytes:.0} bytes a particle, {bound:.0} by the arrays");
}
