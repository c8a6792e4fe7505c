//! `stream`: from a table to a stream and back, moved, checked and damaged.

use crate::common::{Answer, Bench};
use serde_json::Value;
use std::fs;

const HEADER: &str = "time_s,x_m,y_m,z_m,vx_m_per_s,vy_m_per_s,vz_m_per_s,radius_m,spin_x_rad_per_s,id";
const PLANE: &str = "0,0,0.2,0,0,-1";

/// A table of `count` passages through z = 0.2, one a millisecond, ever faster.
fn table(count: u32) -> String {
    let row = |k: u32| {
        let (time, x) = (f64::from(k) * 1e-3 + 1.0 / 3e3, f64::from(k % 10) * 1e-3);
        format!("{time:?},{x:?},0.001,0.2,0.1,0,{:?},0.002,{:?},{}\n", -0.5 - f64::from(k) * 1e-3, 2.0 * x, 100 + k)
    };
    format!("{HEADER}\n{}", (0..count).map(row).collect::<String>())
}

fn import(bench: &Bench, stream: &str, further: &[&str]) -> Answer {
    let arguments = ["stream", "import", stream, "--csv", "table.csv", "--timestep", "1e-5", "--plane", PLANE];
    bench.tollgate(&[&arguments[..], &["--material", "sinter=3300"], further].concat())
}

fn imported(count: u32) -> Bench {
    let bench = Bench::new();
    fs::write(bench.path("table.csv"), table(count)).unwrap();
    let answer = import(&bench, "outlet", &[]);
    assert_eq!(answer.code, 0, "{answer:?}");
    bench
}

#[test]
fn a_table_becomes_a_stream_that_is_whole_and_says_what_it_is() {
    let bench = imported(200);
    let answer = bench.tollgate(&["stream", "check", "outlet"]);
    assert_eq!(answer.code, 0, "{answer:?}");
    assert!(answer.out.contains("200 crossings"), "{answer:?}");
    let shown = bench.tollgate(&["stream", "show", "outlet"]);
    for words in ["imported from table.csv", "200, ", "not recorded", "advice: plane", "no paths are stored"] {
        assert!(shown.out.contains(words), "{words}: {shown:?}");
    }
    let json: Value = serde_json::from_str(&bench.tollgate(&["stream", "show", "outlet", "--json"]).out).unwrap();
    let mass = 200.0 * 4.0 / 3.0 * std::f64::consts::PI * 0.002_f64.powi(3) * 3300.0;
    let near = |value: &Value, expected: f64| (value.as_f64().unwrap() / expected - 1.0).abs() < 1e-9;
    assert!(near(&json["manifest"]["counts"]["mass"], mass));
    assert!(near(&json["duration_s"], 0.199) && near(&json["mass_flow_kg_per_s"], mass / 0.199));
    assert!(near(&json["normal_speed_m_per_s"]["p50"], 0.5 + 99e-3));
    assert_eq!(json["mass_flow_by_tenths_kg_per_s"].as_array().unwrap().len(), 10);
}

#[test]
fn an_exported_table_is_imported_as_the_same_stream() {
    let bench = imported(200);
    let answer = bench.tollgate(&["stream", "export", "outlet", "--csv", "back.csv", "--contacts", "contacts.csv"]);
    assert_eq!(answer.code, 0, "{answer:?}");
    assert_eq!(bench.text("contacts.csv").lines().count(), 1);
    fs::rename(bench.path("back.csv"), bench.path("table.csv")).unwrap();
    let answer = import(&bench, "again", &[]);
    assert_eq!(answer.code, 0, "{answer:?}");
    assert!(answer.err.contains("column \"force_x_N\" is not read"), "{answer:?}");
    assert_eq!(bench.bytes("again/chunk-000000.columns"), bench.bytes("outlet/chunk-000000.columns"));
}

#[test]
fn passages_are_points_for_paraview() {
    let bench = imported(20);
    assert_eq!(bench.tollgate(&["stream", "export", "outlet", "--vtp", "points"]).code, 0);
    assert!(bench.text("points/passages.pvd").contains("passages_000000.vtp"));
    let head = String::from_utf8_lossy(&bench.bytes("points/passages_000000.vtp")).into_owned();
    for words in ["NumberOfPoints=\"20\"", "\"contact_force\"", "\"time\"", "\"velocity\"", "\"radius\"", "\"id\""] {
        assert!(head.contains(words), "{words}");
    }
    assert_eq!(bench.tollgate(&["stream", "export", "outlet"]).code, 2);
}

#[test]
fn a_moved_stream_comes_back_by_the_inverse() {
    let bench = imported(50);
    let turn = |from: &str, out: &str, rotate: &str| {
        let answer = bench.tollgate(&["stream", "transform", from, "--rotate", rotate, "--out", out]);
        assert_eq!(answer.code, 0, "{answer:?}");
        assert_eq!(answer.err, "", "gravity lies in the axis");
    };
    turn("outlet", "there", "0,0,1,90,0.5,0,0");
    turn("there", "back", "0,0,1,-90,0.5,0,0");
    let plane = |stream: &str| {
        let manifest: Value = serde_json::from_str(&bench.text(&format!("{stream}/manifest.json"))).unwrap();
        manifest["origin"]["plane"]["point"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect::<Vec<_>>()
    };
    // A quarter turn about (0.5, 0) takes (0, 0) to (0.5, -0.5); one rounding of numbers below one each.
    let near = |a: Vec<f64>, b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-15);
    assert!(near(plane("there"), [0.5, -0.5, 0.2]) && near(plane("back"), [0.0, 0.0, 0.2]));
    assert_eq!(bench.tollgate(&["stream", "check", "back"]).code, 0);
    let tilted = bench.tollgate(&["stream", "transform", "outlet", "--rotate", "1,0,0,30,0,0,0", "--out", "tilted"]);
    assert_eq!(tilted.code, 0);
    assert!(tilted.err.contains("gravity was turned"), "{tilted:?}");
    let onto = bench.tollgate(&["stream", "transform", "outlet", "--move", "0,0,-1", "--out", "there"]);
    assert_eq!(onto.code, 8, "{onto:?}");
    assert_eq!(bench.tollgate(&["stream", "transform", "outlet", "--out", "nowhere"]).code, 2);
}

#[test]
fn every_bad_row_is_named_and_nothing_is_written() {
    let bench = Bench::new();
    fs::write(bench.path("table.csv"), format!("{HEADER}\n1,2\n0.1,0,0,0.2,0,0,one,0.002,0,1\n")).unwrap();
    let answer = import(&bench, "outlet", &[]);
    assert_eq!(answer.code, 2, "{answer:?}");
    for words in
        ["table.csv: line 2: it has 2 values", "line 3, column vz_m_per_s: \"one\"", "2 faults; nothing was written"]
    {
        assert!(answer.err.contains(words), "{words}: {answer:?}");
    }
    assert!(!bench.path("outlet").exists());
    assert_eq!(import(&bench, "outlet", &["--material", "sinter=1"]).code, 2);
}

#[test]
fn what_is_no_whole_stream_is_refused_with_the_reason_and_exit_code_5() {
    let bench = imported(200);
    let refused = |stream: &str, words: &str| {
        for verb in ["check", "show"] {
            let answer = bench.tollgate(&["stream", verb, stream]);
            assert_eq!(answer.code, 5, "{answer:?}");
            assert!(answer.err.contains(words), "{words}: {answer:?}");
        }
    };
    refused("nowhere", "there is no such folder");
    refused(".", "it is not a stream of tollgate");
    let chunk = bench.path("outlet/chunk-000000.columns");
    let whole = fs::read(&chunk).unwrap();
    let mut flipped = whole.clone();
    *flipped.last_mut().unwrap() ^= 0x10;
    fs::write(&chunk, flipped).unwrap();
    refused("outlet", "was edited or damaged");
    fs::write(&chunk, &whole[..whole.len() / 2]).unwrap();
    refused("outlet", "it is truncated");
    fs::remove_file(&chunk).unwrap();
    refused("outlet", "chunk-000000.columns is missing");
}
