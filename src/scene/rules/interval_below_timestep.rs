//! `interval-below-timestep` (error): nothing can be written more often than the solver steps.

use super::{Subject, join};

pub(super) fn check(subject: &Subject<'_>) {
    let Some(timestep) = subject.draft.solver.timestep else { return };
    let output = &subject.draft.output;
    let series = subject.written.has_path("output.series").then_some(output.series_interval);
    for (key, interval) in
        [("frames", output.frame_interval), ("series", series), ("checkpoints", output.checkpoint_interval)]
    {
        if let Some(interval) = interval
            && interval < timestep
        {
            subject.error(
                "interval-below-timestep",
                &join("output", key),
                format!("`{key}` asks for an interval of {interval} s, and the time step is {timestep} s"),
                "make the interval longer than the time step",
            );
        }
    }
}
