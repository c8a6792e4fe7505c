//! Initial-state files: particles as a CSV table.
//!
//! Columns, in any order: `x_m`, `y_m`, `z_m`, `radius_m` and `material` must be there; `vx_m_per_s`, `vy_m_per_s`,
//! `vz_m_per_s`, `wx_rad_per_s`, `wy_rad_per_s`, `wz_rad_per_s` (0 where absent), `density_kg_per_m3` (the material's
//! where absent) and `id` (the particle's number, by row where absent) may be. Lines that begin with `#` are comments.

use crate::math::Vec3;
use crate::particle::{ParticleId, ParticleState};
use std::collections::HashMap;
use std::fmt;
use std::io::Write;
use std::path::{Path, PathBuf};

const COLUMNS: [&str; 13] = [
    "x_m",
    "y_m",
    "z_m",
    "radius_m",
    "vx_m_per_s",
    "vy_m_per_s",
    "vz_m_per_s",
    "wx_rad_per_s",
    "wy_rad_per_s",
    "wz_rad_per_s",
    "density_kg_per_m3",
    "material",
    "id",
];
const RADIUS: usize = 3;
const DENSITY: usize = 10;
const MATERIAL: usize = 11;
const ID: usize = 12;
/// Columns that must be there.
const REQUIRED: [usize; 5] = [0, 1, 2, RADIUS, MATERIAL];
/// Numbers of particles of one feed stay below this.
const LARGEST_SERIAL: u64 = (1 << 40) - 1;

/// Why an initial-state file cannot be used.
#[derive(Debug)]
pub enum InitialStateError {
    /// The file cannot be read.
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// What is wrong with its content, all of it.
    Invalid {
        /// The file.
        path: PathBuf,
        /// Everything found, in the file's order.
        findings: Vec<InitialStateFinding>,
    },
}

/// One thing that is wrong in an initial-state file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InitialStateFinding {
    /// Line of the file, from 1.
    pub line: u64,
    /// What is wrong and what to do.
    pub text: String,
}

impl fmt::Display for InitialStateError {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Unreadable { path, source } => {
                write!(formatter, "cannot read the initial-state file {}: {source}", path.display())
            }
            Self::Invalid { path, findings } => {
                write!(formatter, "the initial-state file cannot be used, {} findings:", findings.len())?;
                for finding in findings {
                    write!(formatter, "\n{}:{}: {}", path.display(), finding.line, finding.text)?;
                }
                Ok(())
            }
        }
    }
}

impl std::error::Error for InitialStateError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Unreadable { source, .. } => Some(source),
            Self::Invalid { .. } => None,
        }
    }
}

/// The particles of an initial-state file for feed number `feed`; `materials` are the scene's, each with its density
/// [kg/m3].
///
/// # Errors
/// [`InitialStateError`] with everything that is wrong.
pub fn read(
    path: &Path,
    feed: u32,
    materials: &[(String, Option<f64>)],
) -> Result<Vec<ParticleState>, InitialStateError> {
    let unreadable = |source| InitialStateError::Unreadable { path: path.to_owned(), source };
    let bytes = std::fs::read(path).map_err(unreadable)?;
    parse(&bytes, feed, materials).map_err(|findings| InitialStateError::Invalid { path: path.to_owned(), findings })
}

/// The particles of an initial-state table given as bytes.
///
/// # Errors
/// Everything that is wrong, in the file's order.
pub fn parse(
    bytes: &[u8],
    feed: u32,
    materials: &[(String, Option<f64>)],
) -> Result<Vec<ParticleState>, Vec<InitialStateFinding>> {
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).flexible(true).from_reader(bytes);
    let mut findings = Vec::new();
    let layout = match reader.byte_headers() {
        Ok(header) => Layout::new(header, &mut findings),
        Err(error) => return Err(vec![InitialStateFinding { line: 1, text: format!("no table: {error}") }]),
    };
    // without its columns nothing can be said about the rows
    let Some(layout) = layout else { return Err(findings) };
    let mut table = Table { layout, feed, materials, particles: Vec::new(), lines: HashMap::new(), findings };
    let mut record = csv::ByteRecord::new();
    loop {
        match reader.read_byte_record(&mut record) {
            Ok(false) => break,
            Ok(true) => table.add(&record),
            Err(error) => {
                let line = error.position().map_or(0, csv::Position::line);
                table.findings.push(InitialStateFinding { line, text: format!("not a row of a table: {error}") });
                break;
            }
        }
    }
    if table.findings.is_empty() { Ok(table.particles) } else { Err(table.findings) }
}

/// Writes `particles` as an initial-state table; numbers are printed so that they read back to the same bits. Rows
/// carry the particles' numbers where these differ from each other (all of one feed), else none.
///
/// # Errors
/// What the writer says.
///
/// # Panics
/// Where a particle's material is not in `material_names`.
pub fn write(destination: impl Write, particles: &[ParticleState], material_names: &[&str]) -> csv::Result<()> {
    let mut writer = csv::Writer::from_writer(destination);
    let one_feed = particles.windows(2).all(|pair| pair[0].id.feed() == pair[1].id.feed());
    let columns = if one_feed { &COLUMNS[..] } else { &COLUMNS[..ID] };
    writer.write_record(columns)?;
    for particle in particles {
        let (x, v, w) = (particle.position, particle.velocity, particle.spin);
        let numbers = [x.x, x.y, x.z, particle.radius, v.x, v.y, v.z, w.x, w.y, w.z, particle.density];
        for number in numbers {
            writer.write_field(format!("{number:?}"))?;
        }
        writer.write_field(material_names[usize::from(particle.material)])?;
        if one_feed {
            writer.write_field(particle.id.serial().to_string())?;
        }
        writer.write_record(None::<&[u8]>)?;
    }
    writer.flush()?;
    Ok(())
}

/// Where each known column stands in the file.
struct Layout {
    places: [Option<usize>; COLUMNS.len()],
    width: usize,
}

impl Layout {
    fn new(header: &csv::ByteRecord, findings: &mut Vec<InitialStateFinding>) -> Option<Self> {
        let line = header.position().map_or(1, csv::Position::line);
        let before = findings.len();
        let mut places = [None; COLUMNS.len()];
        for (place, name) in header.iter().enumerate() {
            // spreadsheets put a byte-order mark before the first name
            let name = String::from_utf8_lossy(name.strip_prefix(b"\xef\xbb\xbf").unwrap_or(name));
            let text = match COLUMNS.iter().position(|&known| known == name) {
                None => format!("unknown column '{}'; columns are {}", shortened(&name), COLUMNS.join(", ")),
                Some(column) if places[column].is_some() => format!("column '{name}' comes twice; keep one of them"),
                Some(column) => {
                    places[column] = Some(place);
                    continue;
                }
            };
            findings.push(InitialStateFinding { line, text });
        }
        for column in REQUIRED {
            if places[column].is_none() {
                findings.push(InitialStateFinding { line, text: format!("column '{}' is missing", COLUMNS[column]) });
            }
        }
        (findings.len() == before).then_some(Self { places, width: header.len() })
    }
}

struct Table<'a> {
    layout: Layout,
    feed: u32,
    materials: &'a [(String, Option<f64>)],
    particles: Vec<ParticleState>,
    /// Line on which each number was seen first.
    lines: HashMap<u64, u64>,
    findings: Vec<InitialStateFinding>,
}

impl Table<'_> {
    fn add(&mut self, record: &csv::ByteRecord) {
        let line = record.position().map_or(0, csv::Position::line);
        let row = self.lines.len() as u64;
        if record.len() != self.layout.width {
            let text = format!("{} fields where the header has {}", record.len(), self.layout.width);
            self.findings.push(InitialStateFinding { line, text });
            return;
        }
        let mut texts = Vec::new();
        let numbers: [f64; MATERIAL] = std::array::from_fn(|column| self.number(record, column, &mut texts));
        let material = self.material(record, &mut texts);
        let density = self.density(numbers[DENSITY], material, &mut texts);
        let serial = self.serial(record, row, line, &mut texts);
        if texts.is_empty()
            && let (Some(material), Some(density), Some(serial)) = (material, density, serial)
        {
            let [x, y, z, radius, vx, vy, vz, wx, wy, wz, _] = numbers;
            self.particles.push(ParticleState {
                id: ParticleId::new(self.feed, serial),
                material,
                radius,
                density,
                position: Vec3::new(x, y, z),
                velocity: Vec3::new(vx, vy, vz),
                spin: Vec3::new(wx, wy, wz),
            });
        }
        self.findings.extend(texts.into_iter().map(|text| InitialStateFinding { line, text }));
    }

    fn field<'r>(&self, record: &'r csv::ByteRecord, column: usize) -> Option<&'r [u8]> {
        self.layout.places[column].and_then(|place| record.get(place))
    }

    /// A number; 0 where its column is absent.
    fn number(&self, record: &csv::ByteRecord, column: usize, texts: &mut Vec<String>) -> f64 {
        let Some(field) = self.field(record, column) else { return 0.0 };
        let name = COLUMNS[column];
        let text = String::from_utf8_lossy(field);
        let must_be_positive = column == RADIUS || column == DENSITY;
        match text.parse::<f64>() {
            Ok(number) if !number.is_finite() => texts.push(format!("{name} = {}: must be finite", shortened(&text))),
            Ok(number) if must_be_positive && number <= 0.0 => {
                texts.push(format!("{name} = {number}: must be above zero"));
            }
            Ok(number) => return number,
            Err(_) => texts.push(format!("{name} = '{}': not a number", shortened(&text))),
        }
        0.0
    }

    fn material(&self, record: &csv::ByteRecord, texts: &mut Vec<String>) -> Option<u16> {
        let name = String::from_utf8_lossy(self.field(record, MATERIAL).unwrap_or_default());
        let known = self.materials.iter().position(|(known, _)| *known == name);
        if known.is_none() {
            let names: Vec<&str> = self.materials.iter().map(|(name, _)| name.as_str()).collect();
            texts.push(format!("unknown material '{}'; the scene has {}", shortened(&name), names.join(", ")));
        }
        known.and_then(|index| u16::try_from(index).ok())
    }

    fn density(&self, given: f64, material: Option<u16>, texts: &mut Vec<String>) -> Option<f64> {
        if self.layout.places[DENSITY].is_some() {
            return Some(given);
        }
        let (name, density) = &self.materials[usize::from(material?)];
        if density.is_none() {
            texts.push(format!(
                "material '{name}' has no density: give it one in the scene, or add the column density_kg_per_m3"
            ));
        }
        *density
    }

    /// The particle's number: given, or its row; every number once.
    fn serial(&mut self, record: &csv::ByteRecord, row: u64, line: u64, texts: &mut Vec<String>) -> Option<u64> {
        let serial = match self.field(record, ID) {
            None => row,
            Some(field) => {
                let text = String::from_utf8_lossy(field);
                let number = text.parse::<u64>().ok().filter(|&number| number <= LARGEST_SERIAL);
                if number.is_none() {
                    texts.push(format!(
                        "id = '{}': must be a whole number from 0 to {LARGEST_SERIAL}",
                        shortened(&text)
                    ));
                }
                number?
            }
        };
        if let Some(first) = self.lines.insert(serial, line) {
            texts.push(format!("id = {serial} comes twice, first on line {first}"));
            self.lines.insert(serial, first);
        }
        Some(serial)
    }
}

/// A quotation of the file that does not flood the terminal.
fn shortened(text: &str) -> String {
    const LONGEST: usize = 40;
    if text.chars().count() <= LONGEST {
        return text.to_owned();
    }
    format!("{}...", text.chars().take(LONGEST).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn materials() -> Vec<(String, Option<f64>)> {
        vec![("ore".to_owned(), Some(3300.0)), ("steel".to_owned(), None)]
    }

    fn texts(table: &str) -> Vec<String> {
        let findings = parse(table.as_bytes(), 1, &materials()).unwrap_err();
        findings.into_iter().map(|finding| format!("{}: {}", finding.line, finding.text)).collect()
    }

    #[test]
    fn reads_a_short_table() {
        let table =
            "# from a photograph\nmaterial, radius_m, x_m, y_m, z_m\nore, 0.002, 0, 0, 0.5\nore, 3e-3, 1, 2, 3\n";
        let particles = parse(table.as_bytes(), 7, &materials()).unwrap();
        assert_eq!(particles.len(), 2);
        assert_eq!(particles[1].id, ParticleId::new(7, 1));
        assert_eq!(particles[1].position, Vec3::new(1.0, 2.0, 3.0));
        assert_eq!((particles[1].radius, particles[1].density), (3e-3, 3300.0));
        assert_eq!(particles[1].velocity, Vec3::zeros());
    }

    #[test]
    fn says_everything_that_is_wrong_with_its_line() {
        let table = "x_m,y_m,z_m,radius_m,material,id\n\
                     0,0,0,0.1,ore,5\n\
                     nan,0,0,-0.1,ore,6\n\
                     0,0,zero,0.1,sand,5\n\
                     0,0,0,0.1,steel,1e3\n\
                     0,0,0,0.1,ore\n\
                     0,0,inf,0,ore,1099511627776\n";
        assert_eq!(
            texts(table),
            [
                "3: x_m = nan: must be finite",
                "3: radius_m = -0.1: must be above zero",
                "4: z_m = 'zero': not a number",
                "4: unknown material 'sand'; the scene has ore, steel",
                "4: id = 5 comes twice, first on line 2",
                "5: material 'steel' has no density: give it one in the scene, or add the column density_kg_per_m3",
                "5: id = '1e3': must be a whole number from 0 to 1099511627775",
                "6: 5 fields where the header has 6",
                "7: z_m = inf: must be finite",
                "7: radius_m = 0: must be above zero",
                "7: id = '1099511627776': must be a whole number from 0 to 1099511627775",
            ]
        );
    }

    #[test]
    fn refuses_unknown_double_and_missing_columns() {
        let found = texts("x_m,x_m,z_m,radius_mm,material\n");
        assert!(found[0].contains("column 'x_m' comes twice") && found[1].contains("unknown column 'radius_mm'"));
        assert!(found[2].contains("'y_m' is missing") && found[3].contains("'radius_m' is missing"));
        assert_eq!(found.len(), 4);
        assert!(!texts("").is_empty());
    }

    #[test]
    fn what_was_written_reads_back_to_the_same_bits() {
        let draws = crate::dem::feed::draw::FeedKey::new(1, 0);
        let particle = |serial: u64| {
            let vector = |attempt| Vec3::from(draws.places(serial).attempt(attempt).map(|u| (u - 0.5) * 1e-3));
            ParticleState {
                id: ParticleId::new(3, 2 * serial),
                material: u16::from(serial % 2 == 1),
                radius: draws.size(serial)[0] + 1e-9,
                density: 1e3 * draws.size(serial)[1] + 1.0,
                position: vector(0),
                velocity: vector(1),
                spin: vector(2),
            }
        };
        let particles: Vec<_> = (0..100).map(particle).collect();
        let mut text = Vec::new();
        write(&mut text, &particles, &["ore", "steel"]).unwrap();
        assert_eq!(parse(&text, 3, &materials()).unwrap(), particles);
        // of two feeds the numbers could be the same, so there are none
        let mut mixed = particles;
        mixed[5].id = ParticleId::new(4, 0);
        let mut text = Vec::new();
        write(&mut text, &mixed, &["ore", "steel"]).unwrap();
        assert_eq!(parse(&text, 3, &materials()).unwrap()[5].id, ParticleId::new(3, 5));
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = read(Path::new("no/such/file.csv"), 0, &materials()).unwrap_err();
        assert!(error.to_string().contains("no/such/file.csv"));
    }

    proptest! {
        #[test]
        fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let _ = parse(&bytes, 0, &materials());
        }

        #[test]
        fn arbitrary_tables_never_panic(rows in prop::collection::vec("[-0-9a-z.,\"# \u{fe}]{0,60}", 0..20)) {
            let table = format!("x_m,y_m,z_m,radius_m,material,id\n{}\n", rows.join("\n"));
            let result = parse(table.as_bytes(), 0, &materials());
            if let Ok(particles) = result {
                prop_assert!(particles.iter().all(|p| p.radius > 0.0 && p.position.iter().all(|x| x.is_finite())));
            }
        }
    }
}
