//! Who is near whom: cells, the order of storage, and pair lists.
//!
//! Two lists: the outer one holds all pairs within `skin` and is made from cells; the inner one is the outer one pruned to a
//! fifth of that and is what the contact kernel walks. Contact history lives beside the inner list.

pub mod cells;
pub mod chunks;
pub mod history;
pub mod list;
pub mod outer;
pub mod prune;
pub mod search;
pub mod sort;
