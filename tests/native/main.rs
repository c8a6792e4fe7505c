//! What the native solver must keep whatever it is used for: invariance under meshing and threads, conservation, borders, lists,
//! prescribed particles, the watchdog. One target, so that it is linked once.

mod common;
mod cost;
mod determinism;
mod domain;
mod energy;
mod lists;
mod prescribed;
mod walls;
mod watchdog;
