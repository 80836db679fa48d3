//! `bench` on few particles: its files, its cache, and its errors.

use crate::common::{TestFolder, fails, listing, particlegs, snapshot, success};

/// A folder with a few `clumps`.
fn folder() -> TestFolder {
    let dir = TestFolder::new();
    let place = |i: u64, k: u64| {
        let clump = i % 7;
        let near = (i * (97 + 31 * k) % 1009) as f32 / 1009.0;
        (clump * (k + 2) % 5) as f32 * 4.0 + near * near
    };
    let columns: Vec<Vec<f32>> = (0..3).map(|k| (0..4000).map(|i| place(i, k)).collect()).collect();
    snapshot(&dir.at("clumps"), &columns);
    dir
}

const BENCH: &str = "bench rate-distortion clumps --quick --quiet --size 160x90 --seeds 1 -o";

#[test]
fn results_are_written_and_continued() {
    let dir = folder();
    let words = format!("{BENCH} out --ratios 20,50");
    dir.runs(&words);
    let read = |name: &str| dir.text(&format!("out/{name}"));
    for name in ["report.html", "results.json", "rate-distortion.md", "figures/rate-distortion-masked.svg"] {
        assert!(read(name).len() > 500, "{name}");
    }
    let results = dir.json("out/results.json");
    assert_eq!(results["made_by"]["snapshots"][0][1], 4000);
    let tables = results["experiments"]["rate-distortion"]["tables"].as_array().unwrap();
    let named = |name: &str| tables.iter().find(|t| t["name"] == name).unwrap()["rows"].as_array().unwrap();
    // Every method at every ratio, with every bound kept.
    let pictures = named("rate-distortion-pictures");
    assert_eq!(pictures.len(), 2 * 6);
    let masked = |name: &str| {
        let row = pictures.iter().find(|r| r[0] == name && r[1]["value"] == 50.0).unwrap();
        row[4]["value"].as_f64().unwrap()
    };
    assert!(masked("particlegs") > masked("LCP"), "{pictures:?}");
    assert!(named("rate-distortion-bounds").iter().all(|r| r[4] == "yes"), "{tables:?}");
    // The page is self-contained.
    let page = read("report.html");
    assert!(page.contains("<svg") && !page.contains("src=\"http") && !page.contains("href=\"http"));
    let csv = read("figures/rate-distortion-pictures.csv");
    assert_eq!(csv.lines().count(), 13, "{csv}");

    // Cached results are used again: the same pages, and nothing new in the cache.
    let cache_files = listing(&dir.at("out/kept"));
    dir.runs(&words);
    assert_eq!((page, cache_files), (read("report.html"), listing(&dir.at("out/kept"))));
}

#[test]
fn existing_types_are_listed() {
    let [text, _] = success(particlegs().args(["bench", "list"]));
    let labels = "tab:ablation_core tab:ablation_ft tab:block, tab:generalization tab:gen_view tab:rd tab:perf \
                  tab:recovery_methods tab:recovery_blocks fig:artifact fig:block_distance fig:scale fig:rd \
                  fig:qualitative fig:recovery:slices fig:recovery:stats fig:three_way";
    for label in labels.split(' ') {
        assert!(text.contains(label), "{label} is made by no experiment:\n{text}");
    }
}

#[test]
fn impossible_measurements_are_refused() {
    let dir = folder();
    let unknown = "no experiment \"nothing\": use `all` or one of rate-distortion";
    dir.fails("bench nothing x -o y", 2, unknown);
    dir.fails("bench all", 2, "`bench` needs a snapshot and a folder for the results");
    dir.fails(&format!("{BENCH} a --ratios 0.5"), 2, "--ratios: 0.5 is not above 1");
    // Folders with other files, such as the snapshot's own, are refused.
    std::fs::create_dir(dir.at("other")).unwrap();
    dir.write("other/mine.txt", "mine");
    for place in ["other", "clumps"] {
        dir.fails(&format!("{BENCH} {place}"), 8, "contains other files and no results of `bench`");
    }
    assert_eq!(listing(&dir.at("other")), ["mine.txt"]);
    dir.fails(&format!("{BENCH} b --python {}", dir.at("python").display()), 3, "python");
}

/// Works with and without a GPU.
#[test]
fn options_without_effect_on_a_gpu_are_refused() {
    let gpu = |more: &[&str], why: &str| fails(particlegs().args(["bench", "gpu"]).args(more), 2, why);
    gpu(&["snapshot"], "`bench gpu` makes its own scenes: omit SNAPSHOT");
    gpu(&["--size", "160x90"], "omit --size");
    gpu(&["--scale", "0.1"], "`bench gpu` uses --scale only with --training");
    gpu(&["-o", "measured"], "`bench gpu` uses -o only with --training");
    gpu(&["--training"], "needs a folder for its checkpoint: -o DIR");
}

#[test]
fn experiments_are_listed_as_data() {
    let dir = TestFolder::new();
    dir.runs("bench list --json list.json");
    let experiments = dir.json("list.json");
    assert!(experiments.as_array().is_some_and(|all| all.len() > 5 && all[0]["name"].is_string()), "{experiments}");
}
