use super::*;
use proptest::prelude::*;
use std::fs;

/// A sample as LIGGGHTS writes it: values by rank.
pub fn file(step: i64, ranks: &[Vec<[f64; WIDTH]>]) -> Vec<u8> {
    let particles: usize = ranks.iter().map(Vec::len).sum();
    let mut bytes = Vec::new();
    bytes.extend(step.to_le_bytes());
    bytes.extend((particles as i64).to_le_bytes());
    bytes.extend(0_i32.to_le_bytes());
    (0..6).for_each(|_| bytes.extend(1_i32.to_le_bytes()));
    [-0.1, 0.1, -0.1, 0.1, 0.0, 0.2].iter().for_each(|bound: &f64| bytes.extend(bound.to_le_bytes()));
    bytes.extend((WIDTH as i32).to_le_bytes());
    bytes.extend((ranks.len() as i32).to_le_bytes());
    for rows in ranks {
        bytes.extend(((rows.len() * WIDTH) as i32).to_le_bytes());
        rows.iter().flatten().for_each(|value| bytes.extend(value.to_le_bytes()));
    }
    bytes
}

fn particle(tag: u32) -> [f64; WIDTH] {
    std::array::from_fn(|column| match column {
        0 => f64::from(tag),
        1 => f64::from(1 + tag % 2),
        2 => 0.002 + 1e-6 * f64::from(tag),
        3 => 3300.0,
        _ => (f64::from(tag) * 7.3 + column as f64).sin(),
    })
}

fn read(bytes: &[u8], step: u64) -> Result<Sample, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("20.bin");
    fs::write(&path, bytes).unwrap();
    let mut sample = Sample::default();
    sample.read(&path, step).map_err(|error| error.to_string())?;
    Ok(sample)
}

#[test]
fn the_columns_are_those_of_the_decks() {
    let names: Vec<&str> = COLUMNS.split(' ').collect();
    assert_eq!(names.len(), WIDTH);
    let first = ["id", "type", "radius", "density", "x"];
    assert_eq!(names[..5], first);
    assert_eq!([names[7], names[10], names[13], names[16]], ["vx", "omegax", "fx", "tqx"]);
}

#[test]
fn rows_of_all_ranks_come_with_their_bits() {
    let ranks = [vec![particle(3), particle(1)], vec![], vec![particle(2)]];
    let sample = read(&file(20, &ranks), 20).unwrap();
    let rows: Vec<Row> = sample.rows().collect();
    assert_eq!(rows.iter().map(|row| (row.tag, row.kind)).collect::<Vec<_>>(), [(3, 2), (1, 2), (2, 1)]);
    for (row, values) in rows.iter().zip(ranks.iter().flatten()) {
        let found = [row.position, row.velocity, row.spin, row.force, row.torque];
        let found: Vec<u64> = found.iter().flat_map(|vector| vector.iter().map(|x| x.to_bits())).collect();
        assert_eq!(found, values[4..].iter().map(|x| x.to_bits()).collect::<Vec<_>>());
        assert_eq!((row.radius, row.density), (values[2], values[3]));
    }
    assert_eq!(read(&file(0, &[vec![]]), 0).unwrap().rows().count(), 0);
}

#[test]
fn a_file_cut_at_any_byte_is_refused_with_that_byte() {
    let whole = file(20, &[vec![particle(1), particle(2)], vec![particle(3)]]);
    for length in 0..whole.len() {
        let text = read(&whole[..length], 20).unwrap_err();
        assert!(text.contains(&format!("ends at byte {length}")), "{length}: {text}");
        assert!(text.contains("20.bin") && text.contains("run the stage again"), "{text}");
    }
    let mut longer = whole;
    longer.push(0);
    assert!(read(&longer, 20).unwrap_err().contains("half written or damaged"));
}

#[test]
fn what_is_no_sample_is_refused_with_its_place() {
    let whole = file(20, &[vec![particle(1)]]);
    assert!(read(&whole, 40).unwrap_err().contains("of time step 20"));
    assert!(read(b"ITEM: TIMESTEP\n20\n", 20).unwrap_err().contains("within its header"));
    assert!(read(&[b' '; 4000], 20).unwrap_err().contains("another kind of file"));
    let with = |at: usize, bytes: &[u8]| {
        let mut changed = whole.clone();
        changed[at..at + bytes.len()].copy_from_slice(bytes);
        read(&changed, 20).unwrap_err()
    };
    let byte = |at: usize| HEADER + 4 + 8 * at;
    for (at, bytes, expected) in [
        (8, (-1_i64).to_le_bytes().to_vec(), "number of particles -1 at byte 8"),
        (8, i64::MAX.to_le_bytes().to_vec(), "more than any file"),
        (8, (1_i64 << 40).to_le_bytes().to_vec(), "particles need"),
        (16, 1_i32.to_le_bytes().to_vec(), "at byte 16"),
        (24, 9_i32.to_le_bytes().to_vec(), "at byte 24"),
        (HEADER - 8, 18_i32.to_le_bytes().to_vec(), "columns 18 instead of 19"),
        (HEADER - 4, 0_i32.to_le_bytes().to_vec(), "number of ranks 0"),
        (HEADER - 4, i32::MAX.to_le_bytes().to_vec(), "half written or damaged"),
        (HEADER, i32::MAX.to_le_bytes().to_vec(), "claims 2147483647 values"),
        (HEADER, (-19_i32).to_le_bytes().to_vec(), "claims -19 values"),
        (HEADER, (19 * 1000_i32).to_le_bytes().to_vec(), "within the values of rank 0"),
        (HEADER, 0_i32.to_le_bytes().to_vec(), "claims 1 particles and holds 0"),
        (byte(5), f64::NAN.to_le_bytes().to_vec(), "y of particle 1 is NaN"),
        (byte(0), 1.5_f64.to_le_bytes().to_vec(), "id 1.5"),
        (byte(1), 0.0_f64.to_le_bytes().to_vec(), "type 0"),
        (byte(2), 0.0_f64.to_le_bytes().to_vec(), "a radius of 0 m"),
    ] {
        let text = with(at, &bytes);
        assert!(text.contains(expected), "{expected:?} is not in {text:?}");
    }
    let missing = Sample::default().read(Path::new("/nowhere/20.bin"), 20).unwrap_err().to_string();
    assert!(missing.contains("/nowhere/20.bin"), "{missing}");
}

proptest! {
    #[test]
    fn no_bytes_make_it_panic_or_grow(bytes in proptest::collection::vec(any::<u8>(), 0..600), step in 0_u64..3) {
        prop_assert!(read(&bytes, step).is_err());
    }

    #[test]
    fn one_changed_byte_is_refused_or_changes_one_number(at in 0_usize..600, to in any::<u8>()) {
        let whole = file(20, &[vec![particle(1), particle(2)], vec![particle(3)]]);
        let mut changed = whole.clone();
        let at = at % whole.len();
        changed[at] = to;
        if let Ok(sample) = read(&changed, 20) {
            let (old, new) = (read(&whole, 20).unwrap(), sample);
            let differing = old.rows().zip(new.rows()).filter(|(old, new)| old != new).count();
            prop_assert!(differing <= 1);
        }
    }
}
