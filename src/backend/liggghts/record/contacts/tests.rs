use super::*;
use std::fs;
use tempfile::TempDir;

/// Ours of a LIGGGHTS number: from 1 to 99.
fn id(tag: u32) -> Option<ParticleId> {
    (1..100).contains(&tag).then(|| ParticleId::new(0, u64::from(tag) - 1))
}

fn snapshot(name: &str, step: u64, rows: &[Vec<f64>]) -> String {
    let columns = rows.first().map_or(19, Vec::len);
    let names: String = (1..=columns).map(|column| format!("c_{name}[{column}] ")).collect();
    let lines = rows.iter().map(|row| row.iter().map(|x| format!("{x} ")).collect::<String>() + "\n");
    let head = format!("ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ENTRIES\n{}\n", rows.len());
    format!("{head}ITEM: BOX BOUNDS ff ff ff\n0 1\n0 1\n0 1\nITEM: ENTRIES {names}\n{}", lines.collect::<String>())
}

fn case(pairs: &[Vec<f64>], walls: &[Vec<f64>]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("contacts")).unwrap();
    let text = |name: &str, rows: &[Vec<f64>]| snapshot(name, 0, &[]) + &snapshot(name, 20, rows);
    fs::write(folder.path().join(PAIRS_FILE), text("pairs", pairs)).unwrap();
    fs::write(folder.path().join(WALLS_FILE), text("walls", walls)).unwrap();
    folder
}

fn open(folder: &TempDir, periods: [Option<f64>; 3]) -> Contacts {
    Contacts::new(folder.path(), vec![true, false], periods)
}

fn wanted(tag: u32, position: Vec3) -> Wanted {
    Wanted { tag, position, radius: 0.002 }
}

/// i = 3 at the origin, j = 7 beside it in x, overlap 0.1 mm; with `history`.
fn pair(history: &[f64]) -> Vec<f64> {
    let mut row = vec![0.0, 0.0, 0.0, 0.0039, 0.0, 0.0, 3.0, 7.0, 0.0, -2.0, 0.0, 0.0, 0.0, 0.5, 0.0];
    row.extend(history);
    row.push(1e-4);
    row
}

#[test]
fn a_pair_is_seen_from_either_side() {
    let folder = case(&[pair(&[1e-6, 2e-6, 3e-6, 4.0, 5.0, 6.0])], &[]);
    let both = [wanted(3, Vec3::zeros()), wanted(7, vec3(0.0039, 0.0, 0.0))];
    let found = open(&folder, [None; 3]).of(20, &both, &id).unwrap();
    let [(3, i), (7, j)] = found.as_slice() else { panic!("{found:?}") };
    assert_eq!(
        (i.partner, j.partner),
        (ContactPartner::Particle(id(7).unwrap()), ContactPartner::Particle(id(3).unwrap()))
    );
    assert_eq!((i.normal, j.normal), (vec3(1.0, 0.0, 0.0), vec3(-1.0, 0.0, 0.0)));
    // Half way through the overlap, one and the same point.
    let point = vec3(0.001_95, 0.0, 0.0);
    assert!((i.point - point).norm() < 1e-15 && (j.point - point).norm() < 1e-15);
    assert_eq!((i.overlap, j.overlap), (1e-4, 1e-4));
    assert_eq!((i.normal_force, i.tangential_force), (vec3(-2.0, 0.0, 0.0), vec3(0.0, 0.5, 0.0)));
    assert_eq!((i.tangential_memory, i.rolling_memory), (vec3(1e-6, 2e-6, 3e-6), vec3(4.0, 5.0, 6.0)));
    for (a, b) in [
        (i.normal_force, j.normal_force),
        (i.tangential_force, j.tangential_force),
        (i.tangential_memory, j.tangential_memory),
        (i.rolling_memory, j.rolling_memory),
    ] {
        assert_eq!(a, -b);
    }
    // Only the one that is asked for.
    let one = open(&folder, [None; 3]).of(20, &both[1..], &id).unwrap();
    assert_eq!(one, [(7, *j)]);
}

#[test]
fn what_the_model_remembers_is_told_by_the_columns() {
    for (history, tangential) in [(vec![], Vec3::zeros()), (vec![1.0, 2.0, 3.0], vec3(1.0, 2.0, 3.0))] {
        let folder = case(&[pair(&history)], &[]);
        let found = open(&folder, [None; 3]).of(20, &[wanted(3, Vec3::zeros())], &id).unwrap();
        assert_eq!((found[0].1.tangential_memory, found[0].1.rolling_memory), (tangential, Vec3::zeros()));
        assert_eq!(found[0].1.overlap, 1e-4);
    }
    let refused = |row: Vec<f64>| {
        let folder = case(&[row], &[]);
        open(&folder, [None; 3]).of(20, &[wanted(3, Vec3::zeros())], &id).unwrap_err().to_string()
    };
    assert!(refused(pair(&[1.0])).contains("16 and none, 3 or 6 of memory are known"));
    let with = |column: usize, value: f64| {
        let mut row = pair(&[]);
        row[column] = value;
        refused(row)
    };
    assert!(with(3, 0.0).contains("two particles lie in one place"));
    assert!(with(7, 400.0).contains("no particle has the number 400"));
    assert!(with(6, 3.5).contains("3.5 is no particle's number") && with(6, 0.0).contains("0 is no particle's number"));
}

#[test]
fn contacts_across_a_periodic_border_and_told_twice_are_one() {
    let mut across = pair(&[]);
    across[3] = -0.0961;
    let folder = case(&[across.clone(), across], &[]);
    let found = open(&folder, [Some(0.1), None, None]).of(20, &[wanted(3, Vec3::zeros())], &id).unwrap();
    assert_eq!(found.len(), 1);
    assert!((found[0].1.normal - vec3(1.0, 0.0, 0.0)).norm() < 1e-12);
}

#[test]
fn a_wall_is_a_part_and_its_triangle() {
    // Contact point below the centre of particle 3; mesh, triangle, particle; forces; memory; overlap.
    let row = |mesh: f64| {
        let mut row = vec![0.0, 0.0, -0.0019, 0.0, 0.0, 0.0, mesh, 12.0, 3.0, 0.0, 0.0, 4.0, 0.3, 0.0, 0.0];
        row.extend([7e-6, 0.0, 0.0, 1e-4]);
        row
    };
    let folder = case(&[pair(&[0.0; 3])], &[row(0.0), row(1.0)]);
    let found = open(&folder, [None; 3]).of(20, &[wanted(3, Vec3::zeros())], &id).unwrap();
    let partners: Vec<ContactPartner> = found.iter().map(|(_, contact)| contact.partner).collect();
    let parts = [(0, 12), (1, 0)].map(|(part, element)| ContactPartner::Part { part, element });
    assert_eq!(partners, [ContactPartner::Particle(id(7).unwrap()), parts[0], parts[1]]);
    let wall = &found[1].1;
    assert_eq!((wall.normal, wall.point), (vec3(0.0, 0.0, -1.0), vec3(0.0, 0.0, -0.0019)));
    assert_eq!((wall.normal_force, wall.tangential_force), (vec3(0.0, 0.0, 4.0), vec3(0.3, 0.0, 0.0)));
    assert_eq!((wall.tangential_memory, wall.overlap), (vec3(7e-6, 0.0, 0.0), 1e-4));
    let folder = case(&[], &[row(2.0)]);
    let text = open(&folder, [None; 3]).of(20, &[wanted(3, Vec3::zeros())], &id).unwrap_err().to_string();
    assert!(text.contains("mesh 2 is none of the 2 of the deck") && text.contains("walls"), "{text}");
}

#[test]
fn a_dump_without_the_time_step_of_a_crossing_is_refused() {
    let folder = case(&[], &[]);
    let mut contacts = open(&folder, [None; 3]);
    assert_eq!(contacts.of(20, &[wanted(3, Vec3::zeros())], &id).unwrap(), []);
    let text = contacts.of(40, &[wanted(3, Vec3::zeros())], &id).unwrap_err().to_string();
    assert!(text.contains("pairs") && text.contains("nothing of time step 40"), "{text}");
}

#[test]
fn what_a_deck_is_told_has_all_columns() {
    assert_eq!([history_numbers(true, false), history_numbers(true, true), history_numbers(false, false)], [3, 6, 0]);
    let text = dump_arguments("pairs", PAIR_COLUMNS + 3);
    assert!(text.starts_with("c_pairs[1] c_pairs[2]") && text.contains("c_pairs[19] modify append yes format '%.10g"));
    assert_eq!(text.matches("%.10g").count(), 19);
    let box_around = touch_box("fresh", 0.005, [true, false, true]);
    assert_eq!(box_around.matches("bound(").count(), 4);
    assert!(!box_around.contains("ymin") && box_around.contains("(z<=bound(fresh,zmax)+0.005)"), "{box_around}");
    let slab = touch_slab("2-z", 0.5, 0.25, 1.0);
    assert_eq!(slab, "((2-z)>=-1)*((2-z)<=1.75)");
}
