//! `liggghts-cadence` (error): LIGGGHTS inserts and removes particles between two samples, so batches are whole numbers of them;
//! and a processor grid has as many places as there are ranks.

use super::Subject;

pub(super) fn check(subject: &Subject<'_>) {
    let settings = &subject.draft.liggghts;
    let (sample, batch) = (settings.sample_every, settings.batch_every);
    let error = |key: &str, what: String, next: String| {
        subject.error("liggghts-cadence", &format!("liggghts.{key}"), what, next);
    };
    if sample == 0 || batch == 0 {
        let key = if sample == 0 { "sample_every" } else { "batch_every" };
        error(key, format!("`{key}` is 0 time steps"), "write a number above 0, for example 20".to_owned());
    } else if batch % sample != 0 {
        let next = format!("write a multiple of {sample}, for example {}", batch.next_multiple_of(sample));
        error("batch_every", format!("batches every {batch} time steps fall between samples every {sample}"), next);
    }
    if settings.ranks == 0 {
        error("ranks", "`ranks` is 0".to_owned(), "write 1 or more".to_owned());
    } else if let Some(grid) = settings.processors
        && grid.iter().map(|count| u64::from(*count)).product::<u64>() != u64::from(settings.ranks)
    {
        let what = format!("the grid {} x {} x {} is not {} ranks", grid[0], grid[1], grid[2], settings.ranks);
        error("processors", what, "make their product `ranks`, or leave `processors` out".to_owned());
    }
}
