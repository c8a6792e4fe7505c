//! What the native solver must keep whatever it is used for: invariance under meshing and threads, conservation, borders, lists,
//! prescribed particles, the watchdog. One target, so that it is linked once.

#[path = "../common/draw.rs"]
mod draw;

mod common;
mod cost;
mod determinism;
mod domain;
mod energy;
mod hand_over;
mod held_contacts;
mod late;
mod lists;
mod prescribed;
mod simd;
mod sleeping;
mod tether;
mod views;
mod walls;
mod watchdog;
