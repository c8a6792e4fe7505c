//! `tollgate stream`: looks at stored streams, checks, exports, imports and moves them.

use super::print;
use clap::{Args, Subcommand};
use std::fs::File;
use std::path::{Path, PathBuf};
use tollgate::exit_code;
use tollgate::gate::stream::format::{Origin, Role};
use tollgate::gate::stream::import::{ImportError, import};
use tollgate::gate::stream::reader::StreamReader;
use tollgate::gate::stream::survey::survey;
use tollgate::gate::stream::transform::transform_stream;
use tollgate::geometry::plane::{Aperture, GatePlane};
use tollgate::material::Material;
use tollgate::math::{Vec3, vec3};
use tollgate::output::stream_export::{write_csv, write_vtp};
use tollgate::output::vtp::Precision;
use tollgate::particle::Body;
use tollgate::scene::gate::{PassingPoint, Transform};
use tollgate::storage::StorageError;

#[derive(Debug, Args)]
pub struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Say where a stream comes from, what it holds, and what it advises for plane, L1 and L2
    Show(ShowArguments),
    /// Check every byte, and what must hold of every crossing; exit code 5 with the reason where something is wrong
    Check(CheckArguments),
    /// Write a stream as tables or as points for ParaView
    Export(ExportArguments),
    /// Make a stream of a table of passages that any other code has written
    ///
    /// The table needs the columns time_s, x_m, y_m, z_m, vx_m_per_s, vy_m_per_s, vz_m_per_s, radius_m. It may have
    /// spin_x_rad_per_s, spin_y_rad_per_s, spin_z_rad_per_s (else particles do not turn), density_kg_per_m3, material (else the
    /// first one given) and id (else the row's number). Other columns are ignored. Rows may come in any order.
    ///
    /// A row is the passage of a centre through the plane. One that lies up to a radius off the plane is moved onto it in free
    /// fall, in time and place. There are no contacts and no paths; all that is wrong in the table is listed at once.
    Import(ImportArguments),
    /// Write a moved copy of a stream: mirrored first, then rotated, then moved
    Transform(TransformArguments),
}

#[derive(Debug, Args)]
struct ShowArguments {
    /// The stream's folder
    stream: PathBuf,
    /// As JSON on stdout
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct CheckArguments {
    /// The stream's folder
    stream: PathBuf,
}

#[derive(Debug, Args)]
struct ExportArguments {
    /// The stream's folder
    stream: PathBuf,
    /// Table of crossings, one row each, units in the header
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Table of their contacts, one row each
    #[arg(long, value_name = "FILE", requires = "csv")]
    contacts: Option<PathBuf>,
    /// Folder for the passages as points, and passages.pvd, which opens them in ParaView
    #[arg(long, value_name = "DIR")]
    vtp: Option<PathBuf>,
}

#[derive(Debug, Args)]
struct ImportArguments {
    /// Folder of the new stream
    stream: PathBuf,
    /// Table of passages
    #[arg(long, value_name = "FILE")]
    csv: PathBuf,
    /// Time step [s]; the grid state is that of the first step at or after the passage
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    timestep: f64,
    /// Gate plane: a point [m] and the normal along the direction of passage
    #[arg(long, value_name = "X,Y,Z,NX,NY,NZ", value_parser = numbers::<6>, allow_hyphen_values = true)]
    plane: [f64; 6],
    /// Radius of the plane's opening around its point [m]; else the plane is unbounded
    #[arg(long, value_name = "METRES", value_parser = positive)]
    opening: Option<f64>,
    /// Material by its name in the scene, with its density [kg/m3]; may be repeated
    #[arg(long = "material", value_name = "NAME=DENSITY", value_parser = material, required = true)]
    materials: Vec<(String, f64)>,
    /// Gravity [m/s2]
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true, default_value = "0,0,-9.81")]
    gravity: [f64; 3],
    /// Thickness of discs [m], for a plane problem; else particles are spheres
    #[arg(long, value_name = "METRES", value_parser = positive)]
    disc_thickness: Option<f64>,
}

#[derive(Debug, Args)]
struct TransformArguments {
    /// The stream's folder
    stream: PathBuf,
    /// Folder of the moved copy
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Mirror plane: a point [m] and its normal
    #[arg(long, value_name = "X,Y,Z,NX,NY,NZ", value_parser = numbers::<6>, allow_hyphen_values = true)]
    mirror: Option<[f64; 6]>,
    /// Rotation: axis, angle [degrees] by the right-hand rule, a point of the axis [m]
    #[arg(long, value_name = "AX,AY,AZ,DEGREES,X,Y,Z", value_parser = numbers::<7>, allow_hyphen_values = true)]
    rotate: Option<[f64; 7]>,
    /// Translation [m]
    #[arg(long = "move", value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true)]
    translate: Option<[f64; 3]>,
}

fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let values: Option<Vec<f64>> =
        text.split(',').map(|value| value.trim().parse().ok().filter(|number: &f64| number.is_finite())).collect();
    values
        .and_then(|values| values.try_into().ok())
        .ok_or_else(|| format!("write {N} numbers with commas between them, without blanks"))
}

fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| *number > 0.0 && number.is_finite());
    number.ok_or_else(|| "write a number above zero".to_owned())
}

fn material(text: &str) -> Result<(String, f64), String> {
    let (name, density) = text.split_once('=').ok_or("write NAME=DENSITY, as in sinter=3300")?;
    Ok((name.trim().to_owned(), positive(density.trim())?))
}

/// The unit vector along three numbers, and where it is not one, why.
fn direction(what: &str, [x, y, z]: [f64; 3]) -> Result<Vec3, Failure> {
    vec3(x, y, z).try_normalize(0.0).ok_or_else(|| Failure::Usage(format!("the {what} must not be zero")))
}

/// Why a verb ends without its result.
enum Failure {
    Usage(String),
    Storage(StorageError),
}

impl From<StorageError> for Failure {
    fn from(error: StorageError) -> Self {
        Self::Storage(error)
    }
}

pub fn run(arguments: &Arguments) -> u8 {
    let result = match &arguments.verb {
        Verb::Show(arguments) => show(arguments),
        Verb::Check(arguments) => check(&arguments.stream),
        Verb::Export(arguments) => export(arguments),
        Verb::Import(arguments) => import_table(arguments),
        Verb::Transform(arguments) => transform(arguments),
    };
    match result {
        Ok(()) => exit_code::DONE,
        Err(Failure::Usage(text)) => {
            print::message(&text);
            exit_code::USAGE
        }
        Err(Failure::Storage(error)) => {
            print::message(&error.to_string());
            error.exit_code()
        }
    }
}

fn show(arguments: &ShowArguments) -> Result<(), Failure> {
    let survey = survey(&StreamReader::open(&arguments.stream)?, |_| {})?;
    if arguments.json {
        print::result(&serde_json::to_string_pretty(&survey).expect("a survey is plain numbers and names"));
    } else {
        print::result(&survey.to_text());
    }
    Ok(())
}

fn check(place: &Path) -> Result<(), Failure> {
    let reader = StreamReader::open(place)?;
    let checked = reader.verify(|_| {})?;
    let counts = checked.counts;
    print::result(&format!(
        "{}: whole and unchanged: {} chunks, {} bytes, {} crossings, {} contacts, {} motions of paths, {:.6} kg\n\
         checked: manifest, digest of every column, order of steps, identities, partners, finite numbers, counts, mass\n\
         digest {}",
        place.display(),
        checked.chunks,
        checked.bytes,
        counts.crossings,
        counts.contacts,
        counts.motions,
        counts.mass,
        reader.manifest().digest()
    ));
    Ok(())
}

fn export(arguments: &ExportArguments) -> Result<(), Failure> {
    let ExportArguments { stream, csv, contacts, vtp } = arguments;
    if csv.is_none() && vtp.is_none() {
        return Err(Failure::Usage("say what to write: --csv FILE, --vtp DIR, or both".to_owned()));
    }
    if csv.is_some() && csv == contacts {
        return Err(Failure::Usage("crossings and contacts need two files".to_owned()));
    }
    let reader = StreamReader::open(stream)?;
    if let Some(table) = csv {
        write_csv(&reader, table, contacts.as_deref())?;
    }
    if let Some(folder) = vtp {
        write_vtp(&reader, folder, Precision::Double)?;
    }
    let counts = reader.manifest().counts;
    print::result(&format!("{} crossings, {} contacts exported", counts.crossings, counts.contacts));
    Ok(())
}

fn import_table(arguments: &ImportArguments) -> Result<(), Failure> {
    let origin = origin(arguments)?;
    let table = File::open(&arguments.csv)
        .map_err(|error| Failure::Usage(format!("cannot open {}: {error}", arguments.csv.display())))?;
    match import(table, origin, &arguments.stream) {
        Ok(imported) => {
            for column in &imported.ignored {
                print::message(&format!("column {column:?} is not read"));
            }
            if imported.moved > 0 {
                let (moved, longest) = (imported.moved, imported.longest);
                print::message(&format!(
                    "{moved} passages were moved onto the plane in free fall, by {longest:e} m at most"
                ));
            }
            let counts = imported.manifest.counts;
            let place = arguments.stream.display();
            print::result(&format!("{place}: {} crossings, {:.6} kg", counts.crossings, counts.mass));
            Ok(())
        }
        Err(ImportError::Table(faults)) => {
            let lines: Vec<String> =
                faults.iter().map(|fault| format!("{}: {fault}", arguments.csv.display())).collect();
            let count = lines.len();
            Err(Failure::Usage(format!("{}\n{count} faults; nothing was written", lines.join("\n"))))
        }
        Err(ImportError::Storage(error)) => Err(error.into()),
    }
}

fn origin(arguments: &ImportArguments) -> Result<Origin, Failure> {
    let [x, y, z, nx, ny, nz] = arguments.plane;
    let file = arguments.csv.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let body = arguments.disc_thickness.map_or(Body::Sphere, |thickness| Body::Disc { thickness });
    let mut materials: Vec<Material> = Vec::new();
    for (name, density) in &arguments.materials {
        if materials.iter().any(|earlier| earlier.name == *name) {
            return Err(Failure::Usage(format!("material {name:?} is given twice")));
        }
        materials.push(Material { name: name.clone(), density: Some(*density), elasticity: None });
    }
    Ok(Origin {
        gate: "imported".to_owned(),
        plane: GatePlane {
            point: vec3(x, y, z),
            normal: direction("plane's normal", [nx, ny, nz])?,
            aperture: arguments.opening.map_or(Aperture::Unbounded, |radius| Aperture::Disc { radius }),
        },
        passage: PassingPoint::Centre,
        gravity: Vec3::from(arguments.gravity),
        exclusion: None,
        paths: None,
        role: Role::HandOver,
        stage: file.clone(),
        stage_key: String::new(),
        backend: "imported".to_owned(),
        backend_version: String::new(),
        numerics_version: 0,
        timestep: arguments.timestep,
        contacts: false,
        materials,
        part_names: Vec::new(),
        body,
        feeds: vec!["imported".to_owned()],
        laws: "unknown".to_owned(),
        provenance: vec![format!("imported from {file}")],
    })
}

fn transform(arguments: &TransformArguments) -> Result<(), Failure> {
    let mirror = arguments
        .mirror
        .map(|[x, y, z, nx, ny, nz]| Ok::<_, Failure>((vec3(x, y, z), direction("mirror's normal", [nx, ny, nz])?)))
        .transpose()?;
    let rotation = arguments
        .rotate
        .map(|[ax, ay, az, degrees, x, y, z]| {
            Ok::<_, Failure>((direction("axis of rotation", [ax, ay, az])?, degrees.to_radians(), vec3(x, y, z)))
        })
        .transpose()?;
    let translation = arguments.translate.map_or_else(Vec3::zeros, Vec3::from);
    let transform = Transform { mirror, rotation, translation };
    if transform.is_identity() {
        return Err(Failure::Usage("say how to move it: --mirror, --rotate, --move".to_owned()));
    }
    let reader = StreamReader::open(&arguments.stream)?;
    let manifest = transform_stream(&reader, &transform, &arguments.out, |_| {})?;
    let before = reader.manifest().origin.gravity;
    if (manifest.origin.gravity - before).norm() > 1e-9 * before.norm() {
        print::message(
            "gravity was turned with the stream: in a scene with the old gravity its paths and passages do not fit any more",
        );
    }
    print::result(&format!("{}: {} crossings", arguments.out.display(), manifest.counts.crossings));
    Ok(())
}
