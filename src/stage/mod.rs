//! Stages: one solver run over one region and time. How they follow each other stands in [`graph`], what each of them sees
//! in [`split`], what identifies its result in [`key`], which is a hash of the text that [`canonical`] writes.

pub mod canonical;
pub mod graph;
pub mod key;
pub mod split;
