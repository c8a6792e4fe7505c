//! The example of a campaign, with a tenth of its particles and two of its ten tilts.

use super::common::{results, run, starts, statuses};
use crate::program::Bench;
use std::fs;

#[test]
fn two_tilts_of_the_example_share_their_hoppers() {
    let bench = Bench::new();
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/chute-tilt-campaign");
    let text = fs::read_to_string(format!("{folder}/campaign.toml")).unwrap();
    let text = text.replace("version = 1\n", &format!("version = 1\nscene = \"{folder}/scene.toml\"\n"));
    let text = text.replace("whole_runs = 2\n", "[set]\n\"feed.belt.amount\" = 200\n\"output.frames\" = \"1 s\"\n");
    fs::write(bench.path("campaign.toml"), text).unwrap();
    let answer = run(&bench, &["--only", "tilt=30", "--only", "tilt=50"]);
    assert_eq!(answer.code, 0, "{answer:?}");
    assert_eq!(statuses(&bench), ["done", "done"]);
    assert_eq!(starts(&bench), [1; 3], "one upstream, two downstream");
    let rows = results(&bench);
    assert_eq!((rows[0]["tilt_deg"].as_str(), rows[1]["tilt_deg"].as_str()), ("30", "50"));
    assert_eq!(rows[0]["key.hoppers"], rows[1]["key.hoppers"]);
    // The lower end of the steep chute lies nearer to the wall, and most of the charge with it (the example's page).
    let centre = |row: usize| rows[row]["chute.centre_x_m"].parse::<f64>().unwrap();
    assert!(centre(1) < centre(0), "{} {}", centre(0), centre(1));
    for stage in ["chute", "hoppers"] {
        for entry in fs::read_dir(bench.path(&format!("out/stages/{stage}"))).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            let summary = bench.summary(&format!("out/stages/{stage}/{name}"));
            assert!(
                summary.list("/removed").is_empty() || stage == "hoppers",
                "nothing leaves the box: {:?}",
                summary.0
            );
        }
    }
    assert!(bench.text("out/figures/profiles-chute.heap.svg").contains("30 deg"));
}
