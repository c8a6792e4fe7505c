//! What LIGGGHTS sampled at the gates, turned into streams.

pub mod contacts;
