//! Campaign files: what they can say, and what is wrong with bad ones.

use std::fs;
use std::path::Path;
use tollgate::campaign::CampaignError;
use tollgate::campaign::file::{Campaign, read_text};
use tollgate::campaign::variant::{columns, label, variants};

const EVERYTHING: &str = include_str!("../campaigns/everything.toml");

fn read(text: &str) -> Result<Campaign, CampaignError> {
    read_text(text, Path::new("tests/campaigns/campaign.toml"))
}

#[test]
fn everything_that_a_campaign_can_say_is_understood() {
    let campaign = read(EVERYTHING).unwrap();
    assert_eq!((campaign.title.as_str(), campaign.replicates, campaign.whole_runs), ("everything", 3, 2));
    assert_eq!(campaign.scene, Path::new("tests/campaigns/../scenes/gate/hopper.toml"));
    assert_eq!(campaign.settings, [("solver.timestep".to_owned(), "\"40 us\"".to_owned())]);
    let headers: Vec<String> = columns(&campaign).iter().map(|column| column.header()).collect();
    assert_eq!(headers, ["height_mm", "friction", "steel", "amount", "grain_mm", "speed_m_per_s", "rolling"]);
    // 3 heights x 2 zipped pairs x 2 rows of the table x 4 of the sample.
    let all = variants(&campaign);
    assert_eq!(all.len(), 3 * 2 * 2 * 4);
    // Equal ratios: 1, 10, 100; both ends exactly.
    let heights: Vec<&str> = [0, 16, 32].map(|k: usize| all[k].values[0].cell.as_str()).into();
    assert_eq!(heights, ["1", "10", "100"]);
    assert_eq!(label(&columns(&campaign)[..3], &all[8]), "height = 1 mm, friction = 0.5, steel = false");
    // The table: one column named by the campaign, one by its own key.
    let set = |variant: usize, key: &str| {
        let found = all[variant].settings.iter().find(|(name, _)| name == key);
        found.map(|(_, value)| value.clone()).unwrap_or_else(|| panic!("{key}"))
    };
    assert_eq!((set(0, "feed.fill.amount").as_str(), set(4, "feed.fill.amount").as_str()), ("200", "300"));
    assert_eq!(set(4, "particle.sinter.diameter"), "\"5 mm\"");
    // The sample: one of each four classes, on a logarithmic scale for the second axis.
    let mut speeds: Vec<f64> = all[..4].iter().map(|variant| variant.values[5].number().unwrap()).collect();
    speeds.sort_by(f64::total_cmp);
    for (class, speed) in speeds.iter().enumerate() {
        let (low, high) = (1.0 + 0.5 * class as f64, 1.5 + 0.5 * class as f64);
        assert!((low..=high).contains(speed), "{speeds:?}");
    }
    let mut rolling: Vec<f64> = all[..4].iter().map(|variant| variant.values[6].number().unwrap().log10()).collect();
    rolling.sort_by(f64::total_cmp);
    assert!(rolling.iter().enumerate().all(|(class, share)| (class as f64 - 4.0..=class as f64 - 3.0).contains(share)), "{rolling:?}");
}

/// Each case of `bad.toml` states every finding it must get, on the line above `#^`.
#[test]
fn bad_campaigns_get_exactly_the_findings_they_state() {
    let corpus = fs::read_to_string("tests/campaigns/bad.toml").unwrap();
    let mut wrong = Vec::new();
    for (number, case) in corpus.split("\n+++\n").enumerate() {
        let mut stated = Vec::new();
        let mut above = 0;
        for (index, line) in case.lines().enumerate() {
            match line.strip_prefix("#^ ") {
                Some(text) => stated.push((above, text.to_owned())),
                None => above = index + 1,
            }
        }
        assert!(!stated.is_empty(), "case {number} states nothing");
        let mut found = match read(case) {
            Err(CampaignError::Findings(findings)) => findings.into_iter().map(|f| (f.line, f.what)).collect(),
            other => vec![(0, format!("{other:?}"))],
        };
        stated.sort();
        found.sort();
        if stated != found {
            wrong.push(format!("case {number}\n  stated {stated:#?}\n  found {found:#?}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
