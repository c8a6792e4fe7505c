//! `density-missing` (error): particles without a density have no mass.

use super::Subject;

pub(super) fn check(subject: &Subject<'_>) {
    for class in &subject.draft.classes {
        let Some(material) = class.item.as_ref().map(|class| class.material) else { continue };
        let name = subject.material(material).to_owned();
        let path = format!("material.{name}");
        let missing = subject.draft.materials[usize::from(material)].density.is_none();
        if missing && !subject.written.has_path(&format!("{path}.density")) {
            subject.error(
                "density-missing",
                &path,
                format!("material \"{name}\" has no `density`, and particles are made of it"),
                "add for example `density = \"2500 kg/m3\"`",
            );
        }
    }
}
