//! Streams that enter a LIGGGHTS case: ghosts enter in batches, move by themselves or along recorded paths, and become ordinary
//! particles at the sample in which their release is due.
//!
//! Recorded paths and releases are atomfile variables with one section a sample. What was found on the binary (3.8.0):
//! `group released variable release` takes an atomfile variable, `next` and `set` work in `run .. pre no every M ".."`, sections may
//! hold 0 lines, `set group ghost_recorded ..` takes an empty group ("0 settings made"), and all of them work before the first `run`.
//! A variable reads its first section where it is defined, and every tag in a section must be present by then: so
//! [`define`] belongs after the first batch, and sample 0 is [`STEER_SET`] and [`RELEASE`] without the [`STEER_NEXT`] and
//! [`RELEASE_NEXT`] that all later samples begin with.

/// Atomfile variables of recorded ghosts, which are also the names of their files: places, velocities, spins.
pub const STEERED: [&str; 9] = ["px", "py", "pz", "qx", "qy", "qz", "wx", "wy", "wz"];
/// Atomfile variable, and name of its file, that is 1 for the ghosts that are released at a sample.
pub const RELEASES: &str = "release";
/// Goes on to the next sample of the paths: only in a case with recorded ghosts, and not at sample 0.
pub const STEER_NEXT: &str = "next px py pz qx qy qz wx wy wz";
/// Puts recorded ghosts where they belong: only in a case with recorded ghosts.
pub const STEER_SET: &str =
    "set group ghost_recorded x v_px y v_py z v_pz vx v_qx vy v_qy vz v_qz omegax v_wx omegay v_wy omegaz v_wz";
/// Goes on to the next sample of the releases: not at sample 0.
pub const RELEASE_NEXT: &str = "next release";
/// Finds the ghosts that are released at this sample and makes them ordinary particles; for every group of ghosts of the case
/// [`leave`] follows, and then the dump of the group `released`. The group must have been defined, `group released subtract all all`.
pub const RELEASE: [&str; 3] =
    ["group released subtract released all", "group released variable release", "group active union active released"];
/// Dump of what has arrived, after all groups are as they should be.
pub const ARRIVALS_DUMP: &str = "write_dump released custom arrivals.dump id type radius density x y z vx vy vz omegax omegay omegaz \
     modify append yes sort id format '%d %d %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g'";

/// The command that takes released particles out of a group of ghosts.
#[must_use]
pub fn leave(ghosts: &str) -> String {
    format!("group {ghosts} subtract {ghosts} released")
}

/// The commands that define the variables, after the first batch has entered.
#[must_use]
pub fn define(recorded: bool) -> Vec<String> {
    let steered = STEERED.iter().copied().filter(|_| recorded);
    steered.chain([RELEASES]).map(|name| format!("variable {name} atomfile {}/{name}", super::files::PATHS)).collect()
}
