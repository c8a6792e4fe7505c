//! The stream: what passed a gate, on disk.
//!
//! A folder with `manifest.json` ([`format`]: where it comes from, what it counts) and chunk files of columns
//! ([`columns`]), ordered by (step, id). [`writer`] fills a staging folder chunk by chunk and renames it at the end, so that
//! a stream is whole or absent; [`reader`] trusts nothing it has not checked. Both hold one chunk at a time.
//! [`survey`] says what a stream contains and what it advises, [`transform`] moves it, [`import`] makes one of a table.

pub mod advice;
mod check;
pub mod columns;
pub mod format;
mod identities;
pub mod import;
pub mod reader;
pub mod survey;
pub mod transform;
pub mod writer;

#[cfg(test)]
mod sample;
#[cfg(test)]
mod tests;
