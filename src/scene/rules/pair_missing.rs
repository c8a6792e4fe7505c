//! `pair-missing` (error): two materials that can touch need a `[[pair]]`: particles with each other and with parts.

use super::Subject;

pub(super) fn check(subject: &Subject<'_>) {
    if !subject.draft.pairs_whole {
        // The missing one may be the broken one.
        return;
    }
    let particles = subject.particle_materials();
    let mut wanted: Vec<(u16, u16, Option<&str>)> = Vec::new();
    for (index, a) in particles.iter().enumerate() {
        for b in &particles[index..] {
            wanted.push((*a, *b, None));
        }
        for part in &subject.draft.parts {
            wanted.push((*a, part.item.part.material, Some(&part.item.part.name)));
        }
    }
    let mut reported: Vec<(u16, u16)> = Vec::new();
    for (a, b, part) in wanted {
        let same = |x: u16, y: u16| (x, y) == (a, b) || (y, x) == (a, b);
        let given = subject.draft.pairs.iter().any(|pair| same(pair.item.a, pair.item.b));
        if given || reported.iter().any(|(x, y)| same(*x, *y)) {
            continue;
        }
        reported.push((a, b));
        let (a, b) = (subject.material(a), subject.material(b));
        let reason = match part {
            Some(part) => format!("part \"{part}\" is made of it"),
            None => "particles are made of both".to_owned(),
        };
        subject.error(
            "pair-missing",
            &format!("material.{b}"),
            format!("nothing says how {a} and {b} touch, and {reason}"),
            format!("add a [[pair]] with `between = [\"{a}\", \"{b}\"]`"),
        );
    }
}
