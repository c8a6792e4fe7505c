//! Pruning against one pair at a time.

use super::super::list::{Memory, NO_IMAGE};
use super::*;
use crate::dem::particles::Path;
use crate::math::{Vec3, vec3};

const SKIN: f64 = 0.125;
const SIZE: Vec3 = Vec3::new(2.0, 1.5, f64::INFINITY);

struct Draw(u64);

impl Draw {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit
    }

    fn uniform(&mut self) -> f64 {
        self.below(1 << 31) as f64 / (1_u64 << 31) as f64
    }
}

/// Spheres on a grid so fine that many are exactly in contact or exactly at the skin, and others at any place and of any radius.
fn spheres(draw: &mut Draw, count: usize) -> Vec<Sphere> {
    let mut sphere = |index: usize| {
        let mut centre = [0, 1, 2].map(|_| draw.below(24) as f64 * 0.125);
        if index.is_multiple_of(3) {
            centre = centre.map(|x| x + 0.1 * draw.uniform());
        }
        Sphere { centre, radius: if index.is_multiple_of(5) { 0.5 + draw.uniform() } else { 0.5 } }
    };
    (0..count).map(&mut sphere).collect()
}

fn velocities(draw: &mut Draw, count: usize) -> Vec<Velocity> {
    let velocity = |_| Velocity {
        linear: [f64::NAN; 3],
        inverse_mass: draw.uniform(),
        angular: [f64::NAN; 3],
        material: 0,
        path: Path::Free,
    };
    (0..count).map(velocity).collect()
}

/// So many pairs of any two particles; every other one with an image, where there are images.
fn pairs(draw: &mut Draw, particles: usize, count: usize, with_images: bool) -> OuterList {
    let mut index = |_| draw.below(particles as u64) as u32;
    let (owners, partners) = ((0..count).map(&mut index).collect(), (0..count).map(&mut index).collect());
    // Along the last axis there are none.
    let images = if with_images {
        (0..count as u32).map(|n| if n % 2 == 0 { NO_IMAGE } else { 9 + n % 9 }).collect()
    } else {
        Vec::new()
    };
    OuterList { owners, partners, images }
}

/// Places of the pairs in the order of the sections, each by the formula for one pair.
fn expected(outer: &OuterList, bodies: &Bodies) -> Vec<u32> {
    let mut sections = [const { Vec::new() }; SECTIONS];
    for place in 0..outer.len() {
        let indices = [outer.owners[place] as usize, outer.partners[place] as usize];
        let [own, other] = indices.map(|index| &bodies.spheres[index]);
        let mut distance = other.position() - own.position();
        if let Some(&image) = outer.images.get(place) {
            distance += bodies.images.offset(image);
        }
        let (square, touch) = (distance.norm_squared(), own.radius + other.radius);
        if square < (touch + SKIN) * (touch + SKIN) {
            let sleep = !bodies.asleep.is_empty() && indices.into_iter().all(|index| bodies.asleep[index]);
            let section = if sleep { 2 } else { usize::from(square >= touch * touch) };
            sections[section].push(place as u32);
        }
    }
    sections.concat()
}

#[test]
fn lanes_choose_and_sort_as_one_pair_at_a_time_does() {
    let (mut draw, images) = (Draw(5), Images::new(&SIZE));
    let remembered = Remembered { tangential: true, rolling: false };
    let (spheres, velocities) = (spheres(&mut draw, 400), velocities(&mut draw, 400));
    let dozing: Vec<bool> = (0..400).map(|_| draw.below(3) > 0).collect();
    let mut worn: Vec<InnerList> = vec![InnerList::default(); SimdLevel::ALL.len()];
    let mut scratch = PruningScratch::default();
    for count in (0..20).chain([997, 20_000]) {
        for (with_images, asleep) in [(false, &[][..]), (false, &dozing), (true, &[]), (true, &dozing)] {
            let outer = pairs(&mut draw, 400, count, with_images);
            let bodies = Bodies { spheres: &spheres, velocities: &velocities, images: &images, asleep };
            let expected = expected(&outer, &bodies);
            assert!(count < 997 || (expected.len() > count / 20 && expected.len() < count / 2), "{}", expected.len());
            for (level, worn) in SimdLevel::ALL.into_iter().zip(&mut worn).filter(|(level, _)| level.is_available()) {
                let inner = outer.pruned(level, bodies, SKIN, remembered, (std::mem::take(worn), &mut scratch));
                assert_eq!(inner.places, expected, "{count} pairs, {level:?}");
                assert_eq!(inner.len(), expected.len());
                for ((entry, owner, candidate), &place) in inner.pairs().zip(&expected) {
                    let place = place as usize;
                    assert_eq!((owner, candidate.partner), (outer.owners[place], outer.partners[place]));
                    assert_eq!(candidate.image, outer.images.get(place).copied().unwrap_or(NO_IMAGE));
                    let pair = [owner, candidate.partner].map(|index| index as usize);
                    let [a, b] = pair.map(|index| spheres[index].radius);
                    assert_eq!(inner.effective_radii[entry], a * b / (a + b));
                    let [a, b] = pair.map(|index| velocities[index].inverse_mass);
                    assert_eq!(inner.effective_masses[entry], 1.0 / (a + b));
                    assert!(inner.memory.get(entry).is_some());
                }
                assert_eq!(inner.owners.len() % MOST_LANES, 0);
                *worn = inner;
            }
        }
    }
}

#[test]
fn pairs_exactly_at_the_border_are_outside_of_it() {
    let at = |x: f64, radius: f64| Sphere { centre: [x, 0.0, 0.0], radius };
    // The gap is the skin, none, and just below either.
    let gaps = [SKIN, SKIN - f64::EPSILON, 0.0, -f64::EPSILON];
    let spheres: Vec<Sphere> = std::iter::once(at(0.0, 0.5)).chain(gaps.map(|gap| at(1.0 + gap, 0.5))).collect();
    let velocities = velocities(&mut Draw(1), spheres.len());
    let images = Images::new(&SIZE);
    let bodies = Bodies { spheres: &spheres, velocities: &velocities, images: &images, asleep: &[] };
    let outer = OuterList { owners: vec![0; 4], partners: vec![1, 2, 3, 4], images: Vec::new() };
    let remembered = Remembered { tangential: false, rolling: false };
    for level in SimdLevel::ALL.into_iter().filter(|level| level.is_available()) {
        let inner =
            outer.pruned(level, bodies, SKIN, remembered, (InnerList::default(), &mut PruningScratch::default()));
        assert_eq!(inner.places, [3, 1, 2], "{level:?}");
        assert_eq!(inner.memory.get(0), None);
    }
}

#[test]
fn memories_go_over_to_the_next_list_wherever_their_pairs_stand_in_it() {
    let (mut draw, images) = (Draw(9), Images::new(&SIZE));
    let (before, after, velocities) = (spheres(&mut draw, 60), spheres(&mut draw, 60), velocities(&mut draw, 60));
    let outer = pairs(&mut draw, 60, 3001, false);
    for rolling in [false, true] {
        let remembered = Remembered { tangential: true, rolling };
        let memory = |place: u32| {
            let spring = |factor: f64| vec3(f64::from(place) + 1.0, -0.0, factor * f64::from(place));
            Memory { tangential: spring(2.0), rolling: if rolling { spring(3.0) } else { Vec3::zeros() } }
        };
        let (level, scratch) = (SimdLevel::best(), &mut PruningScratch::default());
        let mut pruned = |spheres| {
            let bodies = Bodies { spheres, velocities: &velocities, images: &images, asleep: &[] };
            // Storage of a list that remembered other contacts.
            let mut worn = outer.pruned(level, bodies, SKIN, remembered, (InnerList::default(), &mut *scratch));
            (0..worn.len()).for_each(|entry| worn.memory.set(entry, &memory(7)));
            outer.pruned(level, bodies, SKIN, remembered, (worn, &mut *scratch))
        };
        let (mut held, mut next) = (pruned(&before), pruned(&after));
        for entry in 0..held.len() {
            held.memory.set(entry, &memory(held.places[entry]));
        }
        next.take_over(&held, outer.len(), &mut PruningScratch::default());
        let mut both = 0;
        for (entry, &place) in next.places.iter().enumerate() {
            let known = held.places.contains(&place);
            let expected = if known { memory(place) } else { Memory::NONE };
            assert_eq!(next.memory.get(entry), Some(expected), "place {place}");
            both += usize::from(known);
        }
        assert!(both > 20 && both < next.len(), "{both} of {}", next.len());
        // By owner and partner; who is not known keeps a blank memory.
        let mut recalled = pruned(&after);
        recalled.recall_each(|owner, partner| (owner < partner).then(|| memory(owner)));
        for (entry, owner, candidate) in recalled.pairs() {
            let expected = if owner < candidate.partner { memory(owner) } else { Memory::NONE };
            assert_eq!(recalled.memory.get(entry), Some(expected));
        }
    }
}
