//! The stream as a whole: what is written is read, and whatever is touched is noticed.

use super::columns::{columns, from_columns};
use super::format::{FORMAT_MAJOR, Manifest, chunk_file};
use super::reader::StreamReader;
use super::sample::{closing, crossing, origin, write};
use super::writer::{CHUNK_CROSSINGS, CHUNK_MOTIONS, StreamWriter};
use crate::exit_code;
use crate::gate::crossing::Crossing;
use crate::geometry::plane::Aperture;
use crate::storage::columns::{ColumnReader, ColumnWriter, read_all};
use crate::storage::{Column, StorageError};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Crossings of two whole chunks and a part of a third.
const THREE_CHUNKS: u64 = 2 * CHUNK_CROSSINGS as u64 + 100;

fn all(place: &Path) -> Vec<Crossing> {
    StreamReader::open(place).unwrap().crossings().collect::<Result<_, _>>().unwrap()
}

/// Every file of a folder with its bytes.
fn files(place: &Path) -> BTreeMap<String, Vec<u8>> {
    let file = |entry: fs::DirEntry| (entry.file_name().into_string().unwrap(), fs::read(entry.path()).unwrap());
    fs::read_dir(place).unwrap().map(|entry| file(entry.unwrap())).collect()
}

#[test]
fn what_is_written_is_read_to_the_last_bit() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("outlet");
    let manifest = write(&place, THREE_CHUNKS);
    let reader = StreamReader::open(&place).unwrap();
    assert_eq!(*reader.manifest(), manifest);
    assert_eq!(reader.chunk_count(), 3);
    assert!(all(&place).into_iter().eq((0..THREE_CHUNKS).map(crossing)));
    let mut chunks = Vec::new();
    let checked = reader.verify(|done| chunks.push(done)).unwrap();
    assert_eq!((chunks, checked.counts), (vec![1, 2, 3], manifest.counts));
    let contacts: usize = (0..THREE_CHUNKS).map(|index| crossing(index).contacts.len()).sum();
    assert_eq!(manifest.counts.contacts, contacts as u64);
}

#[test]
fn a_stream_without_crossings_is_a_stream() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("outlet");
    write(&place, 0);
    let checked = StreamReader::open(&place).unwrap().verify(|_| {}).unwrap();
    assert_eq!((checked.chunks, checked.counts.range), (0, None));
}

#[test]
fn it_is_absent_until_it_is_whole_and_never_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("outlet");
    let mut writer = StreamWriter::create(&place, origin()).unwrap();
    (0..10).for_each(|index| writer.push(crossing(index)).unwrap());
    let error = StreamReader::open(&place).unwrap_err();
    assert!(error.to_string().contains("has not finished it"), "{error}");
    assert_eq!(error.exit_code(), exit_code::STREAM_UNUSABLE);
    writer.finish(closing()).unwrap();
    assert_eq!(all(&place).len(), 10);
    let error = StreamWriter::create(&place, origin()).unwrap_err();
    assert!(error.to_string().contains("it is there already"), "{error}");
}

#[test]
fn long_paths_seal_a_chunk_before_many_crossings_do() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = StreamWriter::create(&folder.path().join("outlet"), origin()).unwrap();
    let mut long = crossing(0);
    (long.step, long.path_start) = (1_000_000, 0);
    long.path = vec![long.path[0]; CHUNK_MOTIONS / 2];
    for serial in 0..3 {
        long.state.id = crossing(serial).state.id;
        writer.push(long.clone()).unwrap();
    }
    assert_eq!((writer.sealed(), writer.pending().len(), writer.crossings()), (1, 1, 3));
}

#[test]
fn a_resumed_stream_has_the_bytes_of_an_undisturbed_one() {
    let folder = tempfile::tempdir().unwrap();
    let undisturbed = folder.path().join("undisturbed");
    write(&undisturbed, THREE_CHUNKS);
    let reference = files(&undisturbed);
    let saved_at = CHUNK_CROSSINGS as u64 + 50;
    for killed_at in [saved_at, saved_at + 3, 2 * CHUNK_CROSSINGS as u64 + 1, THREE_CHUNKS] {
        let place = folder.path().join(format!("killed at {killed_at}"));
        let mut writer = StreamWriter::create(&place, origin()).unwrap();
        (0..saved_at).for_each(|index| writer.push(crossing(index)).unwrap());
        let saved = columns(writer.pending());
        let sealed = writer.sealed();
        (saved_at..killed_at).for_each(|index| writer.push(crossing(index)).unwrap());
        if killed_at == THREE_CHUNKS {
            writer.finish(closing()).unwrap();
        } else {
            fs::write(
                folder.path().join(format!("killed at {killed_at}.staging/chunk-000007.columns.staging")),
                b"half",
            )
            .unwrap();
        }
        let mut saved: BTreeMap<String, Column> =
            saved.into_iter().map(|(name, column)| (format!("outlet.{name}"), column)).collect();
        let pending = from_columns(Path::new("state.checkpoint"), &mut saved, "outlet.").unwrap();
        assert!(saved.is_empty());
        let mut writer = StreamWriter::resume(&place, origin(), sealed, pending).unwrap();
        assert!(!place.exists());
        (saved_at..THREE_CHUNKS).for_each(|index| writer.push(crossing(index)).unwrap());
        writer.finish(closing()).unwrap();
        assert!(files(&place) == reference, "killed at {killed_at}");
    }
}

#[test]
fn a_stream_is_not_resumed_over_a_damaged_chunk() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("outlet");
    write(&place, THREE_CHUNKS);
    flip(&place.join(chunk_file(0)), "position", 100);
    let error = StreamWriter::resume(&place, origin(), 1, vec![]).unwrap_err();
    assert!(error.to_string().contains(r#"column "position" was edited"#), "{error}");
    let error = StreamWriter::resume(&place, origin(), 4, vec![]).unwrap_err();
    assert_eq!(error.exit_code(), exit_code::STREAM_UNUSABLE);
}

#[test]
fn what_cannot_be_is_not_taken() {
    let folder = tempfile::tempdir().unwrap();
    type Spoil = fn(&mut Crossing);
    let cases: [(&str, Spoil); 8] = [
        ("does not follow step", |c| c.step = 3),
        ("is not positive", |c| c.state.radius = 0.0),
        ("is none of the 2 stored", |c| c.state.material = 2),
        ("there are names of 2", |c| {
            c.contacts[1].partner = crate::gate::crossing::ContactPartner::Part { part: 2, element: 0 };
        }),
        ("is with itself", |c| c.contacts[0].partner = crate::gate::crossing::ContactPartner::Particle(c.state.id)),
        ("not of unit length", |c| c.contacts[0].normal *= 1.1),
        ("ends after step", |c| c.path_start += 3),
        ("not a finite number", |c| c.torque.y = f64::NAN),
    ];
    for (number, (words, spoil)) in cases.into_iter().enumerate() {
        let mut writer = StreamWriter::create(&folder.path().join(number.to_string()), origin()).unwrap();
        writer.push(crossing(7)).unwrap();
        let mut spoiled = crossing(8);
        spoil(&mut spoiled);
        let error = writer.push(spoiled).and_then(|()| writer.finish(closing())).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
        assert_eq!(error.exit_code(), exit_code::BUG);
    }
}

/// Flips the lowest bit of a byte of the column `name`.
fn flip(path: &Path, name: &str, byte: u64) {
    let reader = ColumnReader::open(path, "stream chunk").unwrap();
    let entry = reader.columns().iter().find(|entry| entry.name == name).unwrap().clone();
    let mut bytes = fs::read(path).unwrap();
    let header = u64::from_le_bytes(bytes[8..16].try_into().unwrap());
    bytes[(48 + header + entry.offset + byte) as usize] ^= 1;
    fs::write(path, bytes).unwrap();
}

/// Writes the chunk again with the change made to its columns, digests and all.
fn forge(path: &Path, change: impl FnOnce(&mut BTreeMap<String, Column<'static>>)) {
    let reader = ColumnReader::open(path, "stream chunk").unwrap();
    let names: Vec<String> = reader.columns().iter().map(|entry| entry.name.clone()).collect();
    let mut all = read_all(&reader).unwrap();
    change(&mut all);
    let mut writer = ColumnWriter::new("stream chunk");
    for name in names {
        writer.column(&name, all.remove(&name).unwrap());
    }
    writer.write(path).unwrap();
}

fn edit_manifest(place: &Path, from: &str, to: &str) {
    let path = place.join("manifest.json");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{from}");
    fs::write(path, text.replacen(from, to, 1)).unwrap();
}

#[test]
fn whatever_is_touched_is_noticed_and_named() {
    type Touch = fn(&Path);
    let cases: [(&str, Touch); 14] = [
        (r#"chunk-000001.columns: column "normal_force" was edited"#, |place| {
            flip(&place.join(chunk_file(1)), "normal_force", 24 * 40);
        }),
        (r#"chunk-000000.columns: column "position" was edited"#, |place| {
            flip(&place.join(chunk_file(0)), "position", 24 * 8000 + 7);
        }),
        ("chunk-000002.columns: it is truncated", |place| {
            let bytes = fs::read(place.join(chunk_file(2))).unwrap();
            fs::write(place.join(chunk_file(2)), &bytes[..bytes.len() - 1]).unwrap();
        }),
        ("chunk-000001.columns: it has ", |place| {
            let mut bytes = fs::read(place.join(chunk_file(1))).unwrap();
            bytes.push(0);
            fs::write(place.join(chunk_file(1)), bytes).unwrap();
        }),
        ("its chunk chunk-000001.columns is missing", |place| fs::remove_file(place.join(chunk_file(1))).unwrap()),
        ("chunk-000003.columns does not belong to it", |place| {
            fs::copy(place.join(chunk_file(2)), place.join(chunk_file(3))).map(drop).unwrap();
        }),
        ("chunk-000000.columns: its size is that of chunk-000001.columns: files were swapped", |place| {
            swap(&place.join(chunk_file(0)), &place.join(chunk_file(1)));
        }),
        ("chunk-000000.columns: it holds other crossings than were recorded", |place| {
            forge(&place.join(chunk_file(0)), |columns| {
                let Some(Column::Vec3(force)) = columns.get_mut("force") else { panic!() };
                force.to_mut()[5].x *= 2.0;
            });
        }),
        ("manifest.json: it was edited", |place| {
            edit_manifest(place, "\"timestep\": 0.00001", "\"timestep\": 0.00002")
        }),
        ("manifest.json: it was edited", |place| edit_manifest(place, "\"mass\": ", "\"mass\": 1")),
        ("it is not the manifest of a tollgate stream", |place| {
            edit_manifest(place, "tollgate stream", "other stream")
        }),
        ("it cannot be understood", |place| edit_manifest(place, "{", "")),
        ("it has format 2.0 of tollgate", |place| edit_manifest(place, "\"format_major\": 1", "\"format_major\": 2")),
        ("it has no manifest.json", |place| fs::remove_file(place.join("manifest.json")).unwrap()),
    ];
    let folder = tempfile::tempdir().unwrap();
    let reference = folder.path().join("reference");
    write(&reference, THREE_CHUNKS);
    let reference = files(&reference);
    for (number, (words, touch)) in cases.into_iter().enumerate() {
        let place = folder.path().join(number.to_string());
        fs::create_dir(&place).unwrap();
        reference.iter().for_each(|(name, bytes)| fs::write(place.join(name), bytes).unwrap());
        StreamReader::open(&place).and_then(|reader| reader.verify(|_| {})).unwrap();
        touch(&place);
        let error = StreamReader::open(&place).and_then(|reader| reader.verify(|_| {})).unwrap_err();
        assert!(error.to_string().contains(words), "{words}\n{error}");
        assert_eq!(error.exit_code(), exit_code::STREAM_UNUSABLE);
    }
}

fn swap(a: &Path, b: &Path) {
    let (first, second) = (fs::read(a).unwrap(), fs::read(b).unwrap());
    fs::write(a, second).unwrap();
    fs::write(b, first).unwrap();
}

#[test]
fn swapped_chunks_of_one_size_are_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("outlet");
    let mut writer = StreamWriter::create(&place, origin()).unwrap();
    for index in 0..2 * CHUNK_CROSSINGS as u64 {
        let bare = Crossing { contacts: vec![], path: vec![], path_start: 0, ..crossing(index) };
        writer.push(bare).unwrap();
    }
    let manifest = writer.finish(closing()).unwrap();
    assert_eq!(manifest.chunks[0].bytes, manifest.chunks[1].bytes);
    swap(&place.join(chunk_file(0)), &place.join(chunk_file(1)));
    let error = StreamReader::open(&place).and_then(|reader| reader.verify(|_| {})).unwrap_err();
    let words = "chunk-000000.columns: it holds the crossings of chunk-000001.columns: files were swapped";
    assert!(error.to_string().contains(words), "{error}");
}

#[test]
fn a_future_minor_version_is_read_and_unknown_fields_are_let_be() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("outlet");
    let manifest = write(&place, 20);
    let mut value = serde_json::to_value(&manifest).unwrap();
    value["format_minor"] = 7.into();
    value["weather"] = "fine".into();
    value["blake3"] = blake3::hash(value.to_string().as_bytes()).to_hex().to_string().into();
    fs::write(place.join("manifest.json"), value.to_string()).unwrap();
    let reader = StreamReader::open(&place).unwrap();
    assert_eq!((reader.manifest().format_major, reader.manifest().format_minor), (FORMAT_MAJOR, 7));
    reader.verify(|_| {}).unwrap();
    assert_eq!(reader.manifest().digest(), manifest.digest());
}

#[test]
fn crossings_that_come_twice_are_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("outlet");
    let mut writer = StreamWriter::create(&place, origin()).unwrap();
    writer.push(crossing(1)).unwrap();
    let mut again = crossing(9);
    again.state.id = crossing(1).state.id;
    writer.push(again).unwrap();
    writer.finish(closing()).unwrap();
    let error = StreamReader::open(&place).and_then(|reader| reader.verify(|_| {})).unwrap_err();
    assert!(error.to_string().contains("particle 1 of feed 0 crosses a second time"), "{error}");
}

#[test]
fn after_a_damaged_chunk_nothing_more_comes() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("outlet");
    write(&place, THREE_CHUNKS);
    flip(&place.join(chunk_file(1)), "id", 0);
    let read: Vec<Result<Crossing, StorageError>> = StreamReader::open(&place).unwrap().crossings().collect();
    assert_eq!(read.len(), CHUNK_CROSSINGS + 1);
    assert!(read.last().unwrap().is_err());
}

#[test]
fn the_digest_speaks_of_content_alone() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = write(&folder.path().join("outlet"), 50);
    let digest = |change: fn(&mut Manifest)| {
        let mut changed = manifest.clone();
        change(&mut changed);
        changed.digest()
    };
    let same: [fn(&mut Manifest); 6] = [
        |m| m.tollgate_version = "0.1.9".to_owned(),
        |m| m.origin.gate = "other".to_owned(),
        |m| m.origin.stage_key = "other".to_owned(),
        |m| m.origin.backend_version = "0.1.9".to_owned(),
        |m| m.chunks[0].bytes += 1,
        |m| m.quality = serde_json::Value::Null,
    ];
    assert!(same.iter().all(|&change| digest(change) == manifest.digest()));
    let others: [fn(&mut Manifest); 6] = [
        |m| m.origin.timestep *= 2.0,
        |m| m.origin.plane.point.z = 0.1,
        |m| m.origin.numerics_version += 1,
        |m| m.events.clear(),
        |m| m.origin.materials[0].density = None,
        |m| m.chunks[0].blake3.push('0'),
    ];
    assert!(others.iter().all(|&change| digest(change) != manifest.digest()));
}

#[test]
fn what_does_not_fit_the_scene_is_said_in_words() {
    use super::format::Expected;
    use crate::material::MaterialTable;
    let stored = Manifest::new(origin());
    let materials = MaterialTable::new(stored.origin.materials.iter().rev().cloned().collect());
    let (body, gravity, plane) = (stored.origin.body, stored.origin.gravity, stored.origin.plane);
    let expected =
        Expected { materials: &materials, body, gravity, plane: Some(&plane), stage_key: Some("0123456789abcdef") };
    assert_eq!(stored.misfits(&expected), Vec::<String>::new());
    assert_eq!(stored.material_numbers(&materials), [Some(1), Some(0)]);
    let mut other = materials.clone();
    other.materials.remove(0);
    other.materials[0].density = Some(2500.0);
    let mut moved = plane;
    moved.point.x += 1e-6;
    let misfits = stored.misfits(&Expected {
        materials: &other,
        body: crate::particle::Body::Disc { thickness: 0.01 },
        gravity: gravity * 0.5,
        plane: Some(&moved),
        stage_key: Some("fedcba"),
    });
    let words = ["density 3300 kg/m3", "\"coke\" is not in the scene", "discs", "gravity", "plane", "has key fedcba"];
    assert_eq!(misfits.len(), words.len());
    words.iter().for_each(|word| assert!(misfits.iter().any(|misfit| misfit.contains(word)), "{word}: {misfits:?}"));
    let mut wide = plane;
    wide.aperture = Aperture::Unbounded;
    assert_eq!(stored.misfits(&Expected { plane: Some(&wide), ..expected }).len(), 1);
}
