//! STL files: triangles as text (full double precision) or binary (single precision).
//!
//! The normals in the file are not used: they follow from the order of the vertices.

use super::part::TriangleMesh;
use crate::math::{Vec3, vec3};
use std::fmt;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Bytes before the triangles of a binary file: a free header and the number of triangles.
const BINARY_START: usize = 84;
/// Bytes of one triangle: normal and three vertices of three `f32` each, and two attribute bytes.
const BINARY_TRIANGLE: usize = 50;

/// An STL file that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StlError {
    /// The file; empty for bytes that come from elsewhere.
    pub path: PathBuf,
    /// Where in the file.
    pub place: Place,
    /// What is wrong, and what to do next.
    pub message: String,
}

/// A place in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    File,
    /// A line, from 1.
    Line(usize),
    /// A byte, from 0.
    Byte(usize),
}

impl fmt::Display for StlError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = self.path.display();
        match self.place {
            Place::File => write!(formatter, "{path}: {}", self.message),
            Place::Line(line) => write!(formatter, "{path}:{line}: {}", self.message),
            Place::Byte(byte) => write!(formatter, "{path}: byte {byte}: {}", self.message),
        }
    }
}

impl std::error::Error for StlError {}

/// Reads an STL file of either kind.
///
/// # Errors
/// Where the file cannot be read or is not a complete STL file.
pub fn read_stl(path: &Path) -> Result<TriangleMesh, StlError> {
    let named = |error: StlError| StlError { path: path.to_path_buf(), ..error };
    let unreadable = |error: &io::Error| whole(format!("cannot read the STL file: {error}; check the path"));
    let about = std::fs::metadata(path).map_err(|error| named(unreadable(&error)))?;
    // a device or a pipe may never end
    if !about.is_file() {
        return Err(named(whole("not a file; give the path of an STL file".into())));
    }
    let bytes = std::fs::read(path).map_err(|error| named(unreadable(&error)))?;
    parse_stl(&bytes).map_err(named)
}

/// Reads the content of an STL file of either kind.
///
/// Binary is what has the length that its triangle count asks for, also where the header begins with `solid` as some
/// programs write it. (In a text file, the four bytes of the count are characters and ask for more than 6 GB.)
///
/// # Errors
/// Where it is not a complete STL file; the error's path is empty.
pub fn parse_stl(bytes: &[u8]) -> Result<TriangleMesh, StlError> {
    let text = bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let announced = bytes.get(80..BINARY_START).map(|count| {
        let count = u32::from_le_bytes([count[0], count[1], count[2], count[3]]);
        (count, BINARY_START as u64 + BINARY_TRIANGLE as u64 * u64::from(count))
    });
    let soup = match announced {
        Some((_, length)) if length == bytes.len() as u64 => parse_binary(bytes)?,
        // no text has bytes of value 0
        _ if text && !bytes.contains(&0) => parse_ascii(bytes)?,
        Some((count, length)) => {
            return Err(whole(format!(
                "a binary STL file of {count} triangles has {length} bytes, this one has {}; it is cut off or not an STL \
                 file: export it again",
                bytes.len()
            )));
        }
        None => {
            return Err(whole(format!(
                "{} bytes are neither a text STL file, which begins with `solid`, nor a binary one, which has at least \
                 {BINARY_START}: export it again",
                bytes.len()
            )));
        }
    };
    if soup.is_empty() {
        return Err(whole("the STL file holds no triangles: export the surface again".into()));
    }
    if soup.len() > (u32::MAX / 3) as usize {
        return Err(whole(format!("{} triangles are too many: coarsen the surface", soup.len())));
    }
    Ok(TriangleMesh::from_soup(&soup))
}

fn whole(message: String) -> StlError {
    StlError { path: PathBuf::new(), place: Place::File, message }
}

fn parse_binary(bytes: &[u8]) -> Result<Vec<[Vec3; 3]>, StlError> {
    let triangles = bytes[BINARY_START..].chunks_exact(BINARY_TRIANGLE);
    let mut soup = Vec::with_capacity(triangles.len());
    for (number, triangle) in triangles.enumerate() {
        let number_at = |position: usize| {
            let at = 12 + 4 * position;
            f64::from(f32::from_le_bytes([triangle[at], triangle[at + 1], triangle[at + 2], triangle[at + 3]]))
        };
        if let Some(position) = (0..9).find(|&position| !number_at(position).is_finite()) {
            let byte = BINARY_START + BINARY_TRIANGLE * number + 12 + 4 * position;
            let message = format!(
                "coordinate {} of vertex {} of triangle {number} is {}: repair the surface and export it again",
                ["x", "y", "z"][position % 3],
                position / 3 + 1,
                number_at(position)
            );
            return Err(StlError { place: Place::Byte(byte), ..whole(message) });
        }
        soup.push([0, 3, 6].map(|first| vec3(number_at(first), number_at(first + 1), number_at(first + 2))));
    }
    Ok(soup)
}

/// What a text file may say next.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Expect {
    Solid,
    Facet,
    Loop,
    Vertex,
    EndLoop,
    EndFacet,
}

impl Expect {
    const fn words(self) -> &'static str {
        match self {
            Self::Solid => "`solid`",
            Self::Facet => "`facet normal` or `endsolid`",
            Self::Loop => "`outer loop`",
            Self::Vertex => "`vertex` and three numbers",
            Self::EndLoop => "`endloop` after three vertices",
            Self::EndFacet => "`endfacet`",
        }
    }
}

fn parse_ascii(bytes: &[u8]) -> Result<Vec<[Vec3; 3]>, StlError> {
    let mut soup = Vec::new();
    let mut corners = [Vec3::zeros(); 3];
    let mut count = 0;
    let mut expect = Expect::Solid;
    let mut last = 0;
    for (line, content) in (1..).zip(bytes.split(|&byte| byte == b'\n')) {
        let content = String::from_utf8_lossy(content);
        let mut words = content.split_ascii_whitespace();
        let Some(word) = words.next() else { continue };
        last = line;
        expect = match (expect, word.to_ascii_lowercase().as_str()) {
            (Expect::Solid, "solid") | (Expect::EndFacet, "endfacet") => Expect::Facet,
            (Expect::Facet, "facet") => Expect::Loop,
            (Expect::Facet, "endsolid") => Expect::Solid,
            (Expect::Loop, "outer") => Expect::Vertex,
            (Expect::Vertex, "vertex") => {
                corners[count] =
                    vertex(words).map_err(|message| StlError { place: Place::Line(line), ..whole(message) })?;
                count += 1;
                if count < 3 { Expect::Vertex } else { Expect::EndLoop }
            }
            (Expect::EndLoop, "endloop") => {
                soup.push(corners);
                count = 0;
                Expect::EndFacet
            }
            (expected, _) => {
                let found: String = content.trim().chars().take(40).collect();
                let message = format!("expected {}, found `{found}`: export the file again", expected.words());
                return Err(StlError { place: Place::Line(line), ..whole(message) });
            }
        };
    }
    if expect != Expect::Solid {
        let message = format!("the file ends where {} should follow: it is cut off, export it again", expect.words());
        return Err(StlError { place: Place::Line(last), ..whole(message) });
    }
    Ok(soup)
}

fn vertex<'a>(words: impl Iterator<Item = &'a str>) -> Result<Vec3, String> {
    let words: Vec<&str> = words.take(4).collect();
    let [x, y, z] = words[..] else {
        return Err(format!("a vertex has three coordinates, found {}: export the file again", words.len()));
    };
    let number = |word: &str| match word.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => {
            let word: String = word.chars().take(40).collect();
            Err(format!("`{word}` is not a finite number: write it like 0.0125 or 1.25e-2"))
        }
    };
    Ok(vec3(number(x)?, number(y)?, number(z)?))
}

/// Writes a mesh as text with 17 significant digits, which give back the same numbers.
///
/// # Errors
/// Where the writer fails.
pub fn write_stl_ascii(mesh: &TriangleMesh, name: &str, writer: &mut impl Write) -> io::Result<()> {
    let name: String = name.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    writeln!(writer, "solid {name}")?;
    for triangle in 0..mesh.triangles.len() {
        let normal = mesh.normal(triangle).unwrap_or_default();
        writeln!(writer, "facet normal {:.16e} {:.16e} {:.16e}\nouter loop", normal.x, normal.y, normal.z)?;
        for corner in mesh.corners(triangle) {
            writeln!(writer, "vertex {:.16e} {:.16e} {:.16e}", corner.x, corner.y, corner.z)?;
        }
        writeln!(writer, "endloop\nendfacet")?;
    }
    writeln!(writer, "endsolid {name}")
}

/// Writes a mesh in binary; vertices are rounded to single precision.
///
/// # Errors
/// Where the writer fails, or where the mesh has more triangles or larger coordinates than the format can hold.
#[expect(clippy::cast_possible_truncation, reason = "the format stores single precision")]
pub fn write_stl_binary(mesh: &TriangleMesh, writer: &mut impl Write) -> io::Result<()> {
    let count = u32::try_from(mesh.triangles.len()).map_err(|_| {
        io::Error::new(io::ErrorKind::InvalidInput, "more than 2^32 triangles do not fit a binary STL file")
    })?;
    let mut header = [b' '; 80];
    header[..14].copy_from_slice(b"binary surface");
    writer.write_all(&header)?;
    writer.write_all(&count.to_le_bytes())?;
    for triangle in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(triangle);
        for number in [mesh.normal(triangle).unwrap_or_default(), a, b, c].iter().flat_map(|v| v.iter()) {
            let single = *number as f32;
            if !single.is_finite() {
                let message = format!("the coordinate {number:e} does not fit a binary STL file: write it as text");
                return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
            }
            writer.write_all(&single.to_le_bytes())?;
        }
        writer.write_all(&[0; 2])?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn soup() -> impl Strategy<Value = TriangleMesh> {
        let number = || prop_oneof![-1.0..1.0_f64, -1e-9..1e9_f64, Just(0.1), Just(1.0 / 3.0)];
        let corner = (number(), number(), number()).prop_map(|(x, y, z)| vec3(x, y, z));
        let corners = prop::collection::vec([corner.clone(), corner.clone(), corner], 1..20);
        corners.prop_map(|soup| TriangleMesh::from_soup(&soup))
    }

    fn ascii(mesh: &TriangleMesh) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_stl_ascii(mesh, "part\nfacet", &mut bytes).unwrap();
        bytes
    }

    fn binary(mesh: &TriangleMesh) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_stl_binary(mesh, &mut bytes).unwrap();
        bytes
    }

    fn message(bytes: &[u8]) -> String {
        let error = parse_stl(bytes).unwrap_err();
        StlError { path: "part.stl".into(), ..error }.to_string()
    }

    proptest! {
        #[test]
        fn text_gives_back_every_bit(mesh in soup()) {
            prop_assert_eq!(parse_stl(&ascii(&mesh)).unwrap(), mesh);
        }

        #[test]
        fn binary_gives_back_single_precision(mesh in soup(), solid in any::<bool>()) {
            #[expect(clippy::cast_possible_truncation, reason = "the rounding under test")]
            let rounded: Vec<[Vec3; 3]> = (0..mesh.triangles.len())
                .map(|t| mesh.corners(t).map(|corner| corner.map(|x| f64::from(x as f32))))
                .collect();
            let mut bytes = binary(&mesh);
            if solid {
                bytes[..5].copy_from_slice(b"solid");
            }
            prop_assert_eq!(parse_stl(&bytes).unwrap(), TriangleMesh::from_soup(&rounded));
        }

        #[test]
        fn any_bytes_are_read_or_refused(mut bytes in prop::collection::vec(any::<u8>(), 0..400), solid in any::<bool>()) {
            if solid {
                bytes.splice(0..0, *b"solid\n");
            }
            let _ = parse_stl(&bytes);
        }

        #[test]
        fn a_damaged_file_is_read_or_refused(
            mesh in soup(), text in any::<bool>(), cut in 0.0..1.3_f64, at in 0.0..1.0_f64, with in any::<[u8; 4]>(),
        ) {
            let mut bytes = if text { ascii(&mesh) } else { binary(&mesh) };
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in the file")]
            let place = |share: f64| (share * bytes.len() as f64) as usize;
            let (cut, at) = (place(cut), place(at));
            for (byte, new) in bytes[at..].iter_mut().zip(with) {
                *byte = new;
            }
            bytes.truncate(cut);
            if let Ok(read) = parse_stl(&bytes) {
                prop_assert!(read.triangles.len() <= mesh.triangles.len());
                prop_assert!(read.vertices.iter().all(|v| v.iter().all(|x| x.is_finite())));
            }
        }

        /// What is cut off within the triangles is never taken for a smaller whole file.
        #[test]
        fn a_cut_file_is_refused(mesh in soup(), text in any::<bool>(), share in 0.0..1.0_f64) {
            let bytes = if text { ascii(&mesh) } else { binary(&mesh) };
            // the closing line of the text is `endsolid part facet`; cut before its first word ends
            let end = bytes.len() - if text { b"lid part facet\n".len() } else { 0 };
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in the file")]
            let cut = (share * end as f64) as usize;
            prop_assert!(parse_stl(&bytes[..cut]).is_err());
        }
    }

    #[test]
    fn text_is_read_as_other_programs_write_it() {
        let text = "  SOLID my part\r\n\r\n FACET NORMAL 0 0 1\r\n  outer loop\r\n   vertex +1.E+0 0 -0\n   vertex 0 1 0\n\
                    vertex 0 0 1e-3\n endloop\n endfacet\nendsolid\nsolid two\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\n\
                    vertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid two";
        let mesh = parse_stl(text.as_bytes()).unwrap();
        assert_eq!((mesh.triangles.len(), mesh.vertices.len()), (2, 4));
        assert_eq!(mesh.corners(0), [vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(0.0, 0.0, 1e-3)]);
    }

    #[test]
    fn errors_say_where_and_what_next() {
        let start = "solid a\nfacet normal 0 0 1\nouter loop\n";
        let two = "vertex 0 0 0\nvertex 1 0 0\n";
        for (text, expected) in [
            (format!("{start}{two}vertex 0 1,5 0\n"), "part.stl:6: `1,5` is not a finite number: write it like"),
            (format!("{start}{two}vertex 0 nan 0\n"), "part.stl:6: `nan` is not a finite number"),
            (format!("{start}{two}vertex 0 1\n"), "part.stl:6: a vertex has three coordinates, found 2"),
            (format!("{start}{two}endloop\n"), "part.stl:6: expected `vertex` and three numbers, found `endloop`"),
            (format!("{start}{two}vertex 0 1 0\n{two}"), "part.stl:7: expected `endloop` after three vertices"),
            (format!("{start}{two}"), "part.stl:5: the file ends where `vertex` and three numbers should follow"),
            ("solid a\nendsolid a\n".into(), "part.stl: the STL file holds no triangles"),
            ("hello".into(), "part.stl: 5 bytes are neither a text STL file"),
        ] {
            let found = message(text.as_bytes());
            assert!(found.starts_with(expected), "{found}");
        }
        let mesh = TriangleMesh::box_mesh(&Vec3::zeros(), &vec3(1.0, 1.0, 1.0));
        let mut bytes = binary(&mesh);
        assert!(message(&bytes[..300]).contains("12 triangles has 684 bytes, this one has 300"));
        // a count of 4 billion allocates nothing
        bytes[80..84].fill(0xff);
        assert!(message(&bytes).contains("4294967295 triangles"));
        let mut bytes = binary(&mesh);
        bytes[84 + 50 + 12 + 16..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(message(&bytes).starts_with("part.stl: byte 162: coordinate y of vertex 2 of triangle 1 is NaN"));
    }

    #[test]
    fn a_missing_file_and_a_directory_are_refused() {
        let directory = tempfile::tempdir().unwrap();
        let missing = read_stl(&directory.path().join("no.stl")).unwrap_err();
        assert!(missing.to_string().contains("no.stl: cannot read the STL file"));
        assert!(read_stl(directory.path()).unwrap_err().to_string().ends_with("give the path of an STL file"));
        let path = directory.path().join("box.stl");
        let mesh = TriangleMesh::box_mesh(&Vec3::zeros(), &vec3(1.0, 1.0, 1.0));
        std::fs::write(&path, ascii(&mesh)).unwrap();
        assert_eq!(read_stl(&path).unwrap().triangles.len(), 12);
    }

    #[test]
    fn what_single_precision_cannot_hold_is_refused() {
        let mesh = TriangleMesh::box_mesh(&Vec3::zeros(), &vec3(1.0, 1.0, 1e39));
        assert!(write_stl_binary(&mesh, &mut Vec::new()).unwrap_err().to_string().contains("does not fit"));
    }
}
