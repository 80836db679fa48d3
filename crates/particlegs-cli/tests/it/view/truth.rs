//! Pictures of all particles: equal to those of `reference`, and cancelled when nobody waits for them.

use super::serving::{HttpAnswer, TestServer};
use crate::common::{TestFolder, spiral, waited, words};
use serde_json::{Value, json};
use std::io::Write;
use std::net::TcpStream;
use std::process::Child;
use std::time::Duration;

/// A request for the spiral, with `change` applied.
fn question(style: &str) -> Value {
    json!({
        "camera": {
            "position": [2.5, 1.25, 3.125], "focal_point": [0.1, 0.5, 0.0], "view_up": [0.0, 1.0, 0.0],
            "fov_deg": 30.0, "height_world": null, "clipping_range": null
        },
        "radius": 0.012, "opacity": 0.3, "look": style, "width": 160, "height_pixels": 90
    })
}

#[test]
fn pictures_of_all_particles_are_those_of_reference() {
    let dir = spiral();
    // In a box that repeats, for orthographic windows.
    let serving = TestServer::new(&dir, |c| c.args(words("spiral.pgs --snapshot spiral --box 3")));
    let reference = |words: &str| {
        dir.runs(&format!("reference spiral --box 3 {words} --quiet"));
    };
    let q = question("paraview");
    let mut view = q["camera"].clone();
    (view["name"], view["radius"], view["opacity"]) = (json!("view"), q["radius"].clone(), q["opacity"].clone());
    let views = json!({ "width": 160, "height": 90, "views": [view] });
    dir.write("views.json", views.to_string());
    for style in ["paraview", "paraview-no-fxaa", "expected"] {
        reference(&format!("--views views.json --style {style} -o {style}.png"));
        let answer = serving.truth(&question(style));
        assert_eq!(answer.status, 200, "{}", answer.text());
        let truth = particlegs_files::png::read_png(&dir.at(&format!("{style}.png"))).unwrap().data;
        assert!(truth.iter().any(|&v| v > 20) && answer.body == truth, "{style}");
    }
    reference("--views views.json --style density --smooth 32 --raw -o sigma");
    let sigma = dir.bytes("sigma/view.f32");
    assert!(sigma.iter().any(|&b| b > 0) && serving.truth(&question("density")).body == sigma);
    // An orthographic window, with the camera that `reference` reports.
    let window = "--projection orthographic --size 160x90 --azimuth 20 --width 7";
    reference(&format!("--style density --smooth 32 --raw {window} --json report.json -o slab"));
    let report = dir.json("report.json");
    let mut q = question("density");
    q["camera"] = report["views"][0].clone();
    let slab = dir.bytes("slab/view.f32");
    let answer = serving.truth(&q);
    assert_eq!(answer.status, 200, "{}", answer.text());
    assert!(slab.iter().any(|&b| b > 0) && answer.body == slab);
    // Periodic copies appear only where they should.
    q["periodic"] = json!(false);
    assert!(serving.truth(&q).body != slab);
}

/// A subset represents all particles.
#[test]
fn coarse_pictures_are_of_fewer_particles() {
    let dir = spiral();
    let serving = of_the_sample(&dir);
    let draw = |style: &str, share: f64| {
        let mut q = long();
        (q["look"], q["share"], q["radius"]) = (json!(style), json!(share), json!(0.1));
        (q["width"], q["height_pixels"], q["opacity"]) = (json!(96), json!(96), json!(0.2));
        let answer = serving.truth(&q);
        assert_eq!(answer.status, 200, "{}", answer.text());
        answer.body
    };
    for style in ["paraview", "paraview-no-fxaa", "expected"] {
        let (whole, half) = (draw(style, 1.0), draw(style, 0.5));
        let mean = |p: &[u8]| p.iter().map(|&v| f64::from(v)).sum::<f64>() / p.len() as f64;
        let difference = whole.iter().zip(&half).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / 96.0 / 96.0;
        assert!(whole != half && (mean(&whole) - mean(&half)).abs() < 0.05 * mean(&whole), "{style}");
        assert!(mean(&whole) > 20.0 && difference < 0.2 * mean(&whole), "{style}: {difference} of {}", mean(&whole));
        assert!(draw(style, 0.5) == half, "the same particles again");
    }
    let sum = |share| {
        let bytes = draw("density", share);
        bytes.chunks_exact(4).map(|v| f64::from(f32::from_le_bytes(v.try_into().unwrap()))).sum::<f64>()
    };
    assert!((sum(0.1) / sum(1.0) - 1.0).abs() < 0.02, "{} and {}", sum(0.1), sum(1.0));
}

#[test]
fn wrong_requests_are_reported_in_one_line() {
    let dir = spiral();
    let serving = TestServer::new(&dir, |c| c.args(["spiral.pgs", "--snapshot", "spiral"]));
    let set = |place: &[&str], value: Value| {
        let mut q = question("paraview");
        let at = place.iter().fold(&mut q, |q, key| &mut q[*key]);
        *at = value;
        q
    };
    for (wrong, says) in [
        (json!(null), "not a picture"),
        (json!({}), "missing field"),
        (set(&["look"], json!("pretty\n\u{1b}[2J")), "unknown variant"),
        (set(&["share"], json!(0)), "a share of 0 is outside"),
        (set(&["share"], json!(1.5)), "a share of 1.5 is outside"),
        (set(&["width"], json!(0)), "outside 1 to 4096"),
        (set(&["height_pixels"], json!(4097)), "outside 1 to 4096"),
        (set(&["width"], json!(1e300)), "invalid"),
        (set(&["radius"], json!(-1.0)), "radius -1 must be positive"),
        (set(&["radius"], json!(null)), "needs a radius"),
        (set(&["opacity"], json!(2)), "opacity 2 is outside"),
        (set(&["camera", "position"], json!([0.1, 0.5, 0.0])), "equals the focal point"),
        (set(&["camera", "view_up"], json!([0, 0, 0])), "view_up"),
        (set(&["camera", "fov_deg"], json!(180)), "field of view"),
        (set(&["camera", "fov_deg"], json!(null)), "set fov_deg (perspective) or height_world"),
        (set(&["camera", "height_world"], json!(1)), "set fov_deg or height_world, not both"),
        (set(&["camera", "clipping_range"], json!([2, 1])), "clipping range"),
    ] {
        let answer = serving.truth(&wrong);
        assert!(answer.status == 400 && answer.text().contains(says), "{wrong}: {} {}", answer.status, answer.text());
        assert!(answer.text().lines().count() == 1 && !answer.text().contains('\u{1b}'), "{}", answer.text());
    }
    let mut flat = question("expected");
    flat["camera"]["fov_deg"] = json!(null);
    flat["camera"]["height_world"] = json!(1.0);
    assert!(serving.truth(&flat).text().contains("need style density"));
    assert_eq!(serving.truth(&question("expected")).status, 200);
}

/// A picture that takes minutes: large splats of a quarter of a million particles in 16 million pixels.
fn long() -> Value {
    json!({
        "camera": {"position": [12.5, 12.5, 60.0], "focal_point": [12.5, 12.5, 12.5], "view_up": [0.0, 1.0, 0.0],
            "fov_deg": 30.0},
        "radius": 2.0, "opacity": 0.5, "look": "paraview", "width": 4096, "height_pixels": 4096
    })
}

/// The bundled sample, drawn as itself and by a model of another.
fn of_the_sample(dir: &TestFolder) -> TestServer {
    TestServer::new(dir, |c| c.args(words("spiral.pgs --snapshot SAMPLE")))
}

#[test]
fn a_newer_picture_cancels_the_older_one() {
    let dir = spiral();
    let serving = of_the_sample(&dir);
    let older: Vec<TcpStream> = (0..3)
        .map(|_| {
            let mut stream = serving.connect();
            stream.write_all(&serving.question(&long())).unwrap();
            stream
        })
        .collect();
    std::thread::sleep(Duration::from_millis(300));
    let mut small = long();
    (small["width"], small["height_pixels"], small["radius"]) = (json!(64), json!(64), json!(0.01));
    let answer = serving.truth(&small);
    assert_eq!((answer.status, answer.body.len()), (200, 64 * 64));
    for stream in older {
        let answer = HttpAnswer::read(stream);
        assert!(answer.status == 409 && answer.text().contains("another picture"), "{}", answer.text());
    }
}

/// CPU time of a process in kernel ticks.
#[cfg(target_os = "linux")]
fn ticks(child: &Child) -> u64 {
    let stat = std::fs::read_to_string(format!("/proc/{}/stat", child.id())).unwrap();
    let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_whitespace().collect();
    fields[11].parse::<u64>().unwrap() + fields[12].parse::<u64>().unwrap()
}

#[test]
#[cfg(target_os = "linux")]
fn a_closed_connection_cancels_its_picture() {
    let dir = spiral();
    let serving = of_the_sample(&dir);
    let before = ticks(&serving.child);
    let mut stream = serving.connect();
    stream.write_all(&serving.question(&long())).unwrap();
    waited("the drawing", || ticks(&serving.child) > before + 20);
    drop(stream);
    waited("the drawing to end", || {
        let earlier = ticks(&serving.child);
        std::thread::sleep(Duration::from_millis(300));
        ticks(&serving.child) <= earlier + 1
    });
}

#[test]
fn ctrl_c_ends_it_while_a_picture_is_drawn() {
    let dir = spiral();
    let serving = of_the_sample(&dir);
    let mut stream = serving.connect();
    stream.write_all(&serving.question(&long())).unwrap();
    std::thread::sleep(Duration::from_millis(300));
    let (code, out, said) = serving.end("-INT");
    assert_eq!(code, Some(0), "{said}");
    assert!(
        out.trim() == "Press Ctrl-C to stop." && said.lines().all(|line| line.starts_with("note: ")),
        "{out}{said}"
    );
}
