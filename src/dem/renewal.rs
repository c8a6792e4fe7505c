//! When lists are renewed, and what of the old ones goes over to the new.

use super::neighbor::history::HeldMemory;
use super::neighborhood::{Chunk, ListSettings};
use super::simulation::Simulation;
use super::wall_contacts::PartLoad;
use super::wall_list::{NearParts, WallContact, WallList};
use super::wear::RENEW_SHARE;
use std::ops::Range;
use std::time::Instant;

impl Simulation {
    /// Renews what has become too old, after the particles moved and before contacts are computed.
    pub(super) fn refresh_neighborhood(&mut self) {
        let started = Instant::now();
        if self.neighborhood.inner_is_worn(&self.particles.spheres, &self.threads) {
            self.renew_lists();
        }
        if self.neighborhood.wear.towards_parts > self.neighborhood.settings().skin {
            self.collect_wall_candidates();
        }
        self.phases.neighborhood += started.elapsed();
    }

    /// Makes the inner lists anew, and the outer ones too where these are too old for that.
    pub(super) fn renew_lists(&mut self) {
        self.neighborhood.fit_inner_skin();
        if self.neighborhood.outer_is_worn(&self.particles.spheres, &self.threads) {
            self.rebuild_neighborhood();
            return;
        }
        let (spheres, velocities) = (&self.particles.spheres, self.particles.laws_velocities());
        self.neighborhood.prune(spheres, velocities, self.sleepers(), &self.threads);
    }

    /// Sorts the particles into storage order and makes every list anew, contact memories kept.
    pub(super) fn rebuild_neighborhood(&mut self) {
        // Newcomers stand at the end of the list: no memory is held for them.
        let held = self.neighborhood.gather_memory(&self.threads);
        self.make_lists(&held, |order| order);
    }

    /// Drops the particles that `keep` refuses, and makes every list anew.
    pub(super) fn retain(&mut self, keep: impl Fn(usize) -> bool) {
        let held = self.neighborhood.gather_memory(&self.threads);
        let kept: Vec<u32> = (0..self.particles.len() as u32).filter(|&index| keep(index as usize)).collect();
        self.particles.reorder(&kept, &self.threads);
        self.make_lists(&held, |order| order.iter().map(|&index| kept[index as usize]).collect());
    }

    /// Sorts the particles and makes every list anew. `origin` tells of their new order, `order[new] = old`, where each stood in the
    /// lists that `held` was gathered from.
    fn make_lists(&mut self, held: &HeldMemory, origin: impl FnOnce(Vec<u32>) -> Vec<u32>) {
        self.wrap_periodic();
        self.neighborhood.fit_inner_skin();
        let (cells, order) = self.neighborhood.storage_order(&self.particles.spheres, &self.threads);
        self.particles.reorder(&order, &self.threads);
        let old_index = origin(order);
        let walls = self.take_wall_contacts(&old_index);
        let near = self.take_wall_candidates();
        let bodies = (self.particles.spheres.as_slice(), self.particles.laws_velocities());
        self.neighborhood.make_lists(bodies, cells, self.sleepers(), &self.threads, |owner, partner| {
            held.of(old_index[owner as usize], old_index[partner as usize])
        });
        self.give_wall_candidates(&near, &old_index);
        self.give_wall_contacts(&walls);
    }

    /// All contacts with parts, renumbered: `old_index[new] = old`. Sorted by the new numbers.
    fn take_wall_contacts(&mut self, old_index: &[u32]) -> Vec<WallContact> {
        let chunks = &self.neighborhood.chunks;
        let held = self.threads.map(chunks.len(), |number| chunks[number].walls.contacts());
        if held.iter().all(Vec::is_empty) {
            return Vec::new();
        }
        let mut new_index = vec![u32::MAX; old_index.iter().map(|&old| old as usize + 1).max().unwrap_or(0)];
        old_index.iter().enumerate().for_each(|(new, &old)| new_index[old as usize] = new as u32);
        let renumbered = |contact: WallContact| {
            let new = new_index.get(contact.particle as usize).filter(|&&new| new != u32::MAX);
            new.map(|&particle| WallContact { particle, ..contact })
        };
        let mut contacts: Vec<WallContact> = held.into_iter().flatten().filter_map(renumbered).collect();
        contacts.sort_by_key(|contact| contact.particle);
        contacts
    }

    /// Hands contacts with parts, sorted by particle, to the chunks.
    pub(super) fn give_wall_contacts(&mut self, contacts: &[WallContact]) {
        let (parts, walls) = (self.setup.parts.len(), &self.walls);
        self.threads.for_each(self.neighborhood.chunks.iter_mut().collect(), |chunk: &mut Chunk| {
            let below = |border: usize| contacts.partition_point(|contact| (contact.particle as usize) < border);
            let own = &contacts[below(chunk.range.start)..below(chunk.range.end)];
            own.iter().for_each(|contact| chunk.walls.hold(walls, contact));
            chunk.part_loads = vec![PartLoad::default(); parts];
        });
    }

    /// The elements of parts near each particle, by the chunks that they stood in.
    fn take_wall_candidates(&mut self) -> Vec<(Range<usize>, WallList)> {
        let taken = |chunk: &mut Chunk| (chunk.range.clone(), std::mem::take(&mut chunk.walls));
        self.neighborhood.chunks.iter_mut().map(taken).collect()
    }

    /// Goes on with the elements near each particle, renumbered: `old_index[new] = old`. Those of newcomers, and all where much
    /// of the skin is used up or a particle may have gone round a periodic border, are collected.
    fn give_wall_candidates(&mut self, held: &[(Range<usize>, WallList)], old_index: &[u32]) {
        let ListSettings { skin, periodic, .. } = self.neighborhood.settings();
        if periodic != [false; 3] || self.neighborhood.wear.towards_parts > RENEW_SHARE * skin {
            self.collect_wall_candidates();
            return;
        }
        let near = NearParts::new(held, &self.threads);
        let (spheres, walls) = (&self.particles.spheres, &self.walls);
        self.threads.for_each(self.neighborhood.chunks.iter_mut().collect(), |chunk: &mut Chunk| {
            let mut found = Vec::new();
            for index in chunk.range.clone() {
                if let Some(known) = near.of(old_index[index] as usize) {
                    chunk.walls.push(walls, index, known);
                } else {
                    let sphere = &spheres[index];
                    walls.candidates(&sphere.position(), sphere.radius + skin, &mut found);
                    chunk.walls.push(walls, index, &found);
                }
            }
        });
    }

    /// Collects the elements of parts near each particle; contacts are kept.
    pub(super) fn collect_wall_candidates(&mut self) {
        let skin = self.neighborhood.settings().skin;
        let (spheres, walls) = (&self.particles.spheres, &self.walls);
        self.threads.for_each(self.neighborhood.chunks.iter_mut().collect(), |chunk: &mut Chunk| {
            let held = chunk.walls.contacts();
            chunk.walls = WallList::collect(spheres, walls, &chunk.range, skin);
            held.iter().for_each(|contact| chunk.walls.hold(walls, contact));
        });
        self.neighborhood.wear.towards_parts = 0.0;
    }
}
