//! States of a bed on disk: LIGGGHTS dumps and data files, initial-state tables; and what is measured on them.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use tollgate::math::{Vec3, vec3};
use tollgate::particle::{ParticleId, ParticleState};

/// Reads a text dump with the columns id, density, x y z, vx vy vz, omegax omegay omegaz and diameter or radius.
pub fn read_dump(path: &Path) -> Vec<ParticleState> {
    let text = fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut lines = text.lines().rev();
    let mut rows: Vec<&str> = lines.by_ref().take_while(|line| !line.starts_with("ITEM: ATOMS")).collect();
    rows.reverse();
    let header = text.lines().rfind(|line| line.starts_with("ITEM: ATOMS")).expect("no frame in the dump");
    let names: Vec<&str> = header.split_whitespace().skip(2).collect();
    let column = |name: &str| names.iter().position(|&n| n == name);
    let needed = |name: &str| column(name).unwrap_or_else(|| panic!("no column {name} in {}", path.display()));
    let [id, density] = ["id", "density"].map(needed);
    let position = ["x", "y", "z"].map(needed);
    let velocity = ["vx", "vy", "vz"].map(needed);
    let spin = ["omegax", "omegay", "omegaz"].map(needed);
    let (size, scale) = column("radius").map_or_else(|| (needed("diameter"), 0.5), |radius| (radius, 1.0));
    let mut states: Vec<ParticleState> = rows
        .iter()
        .map(|row| {
            let cells: Vec<f64> = row.split_whitespace().map(|cell| cell.parse().expect("a number")).collect();
            let vector = |columns: [usize; 3]| vec3(cells[columns[0]], cells[columns[1]], cells[columns[2]]);
            ParticleState {
                id: ParticleId(cells[id] as u64),
                material: 0,
                radius: scale * cells[size],
                density: cells[density],
                position: vector(position),
                velocity: vector(velocity),
                spin: vector(spin),
            }
        })
        .collect();
    states.sort_by_key(|state| state.id);
    for state in &states {
        let parts = [state.position, state.velocity, state.spin];
        assert!(parts.iter().all(|v| v.iter().all(|x| x.is_finite())), "{} holds {state:?}", path.display());
    }
    states
}

/// Writes the data file that LIGGGHTS' `read_data` takes, to the last bit (17 digits).
pub fn write_liggghts(path: &Path, states: &[ParticleState], size: &Vec3) {
    let mut text = format!("bed of {} spheres\n\n{0} atoms\n1 atom types\n\n", states.len());
    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
        let _ = writeln!(text, "0 {:e} {name}lo {name}hi", size[axis]);
    }
    text.push_str("\nAtoms\n\n");
    for (number, state) in (1..).zip(states) {
        let (d, p) = (2.0 * state.radius, &state.position);
        let _ = writeln!(text, "{number} 1 {d:.17e} {:.17e} {:.17e} {:.17e} {:.17e}", state.density, p.x, p.y, p.z);
    }
    text.push_str("\nVelocities\n\n");
    for (number, state) in (1..).zip(states) {
        let (v, w) = (&state.velocity, &state.spin);
        let _ =
            writeln!(text, "{number} {:.17e} {:.17e} {:.17e} {:.17e} {:.17e} {:.17e}", v.x, v.y, v.z, w.x, w.y, w.z);
    }
    fs::write(path, text).unwrap();
}

/// Writes the initial-state table that a scene's `file` feed takes; numbers in the shortest form that reads back exactly.
pub fn write_table(path: &Path, states: &[ParticleState]) {
    let mut text = "id,material,x_m,y_m,z_m,radius_m,vx_m_per_s,vy_m_per_s,vz_m_per_s,\
                    wx_rad_per_s,wy_rad_per_s,wz_rad_per_s,density_kg_per_m3\n"
        .to_owned();
    for (number, s) in states.iter().enumerate() {
        let (p, v, w) = (&s.position, &s.velocity, &s.spin);
        let _ = writeln!(
            text,
            "{number},grain,{:e},{:e},{:e},{:e},{:e},{:e},{:e},{:e},{:e},{:e},{:e}",
            p.x, p.y, p.z, s.radius, v.x, v.y, v.z, w.x, w.y, w.z, s.density
        );
    }
    fs::write(path, text).unwrap();
}

/// What is compared of two beds.
#[derive(Debug, Clone, Copy)]
pub struct Measures {
    /// Pairs of spheres that overlap.
    pub contacts: f64,
    /// Their mean overlap [m].
    pub mean_overlap: f64,
    /// Of the centres [J].
    pub kinetic_energy: f64,
    /// Of the spins [J].
    pub rotational_energy: f64,
}

/// Measures a bed from positions and velocities alone, the same way whoever computed it.
pub fn measure(states: &[ParticleState]) -> Measures {
    let cell = 2.0 * states.iter().map(|s| s.radius).fold(0.0, f64::max);
    let key = |p: &Vec3| p.map(|x| (x / cell).floor() as i64);
    let mut cells: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    for (index, state) in states.iter().enumerate() {
        cells.entry(key(&state.position).into()).or_default().push(index);
    }
    let (mut contacts, mut overlaps) = (0.0, 0.0);
    for (index, state) in states.iter().enumerate() {
        let home = key(&state.position);
        for neighbour in 0..27_i64 {
            let shift = [neighbour % 3 - 1, neighbour / 3 % 3 - 1, neighbour / 9 - 1];
            let place = [home[0] + shift[0], home[1] + shift[1], home[2] + shift[2]];
            for &other in cells.get(&place).into_iter().flatten().filter(|&&other| other > index) {
                let overlap = state.radius + states[other].radius - (state.position - states[other].position).norm();
                if overlap > 0.0 {
                    contacts += 1.0;
                    overlaps += overlap;
                }
            }
        }
    }
    let mass = |s: &ParticleState| 4.0 / 3.0 * std::f64::consts::PI * s.radius.powi(3) * s.density;
    Measures {
        contacts,
        mean_overlap: overlaps / contacts,
        kinetic_energy: states.iter().map(|s| 0.5 * mass(s) * s.velocity.norm_squared()).sum(),
        rotational_energy: states.iter().map(|s| 0.2 * mass(s) * s.radius.powi(2) * s.spin.norm_squared()).sum(),
    }
}
