//! Where particles touch parts that are no planes: found in every time step before loads are computed.

use super::meeting::ContactScene;
use super::neighbor::list::Memory;
use super::wall::{Due, Walls};
use super::wall_contacts::left_at_wall;
use super::wall_list::{NONE, PartList, Places, WallList};
use crate::math::lanes::{LaneWork, Lanes};

/// Scratch lists of a chunk, kept to save allocations.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    due: Due,
    next: Places,
    /// Which old contact each next one continues.
    continued: Vec<u32>,
    taken: Vec<bool>,
    component: Vec<f64>,
}

/// Finds where the particles of a chunk touch the parts of its list now. What goes on keeps its memory.
pub struct WallSearch<'a> {
    /// What all chunks read.
    pub scene: &'a ContactScene<'a>,
    /// Parts.
    pub walls: &'a Walls,
    /// Upper bound on the approach of particles and parts since the candidates were collected [m].
    pub approached: f64,
    /// The chunk's list.
    pub list: &'a mut WallList,
    /// Scratch lists.
    pub scratch: &'a mut Scratch,
    /// Whether some of its particles may be prescribed: these have no contacts with parts.
    pub has_prescribed: bool,
    /// Whether losses are accounted for.
    pub energy: bool,
}

impl LaneWork for WallSearch<'_> {
    /// What the springs of contacts that ended still held [J].
    type Output = f64;

    #[inline(always)]
    fn run<L: Lanes>(self) -> f64 {
        let Self { scene, walls, approached, list, scratch, has_prescribed, energy } = self;
        let mut left = 0.0;
        let prescribed = |particle: u32| has_prescribed && scene.velocities[particle as usize].path.is_prescribed();
        for list in list.parts.iter_mut().filter(|list| !list.is_plane) {
            let (places, Scratch { due, next, continued, taken, .. }) = (&list.places, &mut *scratch);
            next.resize(0);
            continued.clear();
            taken.clear();
            taken.resize(places.count, false);
            let mut held = 0..0;
            let spheres = scene.spheres;
            walls.contacts_when_due::<L>(&mut list.near, approached, spheres, prescribed, due, |particle, points| {
                held = places.next_of(held.end, particle);
                for point in points {
                    let old = places.recall(&held, &mut taken[held.clone()], point);
                    continued.push(old.map_or(NONE, |place| place as u32));
                    next.push(particle, point);
                }
            });
            if energy && scene.law.is_linear() {
                let ended = (0..list.places.count).filter(|&place| !scratch.taken[place]);
                left += ended.map(|place| list.left_at(place, scene, walls)).sum::<f64>();
            }
            list.move_memory(&scratch.continued, &mut scratch.component);
            std::mem::swap(&mut list.places, &mut scratch.next);
        }
        left
    }
}

impl PartList {
    /// Energy [J] that the spring of the contact at a place holds, overlap gone.
    fn left_at(&self, place: usize, scene: &ContactScene, walls: &Walls) -> f64 {
        let memory = self.memory.get(place).unwrap_or(Memory::NONE);
        left_at_wall(scene, self.places.particles[place], u32::from(walls.material(self.part)), &memory)
    }
}
