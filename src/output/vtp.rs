//! VTK XML PolyData (`.vtp`), raw appended little-endian binary: particles as points, parts as triangles, contacts as
//! lines.
//!
//! Connectivity is Int64 (readers differ about unsigned connectivity) and every particle has a vertex cell (points
//! without cells are not drawn). Array lengths are UInt64 headers before each array, offsets count from the `_`.

use crate::math::Vec3;
use crate::particle::ParticleState;
use crate::storage::staging::StagedFile;
use crate::storage::{Column, StorageError};
use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::Path;

/// How real numbers are stored in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// Float32: half the size, enough to look at (1e-7 of the largest coordinate).
    #[default]
    Single,
    /// Float64: the solver's numbers to the last bit.
    Double,
}

/// A column of a frame: its name, with the unit where it has one, and its values.
pub type NamedColumn<'a> = (&'a str, Column<'a>);

/// A moved part at one time.
#[derive(Debug, Clone, Copy)]
pub struct MeshFrame<'a> {
    /// The part's name in the scene; kept in the field `part_name`.
    pub name: &'a str,
    /// Vertices where the part is now [m].
    pub vertices: &'a [Vec3],
    /// Vertex indices of each triangle.
    pub triangles: &'a [[u32; 3]],
    /// One value per triangle.
    pub triangle_columns: &'a [NamedColumn<'a>],
    /// One value for the whole part, such as its force [N]; kept as field arrays of one value.
    pub part_columns: &'a [NamedColumn<'a>],
}

/// A contact, drawn as a line from centre to centre (to the contact point on a part).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactLine {
    /// Start: centre of particle i [m].
    pub start: Vec3,
    /// End: centre of particle j, or the contact point on a part [m].
    pub end: Vec3,
    /// Unit normal from i to j [-].
    pub normal: Vec3,
    /// Overlap [m], > 0 in contact.
    pub overlap: f64,
    /// Force on i [N].
    pub force: Vec3,
}

/// Writes one frame of particles at plant time `time` [s]: points with vertex cells and the arrays `id`, `feed`,
/// `material`, `radius` [m], `diameter` [m], `density` [kg/m3], `velocity` [m/s], `spin` [rad/s], then `extra`.
///
/// # Errors
/// When the disk refuses, or an extra column is not as long as `particles`.
pub fn write_particles(
    path: &Path,
    time: f64,
    particles: &[ParticleState],
    extra: &[NamedColumn],
    precision: Precision,
) -> Result<(), StorageError> {
    check_lengths(path, extra, particles.len(), "particles")?;
    let count = particles.len();
    let mut point_arrays = vec![
        Array::new("id", "UInt64", 1, count, || particles.iter().map(|p| p.id.0.to_le_bytes())),
        Array::new("feed", "UInt32", 1, count, || particles.iter().map(|p| p.id.feed().to_le_bytes())),
        Array::new("material", "UInt16", 1, count, || particles.iter().map(|p| p.material.to_le_bytes())),
        Array::of_numbers("radius", particles, precision, |p| p.radius),
        Array::of_numbers("diameter", particles, precision, |p| 2.0 * p.radius),
        Array::of_numbers("density", particles, precision, |p| p.density),
        Array::of_vectors("velocity", particles, precision, |p| p.velocity),
        Array::of_vectors("spin", particles, precision, |p| p.spin),
    ];
    point_arrays.extend(arrays(extra, precision));
    let piece = Piece {
        fields: vec![time_field(time)],
        active: r#" Scalars="radius" Vectors="velocity""#,
        point_arrays,
        cell_arrays: Vec::new(),
        points: Array::of_vectors("Points", particles, precision, |p| p.position),
        cells: Some(Cells { kind: "Verts", nodes: Nodes::Each(count) }),
    };
    piece.write(path)
}

/// Writes one moved part at plant time `time` [s].
///
/// # Errors
/// When the disk refuses, a column is not as long as it must be, or a triangle names a vertex that is not there.
pub fn write_mesh(path: &Path, time: f64, mesh: &MeshFrame, precision: Precision) -> Result<(), StorageError> {
    check_lengths(path, mesh.triangle_columns, mesh.triangles.len(), "triangles")?;
    check_lengths(path, mesh.part_columns, 1, "parts")?;
    let count = mesh.vertices.len();
    if let Some(triangle) = mesh.triangles.iter().find(|triangle| triangle.iter().any(|&v| v as usize >= count)) {
        return Err(StorageError::mismatch(path, format!("triangle {triangle:?} of {count} vertices")));
    }
    let mut fields = vec![time_field(time), text_field("part_name", mesh.name)];
    fields.extend(mesh.part_columns.iter().map(|(name, column)| number_field(name, column)));
    let piece = Piece {
        fields,
        active: "",
        point_arrays: Vec::new(),
        cell_arrays: arrays(mesh.triangle_columns, precision).collect(),
        points: Array::of_vectors("Points", mesh.vertices, precision, |vertex| *vertex),
        cells: Some(Cells { kind: "Polys", nodes: Nodes::Triangles(mesh.triangles) }),
    };
    piece.write(path)
}

/// Writes the contacts at plant time `time` [s] as lines with the cell arrays `force` [N] (on i), `normal_force` [N]
/// (compression positive), `tangential_force` [N], `overlap` [m], `normal`, then `extra`.
///
/// # Errors
/// When the disk refuses, or an extra column is not as long as `contacts`.
pub fn write_contacts(
    path: &Path,
    time: f64,
    contacts: &[ContactLine],
    extra: &[NamedColumn],
    precision: Precision,
) -> Result<(), StorageError> {
    check_lengths(path, extra, contacts.len(), "contacts")?;
    let ends: Vec<Vec3> = contacts.iter().flat_map(|contact| [contact.start, contact.end]).collect();
    let tangential = |c: &ContactLine| (c.force - c.normal * c.force.dot(&c.normal)).norm();
    let mut cell_arrays = vec![
        Array::of_vectors("force", contacts, precision, |c| c.force),
        // The normal points from i to j, so a force on i along it would be attraction.
        Array::of_numbers("normal_force", contacts, precision, |c| -c.force.dot(&c.normal)),
        Array::of_numbers("tangential_force", contacts, precision, tangential),
        Array::of_numbers("overlap", contacts, precision, |c| c.overlap),
        Array::of_vectors("normal", contacts, precision, |c| c.normal),
    ];
    cell_arrays.extend(arrays(extra, precision));
    let piece = Piece {
        fields: vec![time_field(time)],
        active: r#" Scalars="normal_force" Vectors="force""#,
        point_arrays: Vec::new(),
        cell_arrays,
        points: Array::of_vectors("Points", &ends, precision, |end| *end),
        cells: Some(Cells { kind: "Lines", nodes: Nodes::Pairs(contacts.len()) }),
    };
    piece.write(path)
}

fn check_lengths(path: &Path, columns: &[NamedColumn], length: usize, what: &str) -> Result<(), StorageError> {
    match columns.iter().find(|(_, column)| column.len() != length) {
        Some((name, column)) => {
            let reason = format!("column {name:?} has {} values for {length} {what}", column.len());
            Err(StorageError::mismatch(path, reason))
        }
        None => Ok(()),
    }
}

fn arrays<'a>(columns: &'a [NamedColumn<'a>], precision: Precision) -> impl Iterator<Item = Array<'a>> {
    columns.iter().map(move |(name, column)| Array::of_column(name, column, precision))
}

/// Readers take the frame's time from a field array of this name.
fn time_field(time: f64) -> String {
    number_field("TimeValue", &Column::from(vec![time]))
}

fn number_field(name: &str, column: &Column) -> String {
    let (kind, text) = match column {
        Column::F64(values) => ("Float64", values.iter().map(|value| format!("{value:?}")).collect::<Vec<_>>()),
        Column::Vec3(values) => ("Float64", values.iter().flatten().map(|value| format!("{value:?}")).collect()),
        Column::U64(values) => ("UInt64", values.iter().map(ToString::to_string).collect()),
        Column::U32(values) => ("UInt32", values.iter().map(ToString::to_string).collect()),
        Column::U16(values) => ("UInt16", values.iter().map(ToString::to_string).collect()),
        Column::U8(values) => ("UInt8", values.iter().map(ToString::to_string).collect()),
    };
    let components = column.components();
    let tuples = column.len();
    format!(
        "<DataArray type=\"{kind}\" Name=\"{}\" NumberOfComponents=\"{components}\" NumberOfTuples=\"{tuples}\" \
         format=\"ascii\">{}</DataArray>",
        escape(name),
        text.join(" ")
    )
}

/// VTK stores text as the numbers of its bytes, with a zero at the end.
fn text_field(name: &str, text: &str) -> String {
    let bytes: Vec<String> = text.bytes().chain([0]).map(|byte| byte.to_string()).collect();
    format!(
        "<Array type=\"String\" Name=\"{}\" NumberOfTuples=\"1\" format=\"ascii\">{}</Array>",
        escape(name),
        bytes.join(" ")
    )
}

/// `text` as the value of an XML attribute.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            _ => escaped.push(character),
        }
    }
    escaped
}

/// Writes the numbers of an array.
type WriteNumbers<'a> = Box<dyn Fn(&mut dyn Write) -> io::Result<()> + 'a>;

/// A binary array of a known length, written when its turn comes.
struct Array<'a> {
    name: &'a str,
    kind: &'static str,
    components: usize,
    bytes: u64,
    write: WriteNumbers<'a>,
}

impl<'a> Array<'a> {
    fn new<I, const N: usize>(
        name: &'a str,
        kind: &'static str,
        components: usize,
        tuples: usize,
        numbers: impl Fn() -> I + 'a,
    ) -> Self
    where
        I: Iterator<Item = [u8; N]>,
    {
        let bytes = (tuples * components * N) as u64;
        let write = move |out: &mut dyn Write| numbers().try_for_each(|number| out.write_all(&number));
        Self { name, kind, components, bytes, write: Box::new(write) }
    }

    /// A number of each item; worked out while it is written, as there may be millions.
    fn of_numbers<T>(
        name: &'a str,
        items: &'a [T],
        precision: Precision,
        number: impl Fn(&T) -> f64 + Copy + 'a,
    ) -> Self {
        let (count, numbers) = (items.len(), move || items.iter().map(number));
        match precision {
            Precision::Double => Self::new(name, "Float64", 1, count, move || numbers().map(f64::to_le_bytes)),
            Precision::Single => {
                Self::new(name, "Float32", 1, count, move || numbers().map(|number| (number as f32).to_le_bytes()))
            }
        }
    }

    /// The same of a vector of each item.
    fn of_vectors<T>(
        name: &'a str,
        items: &'a [T],
        precision: Precision,
        vector: impl Fn(&T) -> Vec3 + Copy + 'a,
    ) -> Self {
        let components = move || items.iter().flat_map(move |item| vector(item).data.0[0]);
        match precision {
            Precision::Double => Self::new(name, "Float64", 3, items.len(), move || components().map(f64::to_le_bytes)),
            Precision::Single => {
                let narrow = |component| (component as f32).to_le_bytes();
                Self::new(name, "Float32", 3, items.len(), move || components().map(narrow))
            }
        }
    }

    fn of_column(name: &'a str, column: &'a Column<'a>, precision: Precision) -> Self {
        let count = column.len();
        match column {
            Column::F64(values) => Self::of_numbers(name, values, precision, |value| *value),
            Column::Vec3(values) => Self::of_vectors(name, values, precision, |value| *value),
            Column::U64(values) => {
                Self::new(name, "UInt64", 1, count, || values.iter().map(|value| value.to_le_bytes()))
            }
            Column::U32(values) => {
                Self::new(name, "UInt32", 1, count, || values.iter().map(|value| value.to_le_bytes()))
            }
            Column::U16(values) => {
                Self::new(name, "UInt16", 1, count, || values.iter().map(|value| value.to_le_bytes()))
            }
            Column::U8(values) => Self::new(name, "UInt8", 1, count, || values.iter().map(|value| value.to_le_bytes())),
        }
    }

    fn declare(&self, header: &mut String, offset: &mut u64) {
        let (kind, components) = (self.kind, self.components);
        let _ = writeln!(
            header,
            "<DataArray type=\"{kind}\" Name=\"{}\" NumberOfComponents=\"{components}\" format=\"appended\" \
             offset=\"{offset}\"/>",
            escape(self.name)
        );
        *offset += 8 + self.bytes;
    }
}

/// Which points each cell joins.
#[derive(Clone, Copy)]
enum Nodes<'a> {
    /// One cell per point.
    Each(usize),
    /// One cell per two consecutive points.
    Pairs(usize),
    /// Triangles.
    Triangles(&'a [[u32; 3]]),
}

#[derive(Clone, Copy)]
struct Cells<'a> {
    kind: &'static str,
    nodes: Nodes<'a>,
}

impl<'a> Cells<'a> {
    const fn count(&self) -> usize {
        match self.nodes {
            Nodes::Each(count) | Nodes::Pairs(count) => count,
            Nodes::Triangles(triangles) => triangles.len(),
        }
    }

    fn connectivity(self) -> Array<'a> {
        let sequence = |count: usize| {
            Array::new("connectivity", "Int64", 1, count, move || (0..count as i64).map(|index| index.to_le_bytes()))
        };
        match self.nodes {
            Nodes::Each(count) => sequence(count),
            Nodes::Pairs(count) => sequence(2 * count),
            Nodes::Triangles(triangles) => Array::new("connectivity", "Int64", 1, 3 * triangles.len(), || {
                triangles.iter().flatten().map(|&vertex| i64::from(vertex).to_le_bytes())
            }),
        }
    }

    fn offsets(self) -> Array<'a> {
        let nodes = match self.nodes {
            Nodes::Each(_) => 1,
            Nodes::Pairs(_) => 2,
            Nodes::Triangles(_) => 3,
        };
        let count = self.count();
        Array::new("offsets", "Int64", 1, count, move || {
            (1..=count as i64).map(move |cell| (cell * nodes).to_le_bytes())
        })
    }
}

/// The one piece of a file.
struct Piece<'a> {
    fields: Vec<String>,
    active: &'static str,
    point_arrays: Vec<Array<'a>>,
    cell_arrays: Vec<Array<'a>>,
    points: Array<'a>,
    cells: Option<Cells<'a>>,
}

impl Piece<'_> {
    fn write(&self, path: &Path) -> Result<(), StorageError> {
        let mut file = StagedFile::create(path)?;
        self.write_to(&mut file).map_err(|source| file.failed(source))?;
        file.commit()
    }

    fn write_to(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut offset = 0;
        let mut header = self.opening();
        let on_points = !self.point_arrays.is_empty();
        let section = |name, active: bool| format!("<{name}{}>\n", if active { self.active } else { "" });
        header.push_str(&section("PointData", on_points));
        self.point_arrays.iter().for_each(|array| array.declare(&mut header, &mut offset));
        header.push_str("</PointData>\n");
        header.push_str(&section("CellData", !on_points && !self.cell_arrays.is_empty()));
        self.cell_arrays.iter().for_each(|array| array.declare(&mut header, &mut offset));
        header.push_str("</CellData>\n<Points>\n");
        self.points.declare(&mut header, &mut offset);
        header.push_str("</Points>\n");
        let topology = self.cells.map(|cells| (cells.kind, [cells.connectivity(), cells.offsets()]));
        if let Some((kind, pair)) = &topology {
            let _ = writeln!(header, "<{kind}>");
            pair.iter().for_each(|array| array.declare(&mut header, &mut offset));
            let _ = writeln!(header, "</{kind}>");
        }
        header.push_str("</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_");
        out.write_all(header.as_bytes())?;
        let all = self.point_arrays.iter().chain(&self.cell_arrays).chain([&self.points]);
        for array in all.chain(topology.iter().flat_map(|(_, pair)| pair)) {
            out.write_all(&array.bytes.to_le_bytes())?;
            (array.write)(out)?;
        }
        out.write_all(b"\n</AppendedData>\n</VTKFile>\n")
    }

    fn opening(&self) -> String {
        let points = self.points.bytes / (3 * if self.points.kind == "Float64" { 8 } else { 4 });
        let cells = |kind| self.cells.filter(|cells| cells.kind == kind).map_or(0, |cells| cells.count());
        format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" \
             header_type=\"UInt64\">\n<PolyData>\n<FieldData>\n{}\n</FieldData>\n<Piece NumberOfPoints=\"{points}\" \
             NumberOfVerts=\"{}\" NumberOfLines=\"{}\" NumberOfStrips=\"0\" NumberOfPolys=\"{}\">\n",
            self.fields.join("\n"),
            cells("Verts"),
            cells("Lines"),
            cells("Polys"),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;
    use crate::particle::ParticleId;
    use regex::Regex;
    use std::fs;

    fn particles(count: u64) -> Vec<ParticleState> {
        (0..count)
            .map(|serial| ParticleState {
                id: ParticleId::new(2, serial),
                material: 1,
                radius: 1e-3 / (serial + 3) as f64,
                density: 3300.0,
                position: vec3(0.1, 0.2, 1.0 / (serial + 7) as f64),
                velocity: vec3(-1.0, 0.0, serial as f64),
                spin: vec3(0.0, 5.0, 0.0),
            })
            .collect()
    }

    /// An independent reader: takes an array by name from the declared offset, checks its declared length.
    fn array(bytes: &[u8], name: &str, size: usize) -> Vec<Vec<u8>> {
        let start = bytes.windows(b"<AppendedData".len()).position(|window| window == b"<AppendedData").unwrap();
        let header = std::str::from_utf8(&bytes[..start]).unwrap();
        let base = start + bytes[start..].iter().position(|&byte| byte == b'_').unwrap() + 1;
        let pattern = format!(r#"Name="{name}"[^>]*offset="([0-9]+)""#);
        let offset: usize = Regex::new(&pattern).unwrap().captures(header).unwrap()[1].parse().unwrap();
        let at = base + offset;
        let length = u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
        bytes[at + 8..at + 8 + length].chunks(size).map(<[u8]>::to_vec).collect()
    }

    fn doubles(bytes: &[u8], name: &str) -> Vec<f64> {
        array(bytes, name, 8).iter().map(|number| f64::from_le_bytes(number[..].try_into().unwrap())).collect()
    }

    fn integers(bytes: &[u8], name: &str) -> Vec<i64> {
        array(bytes, name, 8).iter().map(|number| i64::from_le_bytes(number[..].try_into().unwrap())).collect()
    }

    #[test]
    fn double_precision_particles_keep_every_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("particles.vtp");
        let particles = particles(5);
        let load = vec![1.5, 2.5, 3.5, 4.5, 5.5];
        write_particles(&path, 0.1, &particles, &[("load_N", (&load).into())], Precision::Double).unwrap();
        let bytes = fs::read(&path).unwrap();
        let positions: Vec<f64> = particles.iter().flat_map(|p| [p.position.x, p.position.y, p.position.z]).collect();
        assert_eq!(doubles(&bytes, "Points"), positions);
        assert_eq!(doubles(&bytes, "diameter"), particles.iter().map(|p| 2.0 * p.radius).collect::<Vec<_>>());
        assert_eq!(doubles(&bytes, "load_N"), load);
        assert_eq!(integers(&bytes, "id"), particles.iter().map(|p| p.id.0 as i64).collect::<Vec<_>>());
        assert_eq!(integers(&bytes, "connectivity"), [0, 1, 2, 3, 4]);
        assert_eq!(integers(&bytes, "offsets"), [1, 2, 3, 4, 5]);
        let text = String::from_utf8_lossy(&bytes);
        assert!(text.contains(r#"NumberOfPoints="5" NumberOfVerts="5""#));
        assert!(text.contains(r#"Name="TimeValue" NumberOfComponents="1" NumberOfTuples="1" format="ascii">0.1<"#));
        assert!(text.ends_with("\n</AppendedData>\n</VTKFile>\n"));
    }

    #[test]
    fn single_precision_halves_the_positions() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("particles.vtp");
        let particles = particles(3);
        write_particles(&path, 0.0, &particles, &[], Precision::Single).unwrap();
        let bytes = fs::read(&path).unwrap();
        let radii = array(&bytes, "radius", 4);
        for (stored, particle) in radii.iter().zip(&particles) {
            assert_eq!(f32::from_le_bytes(stored[..].try_into().unwrap()), particle.radius as f32);
        }
        assert_eq!(array(&bytes, "Points", 12).len(), 3);
    }

    #[test]
    fn a_part_carries_its_name_its_force_and_its_triangles() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("part.vtp");
        let vertices = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(1.0, 1.0, 0.0), vec3(0.0, 1.0, 0.0)];
        let triangles = [[0, 1, 2], [0, 2, 3]];
        let mesh = MeshFrame {
            name: "a<b",
            vertices: &vertices,
            triangles: &triangles,
            triangle_columns: &[("wear", vec![1.0, 2.0].into())],
            part_columns: &[("force_N", vec![vec3(1.0, 2.0, 3.0)].into())],
        };
        write_mesh(&path, 0.0, &mesh, Precision::Double).unwrap();
        let bytes = fs::read(&path).unwrap();
        assert_eq!(integers(&bytes, "connectivity"), [0, 1, 2, 0, 2, 3]);
        assert_eq!(integers(&bytes, "offsets"), [3, 6]);
        let text = String::from_utf8_lossy(&bytes);
        assert!(text.contains(">1.0 2.0 3.0</DataArray>"));
        assert!(text.contains(">97 60 98 0</Array>"), "the part's name");
        let broken = MeshFrame { triangles: &[[0, 1, 4]], triangle_columns: &[], ..mesh };
        assert!(matches!(write_mesh(&path, 0.0, &broken, Precision::Double), Err(StorageError::Mismatch { .. })));
    }

    #[test]
    fn contacts_split_their_force_along_the_normal() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("contacts.vtp");
        let contact = ContactLine {
            start: vec3(0.0, 0.0, 0.0),
            end: vec3(0.0, 0.0, 2.0),
            normal: vec3(0.0, 0.0, 1.0),
            overlap: 1e-4,
            force: vec3(3.0, 4.0, -12.0),
        };
        write_contacts(&path, 0.0, &[contact, contact], &[], Precision::Double).unwrap();
        let bytes = fs::read(&path).unwrap();
        assert_eq!(doubles(&bytes, "normal_force"), [12.0, 12.0]);
        assert_eq!(doubles(&bytes, "tangential_force"), [5.0, 5.0]);
        assert_eq!(integers(&bytes, "offsets"), [2, 4]);
        assert_eq!(doubles(&bytes, "Points").len(), 12);
    }

    #[test]
    fn a_column_of_another_length_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("particles.vtp");
        let error = write_particles(&path, 0.0, &particles(3), &[("x", vec![1.0].into())], Precision::Double);
        let error = error.unwrap_err().to_string();
        assert!(error.contains(r#"column "x" has 1 values for 3 particles"#), "{error}");
        assert!(!path.exists());
    }

    #[test]
    fn nothing_to_show_is_a_frame_too() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("particles.vtp");
        write_particles(&path, 0.0, &[], &[], Precision::Single).unwrap();
        assert!(doubles(&fs::read(&path).unwrap(), "Points").is_empty());
    }
}
