//! Jobs in a folder, run by a user or a workflow engine.

use crate::common::{TestFolder, listing, process, sample, snapshot};
use std::path::Path;

/// The file that `compress` gives.
fn compressed(dir: &TestFolder, input: &str, options: &str) -> Vec<u8> {
    dir.makes(&format!("compress {input} -o direct.pgs {options} --quiet --force"))
}

/// The file of a job with its tasks in an unusual order.
fn by_job(dir: &TestFolder, input: &str, job: &str, options: &str) -> (Vec<u8>, u64) {
    let planned = dir.says(&format!("plan {input} -o {job} {options}"));
    let (blocks, chunks) = (planned["blocks"].as_u64().unwrap(), planned["chunks"].as_u64().unwrap());
    for chunk in (0..chunks).rev() {
        dir.says(&format!("scatter {job} {chunk}"));
    }
    for block in (0..blocks).map(|b| (b * 3 + 1) % blocks).chain(0..blocks) {
        dir.says(&format!("block {job} {block} --threads {}", 1 + block % 2));
    }
    (dir.makes(&format!("merge {job} -o of-job.pgs --quiet --force")), chunks)
}

/// A snapshot of `n` particles that lie in order along x, so that runs are together.
fn in_order(folder: &Path, n: usize) {
    let mut state = 7u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    let x: Vec<f32> = (0..n).map(|i| 40.0 * i as f32 / n as f32).collect();
    let [y, z] = [0, 1].map(|_| (0..n).map(|_| next()).collect::<Vec<f32>>());
    snapshot(folder, &[x, y, z]);
}

#[test]
fn a_job_gives_the_bytes_that_compress_gives() {
    let dir = TestFolder::new();
    let options = "--blocks 5 --effort fast";
    let direct = compressed(&dir, "SAMPLE", options);
    let (merged, chunks) = by_job(&dir, "SAMPLE", "job", options);
    assert!(chunks > 1);
    assert_eq!(merged, direct);
    assert_eq!(compressed(&dir, "SAMPLE", &format!("{options} --memory 500MB")), direct);
    let status = dir.says("status job");
    assert_eq!(status["particles"], serde_json::json!([262_144, 262_144]));
    dir.runs("verify job");
    // A block is a complete model, and the folder contains only the job's files.
    dir.runs("info --quiet job/blocks/00003.pgs");
    assert_eq!(listing(&dir.at("job")), ["blocks", "plan.json", "runs.bin", "scatter"]);
    // The same plan again changes nothing; finished parts stay.
    assert_eq!(dir.says("plan SAMPLE -o job --blocks 5 --effort fast")["planned_before"], true);
    assert_eq!(dir.says("block job 4")["before"], true);
}

#[test]
fn adjacent_blocks_are_not_copied() {
    let dir = TestFolder::new();
    in_order(&dir.at("snapshot"), 400_000);
    let options = "--blocks 3 --effort fast --certificate=none";
    let (merged, chunks) = by_job(&dir, "snapshot", "job", options);
    assert_eq!(chunks, 0);
    assert_eq!(merged, compressed(&dir, "snapshot", options));
    dir.runs("scatter job");
}

#[test]
fn layers_weights_and_selections_go_through_a_job() {
    let dir = TestFolder::new();
    in_order(&dir.at("snapshot"), 150_000);
    let weights: Vec<u8> = (0..150_000).flat_map(|i| (1.0 + (i % 4) as f32).to_le_bytes()).collect();
    dir.write("snapshot/ww.f32", weights);
    for (name, more) in [
        ("weights", ""),
        ("masses", "--layers mass"),
        ("region", "--region 3,30,0,1,0,0.7 --every 2"),
        ("plain", "--mass-field none"),
    ] {
        let options = format!("--blocks 4 --effort fast --certificate=none --ratio 60 {more}");
        let direct = compressed(&dir, "snapshot", &options);
        assert_eq!(by_job(&dir, "snapshot", name, &options).0, direct, "{name}");
        assert_eq!(compressed(&dir, "snapshot", &format!("{options} --memory 400MB")), direct, "{name}");
    }
}

#[test]
fn missing_broken_and_changed_parts_are_named() {
    let dir = TestFolder::new();
    in_order(&dir.at("snapshot"), 140_000);
    // Shuffled along x, so that blocks need buckets.
    let x: Vec<u8> = (0..140_000u64).flat_map(|i| ((i * 7919 % 140_000) as f32).to_le_bytes()).collect();
    dir.write("snapshot/xx.f32", &x);
    dir.says("plan snapshot -o job --blocks 3 --effort fast");
    let merge = "merge job -o m.pgs";
    dir.fails("block job 0", 3, "00000.bin: this chunk has not been sorted yet");
    dir.fails("scatter job 3", 2, "there is no chunk 3");
    dir.runs("scatter job --quiet");
    dir.fails("block job 3", 2, "there is no block 3");
    dir.fails("block job x", 2, "not a number");
    dir.fails("block job env:PARTICLEGS_NO_SUCH_VARIABLE", 2, "is not set");
    dir.command("block job env:TASK --quiet").env("TASK", "1").assert().success();
    dir.fails(merge, 3, "blocks not fitted yet: 0, 2 (2 of 3)");
    assert!(!dir.at("m.pgs").exists());
    dir.runs("block job 0 --quiet");
    dir.runs("block job 2 --quiet");
    // Another plan in the same folder, and a folder that is not a job's.
    dir.fails("plan snapshot -o job --blocks 4", 8, "already contains another plan");
    dir.fails("plan snapshot -o . --blocks 4", 8, "the folder contains `");
    // Half-written files.
    let block = "job/blocks/00002.pgs";
    let whole = dir.bytes(block);
    dir.write(block, &whole[..whole.len() / 2]);
    dir.fails(merge, 3, "blocks/00002.pgs: the file ends after");
    dir.fails("verify job", 3, "blocks/00002.pgs: the file ends after");
    dir.runs("block job 2 --quiet");
    assert_eq!(dir.bytes(block), whole);
    let chunk = "job/scatter/00001.bin";
    let mut bytes = dir.bytes(chunk);
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    dir.write(chunk, &bytes);
    dir.fails("verify job", 3, "00001.bin: the particles in the file were changed");
    dir.write(chunk, &bytes[..100]);
    dir.fails("scatter job 1", 3, "00001.bin: the file is incomplete");
    std::fs::remove_file(dir.at(chunk)).unwrap();
    // The snapshot changed after the plan.
    let mut changed = x;
    changed[4 * 70_000] ^= 1;
    dir.write("snapshot/xx.f32", changed);
    dir.fails("scatter job 1", 3, "changed after `plan`: particles 65536 to 131071");
    dir.fails(merge, 3, "changed after `plan`");
    dir.fails("verify job", 3, "changed after `plan`");
    dir.runs(&format!("{merge} --certificate=none --quiet"));
}

#[test]
fn impossible_plans_are_refused() {
    let dir = TestFolder::new();
    snapshot(&dir.at("few"), &[vec![0.0, 1.0, 2.0], vec![0.0; 3], vec![0.0; 3]]);
    for (words, code, text) in [
        ("few --blocks 4", 2, "use 1 to 3 blocks"),
        ("few --blocks 0", 2, "use 1 to 3 blocks"),
        ("few --blocks many", 2, "neither a number nor `auto`"),
        ("few --psnr 30", 2, "all blocks together"),
        ("few --min-correlation 0.9 --cell 1", 2, "all blocks together"),
        ("SAMPLE --memory 50MB", 7, "needs about"),
        ("SAMPLE --memory lots", 2, "size `lots`"),
    ] {
        dir.fails(&format!("plan -o job {words}"), code, text);
    }
    assert!(!dir.at("job").exists());
    dir.write("file", "");
    dir.fails("plan SAMPLE -o file/job --blocks 2", 6, "file/job");
    dir.fails("status few", 3, "no plan.json");
    dir.fails("compress SAMPLE -o m.pgs --memory 1GB --blocks 2 --scratch nowhere", 6, "nowhere");
    std::fs::create_dir(dir.at("job")).unwrap();
    for (plan, code, text) in [
        ("{\"particlegs_job\": 99}", 4, "newer version made this plan"),
        ("{\"particlegs_job\": 1}", 4, "older version made this plan"),
        ("{}", 3, "not a plan"),
    ] {
        dir.write("job/plan.json", plan);
        dir.fails("status job", code, text);
    }
}

/// The sample in eight layers: a block has eight fits, and a checkpoint after each.
#[cfg(target_os = "linux")]
fn in_layers(folder: &Path) {
    std::fs::create_dir(folder).unwrap();
    for name in ["xx.f32", "yy.f32", "zz.f32"] {
        std::fs::copy(sample().join(name), folder.join(name)).unwrap();
    }
    let layers = (0..8).map(|i| serde_json::json!({ "name": format!("layer {i}"), "particles": 32_768 }));
    let meta = serde_json::json!({ "box": 25.0, "periodic": true, "layers": layers.collect::<Vec<_>>() });
    std::fs::write(folder.join("meta.json"), meta.to_string()).unwrap();
}

/// At an engine's signal finished work is kept, and the exit code requests another run.
#[cfg(target_os = "linux")]
#[test]
fn a_stopped_block_continues_to_the_same_bytes() {
    let dir = TestFolder::new();
    let options = "--blocks 1 --ratio 150 --certificate=none";
    in_layers(&dir.at("data"));
    let direct = compressed(&dir, "data", options);
    dir.runs(&format!("plan data -o job {options} --quiet"));
    dir.runs("scatter job --quiet");
    let checkpoint = dir.at("job/blocks/00000.checkpoint");
    let (mut stops, mut wait) = (0, 50);
    // Signal later and later until some work was finished; use both signals at least once.
    while stops < 2 || !checkpoint.exists() {
        let mut child = process(dir.path()).args(["block", "job", "0", "--quiet"]).spawn().unwrap();
        let (number, name) = if stops % 2 == 0 { (10, "-USR1") } else { (15, "-TERM") };
        crate::common::wait_for_handler(&child, number);
        std::thread::sleep(std::time::Duration::from_millis(wait));
        crate::common::signal(&child, name);
        assert_eq!(child.wait().unwrap().code(), Some(75), "{name} after {wait} ms");
        assert!(!dir.at("job/blocks/00000.pgs").exists());
        (stops, wait) = (stops + 1, 2 * wait);
    }
    let [text, _] = dir.runs("block job 0");
    assert!(text.contains("from a checkpoint with"), "{text}");
    assert_eq!(dir.makes("merge job -o m.pgs --quiet"), direct);
    assert!(!checkpoint.exists());
}
