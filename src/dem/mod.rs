//! The native DEM solver.
//!
//! [`simulation`] holds the state and the order of a time step; `step` moves particles; [`pair_contacts`] and
//! [`wall_contacts`] find forces through [`contact`] and the laws in [`law`]; [`neighborhood`] knows who is near whom.

pub mod checkpoint;
pub mod contact;
pub mod energy;
pub mod feed;
pub mod ghost;
pub mod held_contact;
pub mod inspect;
mod integrate;
pub mod law;
mod leave;
pub mod lookup;
pub mod meeting;
pub mod momentum;
pub mod neighbor;
pub mod neighborhood;
pub mod occupancy;
pub mod pair_contacts;
pub mod particles;
pub mod phase;
pub mod pieces;
pub mod presence;
pub mod release;
pub mod removal;
mod renewal;
pub mod resting;
pub mod seen;
pub mod simulation;
pub mod sleep;
mod spring_energy;
mod step;
mod survey;
pub mod tether;
pub mod threads;
pub mod timescale;
pub mod touched;
pub mod view;
pub mod wall;
pub mod wall_contacts;
pub mod wall_list;
mod wall_search;
pub mod watchdog;
mod wear;
