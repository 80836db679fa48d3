//! `series`, `extract`, and frames of a series where a model is taken.

use crate::common::TestFolder;
use particlegs_core::codec;
use particlegs_core::codec::{CodedFrame, SeriesClock};
use std::collections::HashMap;
use std::path::Path;

/// Snapshots of groups that drift in a periodic box.
fn snapshots(folder: &Path, frames: usize) {
    for frame in 0..frames {
        let frame_folder = folder.join(format!("snap-{frame}"));
        std::fs::create_dir_all(&frame_folder).unwrap();
        for (k, axis) in ["xx", "yy", "zz"].into_iter().enumerate() {
            let place = |i: usize| {
                let (group, noise) = (i % 25, ((i * (7 + k)) % 101) as f64 / 101.0 - 0.5);
                let centre = (group * (3 + k)) as f64 * 0.37;
                ((centre + noise + 0.05 * (frame * (k + 1)) as f64).rem_euclid(10.0)) as f32
            };
            let bytes: Vec<u8> = (0..4000).flat_map(|i| place(i).to_le_bytes()).collect();
            std::fs::write(frame_folder.join(format!("{axis}.f32")), bytes).unwrap();
        }
        let redshift = 1.0 / (0.5 + 0.05 * frame as f64) - 1.0;
        let about = format!(r#"{{"box": 10, "periodic": true, "length_unit": "Mpc/h", "redshift": {redshift}}}"#);
        std::fs::write(frame_folder.join("meta.json"), about).unwrap();
    }
}

const OPTIONS: &str = "--gaussians 60 --certificate none --keyframe-interval 3 --quiet";

#[test]
fn a_series_is_the_same_file_whole_appended_and_with_any_threads() {
    let dir = TestFolder::new();
    snapshots(&dir.at(""), 5);
    let all = "snap-0 snap-1 snap-2 snap-3 snap-4";
    let whole = dir.makes(&format!("series {all} -o whole.pgs {OPTIONS}"));
    dir.runs(&format!("series snap-0 snap-1 -o grown.pgs {OPTIONS}"));
    dir.runs(&format!("series {all} -o grown.pgs {OPTIONS}"));
    assert_eq!(whole, std::fs::read(dir.at("grown.pgs")).unwrap());
    assert_eq!(whole, dir.makes(&format!("series {all} -o one.pgs {OPTIONS} --threads 1")));
    assert!(!dir.at("whole.pgs.work").exists());
}

#[test]
fn frames_are_models_wherever_a_model_is_taken() {
    let dir = TestFolder::new();
    snapshots(&dir.at(""), 5);
    dir.runs(&format!("series snap-0 snap-1 snap-2 snap-3 snap-4 -o run.pgs {OPTIONS}"));
    let listed = dir.says("info run.pgs");
    let kinds: Vec<&str> = listed["frames"].as_array().unwrap().iter().filter_map(|f| f["kind"].as_str()).collect();
    assert_eq!(kinds, ["keyframe", "changes", "changes", "keyframe", "changes"]);
    let info = dir.says("info run.pgs --frame 1");
    assert_eq!(
        (info["metadata"]["source"].as_str(), info["metadata"]["particles"].as_u64()),
        (Some("snap-1"), Some(4000))
    );
    dir.runs("extract run.pgs --time a=0.55 -o m.pgs --quiet");
    let model = dir.model("m.pgs");
    assert_eq!((model.metadata.source.as_str(), model.metadata.count), ("snap-1", 4000));
    dir.runs("render run.pgs --frame -1 -o f.png --size 64x48 --quiet");
    dir.runs("eval run.pgs snap-1 --frame 1 --size 64x48 --frames 1 --quiet");
    dir.runs("verify run.pgs --frame 2 --quiet");
    dir.runs("stats snap-1 run.pgs --frame 1 --only density --grid 8 -o stats --no-plots --quiet");
    dir.fails("render run.pgs --frame 9 -o g.png", 3, "there is no frame 9");
    dir.fails("verify run.pgs snap-4 --store", 2, "--store");
}

#[test]
fn a_film_shows_each_frame_or_even_moments_of_a_series() {
    let dir = TestFolder::new();
    snapshots(&dir.at(""), 3);
    dir.runs(&format!("series snap-0 snap-1 snap-2 -o run.pgs {OPTIONS}"));
    let small = "--size 96x64 --quiet --save-views views.json";
    dir.runs(&format!("render run.pgs --frames all -o plain --no-annotations {small}"));
    dir.runs(&format!("render run.pgs --frames all -o film --video film.gif {small}"));
    dir.runs(&format!("render run.pgs --frames 5 --turntable 5 -o even --no-annotations {small}"));
    let files = |folder: &str| crate::common::files(&dir.at(folder)).len();
    assert_eq!([files("film"), files("even")], [3, 5]);
    assert!(dir.bytes("film.gif").starts_with(b"GIF89a"));
    let moment = "render run.pgs --time a=0.525 --views views.json --quiet";
    dir.runs(&format!("{moment} -o moment --no-annotations"));
    dir.runs(&format!("{moment} -o stamped"));
    let picture = |name: &str| particlegs_files::png::read_png(&dir.at(name)).unwrap();
    assert!(picture("even/frame_0001.png") == picture("moment/frame_0001.png"));
    assert!(picture("stamped/frame_0001.png") != picture("moment/frame_0001.png"));
    let moment = |name: &str, text: &str| String::from_utf8_lossy(&dir.bytes(name)).contains(&format!("\"{text}\""));
    assert!(moment("stamped/frame_0001.png", "z = 0.905 (interpolated)"));
    assert!(moment("even/frame_0001.png", "z = 0.905 (interpolated)"));
    assert!(moment("film/frame_0001.png", "z = 0.818") && !moment("film/frame_0001.png", "z = 0.667"));
    assert!(picture("film/frame_0001.png") != picture("plain/frame_0001.png"));
    assert!(picture("plain/frame_0001.png") != picture("plain/frame_0002.png"));
    dir.fails("render run.pgs --frames all --frame 1 -o no", 2, "omit --frame");
    dir.fails("render run.pgs --frames 0 -o no", 2, "a number from 1 to");
    dir.runs("extract run.pgs --frame 1 -o m.pgs --quiet");
    dir.fails("render m.pgs --frames all -o no", 2, "--frames");
}

#[test]
fn a_series_is_made_of_a_folder_or_of_a_pattern() {
    let dir = TestFolder::new();
    snapshots(&dir.at("run"), 11);
    let few = OPTIONS.replace("60", "20");
    let of_folder = dir.makes(&format!("series run -o folder.pgs {few}"));
    let frames = dir.says("info folder.pgs")["frames"].as_array().unwrap().len();
    assert_eq!(frames, 11);
    assert_eq!(of_folder, dir.makes(&format!("series run/snap-* -o pattern.pgs {few}")));
    dir.fails(&format!("series run/none-* -o none.pgs {few}"), 2, "no file matches run/none-*");
}

#[test]
fn a_gap_is_filled_with_the_bytes_of_the_whole_series() {
    let dir = TestFolder::new();
    snapshots(&dir.at(""), 5);
    let all = "snap-0 snap-1 snap-2 snap-3 snap-4";
    let whole = dir.makes(&format!("series {all} -o whole.pgs {OPTIONS}"));
    let broken = "snap-2/yy.f32";
    std::fs::rename(dir.at(broken), dir.at("away")).unwrap();
    // Said with --quiet too.
    let [_, warnings] = dir.runs(&format!("series {all} -o gap.pgs {OPTIONS}"));
    assert!(warnings.contains("frame 2 is missing"), "{warnings}");
    assert!(dir.says("info gap.pgs")["frames"][2]["kind"] == "missing");
    dir.runs("render gap.pgs --frames all -o film --size 32x24 --quiet");
    assert_eq!(crate::common::files(&dir.at("film")).len(), 4);
    std::fs::rename(dir.at("away"), dir.at(broken)).unwrap();
    dir.runs(&format!("series {all} -o gap.pgs {OPTIONS}"));
    assert!(dir.bytes("gap.pgs") == whole);
    // A snapshot that is gone leaves its frame.
    std::fs::rename(dir.at("snap-1"), dir.at("away")).unwrap();
    dir.runs(&format!("series {all} -o gap.pgs {OPTIONS}"));
    assert!(dir.bytes("gap.pgs") == whole);
}

#[test]
fn frames_come_in_the_order_of_time_and_other_snapshots_are_refused() {
    let dir = TestFolder::new();
    snapshots(&dir.at(""), 3);
    let sorted = dir.makes(&format!("series snap-0 snap-1 -o run.pgs {OPTIONS}"));
    assert!(dir.makes(&format!("series snap-1 snap-0 -o turned.pgs {OPTIONS}")) == sorted);
    dir.fails(&format!("series snap-0 snap-0 -o twice.pgs {OPTIONS}"), 3, "not after");
    assert!(!dir.at("twice.pgs").exists());
    dir.fails(&format!("series snap-0 snap-2 -o run.pgs {OPTIONS}"), 2, "another snapshot");
    // The same particles at another time.
    let about = dir.text("snap-1/meta.json");
    std::fs::write(dir.at("snap-1/meta.json"), about.replace("0.8181818181818181", "0.8")).unwrap();
    assert!(dir.text("snap-1/meta.json") != about);
    dir.fails(&format!("series snap-0 snap-1 -o run.pgs {OPTIONS}"), 2, "its scale factor was");
}

#[test]
fn a_series_without_any_readable_snapshot_is_not_made() {
    let dir = TestFolder::new();
    dir.fails(&format!("series none-0 none-1 -o run.pgs {OPTIONS}"), 6, "none-0: there is no such file");
    snapshots(&dir.at(""), 1);
    dir.fails(&format!("series snap-0 snp-1 -o run.pgs {OPTIONS}"), 6, "snp-1: there is no such file");
    assert!(!dir.at("run.pgs").exists() && !dir.at("run.pgs.work").exists());
}

/// Snapshots of text without times, each a little further along x.
fn tables(dir: &TestFolder, names: &[&str]) {
    for (number, name) in names.iter().enumerate() {
        let atom = |i: usize| {
            let places = [3, 5, 7].map(|step| ((i * step) % 41) as f64 / 41.0 * 8.0);
            format!("A {} {} {}\n", places[0] + 0.1 * number as f64, places[1], places[2])
        };
        let atoms: String = (0..200).map(atom).collect();
        std::fs::write(dir.at(name), format!("200\nnumber {number}\n{atoms}")).unwrap();
    }
}

#[test]
fn numbers_in_names_order_snapshots_without_times() {
    let dir = TestFolder::new();
    tables(&dir, &["s_1.xyz", "s_2.xyz", "s_10.xyz"]);
    let sorted = dir.makes(&format!("series s_1.xyz s_2.xyz s_10.xyz -o sorted.pgs {OPTIONS}"));
    assert!(dir.makes(&format!("series s_1.xyz s_10.xyz s_2.xyz -o shell.pgs {OPTIONS}")) == sorted);
    assert!(dir.makes(&format!("series s_*.xyz -o pattern.pgs {OPTIONS}")) == sorted);
    // An order that no shell makes was chosen.
    assert!(dir.makes(&format!("series s_10.xyz s_2.xyz s_1.xyz -o back.pgs {OPTIONS}")) != sorted);
}

#[test]
fn a_run_has_one_box_and_one_particle_mass() {
    let dir = TestFolder::new();
    snapshots(&dir.at(""), 2);
    let about = dir.text("snap-1/meta.json");
    let with = |from: &str, to: &str| {
        std::fs::write(dir.at("snap-1/meta.json"), about.replace(from, to)).unwrap();
        assert!(dir.text("snap-1/meta.json") != about);
    };
    let series = format!("series snap-0 snap-1 -o run.pgs {OPTIONS} --force");
    with("\"box\": 10", "\"box\": 12");
    dir.fails(&series, 3, "its box is 12 x 12 x 12, periodic in xyz, that of the frame before 10 x 10 x 10");
    with("}", ", \"particle_mass\": 2}");
    dir.fails(&series, 3, "its particle mass of `particles` is 2, that of the frame before not stated");
    // In a run without a scale factor the cell may change, as under constant pressure.
    for number in 0..2 {
        let about = format!(r#"{{"box": {}, "periodic": true, "time": {number}}}"#, 10 + number);
        std::fs::write(dir.at(&format!("snap-{number}/meta.json")), about).unwrap();
    }
    dir.runs(&series);
}

#[test]
fn a_field_that_is_written_anew_is_another_snapshot() {
    let dir = TestFolder::new();
    snapshots(&dir.at(""), 3);
    let write = |frame: usize, value: &dyn Fn(usize) -> f32| {
        let bytes: Vec<u8> = (0..4000).flat_map(|i| value(i).to_le_bytes()).collect();
        std::fs::write(dir.at(&format!("snap-{frame}/heat.f32")), bytes).unwrap();
    };
    (0..3).for_each(|frame| write(frame, &|i| 100.0 + (i % 7) as f32));
    let series = |count| {
        format!("series {} -o run.pgs --fields heat {OPTIONS}", ["snap-0 snap-1", "snap-0 snap-1 snap-2"][count])
    };
    dir.runs(&series(0));
    dir.runs(&series(0));
    // The same values at other particles: sums and extremes are as before.
    write(1, &|i| 100.0 + ((i + 1) % 7) as f32);
    dir.fails(&series(1), 2, "the values of its fields differ");
    write(1, &|i| 100.0 + (i % 7) as f32);
    dir.runs(&series(1));
}

#[test]
fn the_work_folder_holds_the_frames_of_one_run_and_nothing_of_others() {
    let dir = TestFolder::new();
    snapshots(&dir.at(""), 2);
    let series = format!("series snap-0 snap-1 -o run.pgs {OPTIONS}");
    let whole = dir.makes(&format!("series snap-0 snap-1 -o whole.pgs {OPTIONS}"));
    std::fs::write(dir.at("run.pgs.work"), "a file").unwrap();
    dir.fails(&series, 8, "run.pgs.work: is in the way");
    std::fs::remove_file(dir.at("run.pgs.work")).unwrap();
    std::fs::create_dir_all(dir.at("run.pgs.work/mine")).unwrap();
    dir.fails(&series, 8, "run.pgs.work: contains `mine`, which this command does not write");
    assert!(dir.at("run.pgs.work/mine").exists() && !dir.at("run.pgs").exists());
    std::fs::remove_dir(dir.at("run.pgs.work/mine")).unwrap();
    // Another run holds the lock.
    let lock = std::fs::File::create(dir.at("run.pgs.work/lock")).unwrap();
    lock.lock().unwrap();
    dir.fails(&series, 8, "another run of this command is making the same output");
    drop(lock);
    // A frame that is damaged is made again.
    std::fs::write(dir.at("run.pgs.work/frame-000000"), "damaged").unwrap();
    dir.runs(&series);
    assert!(dir.bytes("run.pgs") == whole && !dir.at("run.pgs.work/lock").exists());
}

#[test]
fn a_series_takes_the_place_of_a_series_alone() {
    let dir = TestFolder::new();
    snapshots(&dir.at(""), 2);
    let model = dir.makes("compress snap-0 -o m.pgs --gaussians 40 --certificate none -q");
    for force in ["", "--force"] {
        dir.fails(&format!("series snap-0 -o m.pgs {OPTIONS} {force}"), 8, "m.pgs: exists and is not a series");
    }
    assert!(dir.bytes("m.pgs") == model);
    std::fs::create_dir(dir.at("plots")).unwrap();
    dir.fails(&format!("series snap-0 -o plots {OPTIONS}"), 8, "plots: is a folder");
    dir.runs(&format!("series snap-0 snap-1 -o run.pgs {OPTIONS}"));
    dir.fails("stats run.pgs -o run.pgs", 2, "run.pgs: this command does not write .pgs files");
}

#[test]
fn frames_have_the_fields_of_their_particles() {
    let dir = TestFolder::new();
    snapshots(&dir.at(""), 3);
    let temperature = |frame: usize, i: usize| (10.0 + (i % 25) as f32) * (1.0 + frame as f32);
    for frame in 0..3 {
        let bytes: Vec<u8> = (0..4000).flat_map(|i| temperature(frame, i).to_le_bytes()).collect();
        std::fs::write(dir.at(&format!("snap-{frame}/temperature.f32")), bytes).unwrap();
    }
    let all = "snap-0 snap-1 snap-2 -o run.pgs --fields temperature";
    let whole = dir.makes(&format!("series {all} {OPTIONS}"));
    assert!(whole == dir.makes(&format!("series {all} {OPTIONS} --threads 1 --force")));
    for frame in 0..3 {
        dir.runs(&format!("extract run.pgs --frame {frame} -o m.pgs --quiet --force"));
        let model = dir.model("m.pgs");
        let g = &model.layers[0].content[0].gaussians;
        let field = g.fields.get("temperature").unwrap();
        let sum: f64 = (0..g.len()).map(|i| g.count[i] * field.mean[0][i]).sum();
        let truth: f64 = (0..4000).map(|i| f64::from(temperature(frame, i))).sum();
        assert!((sum / truth - 1.0).abs() < 1e-6, "frame {frame}: {sum} instead of {truth}");
        let spread = (0..g.len()).map(|i| g.count[i] * (field.mean[0][i] - truth / 4000.0).powi(2)).sum::<f64>();
        assert!(spread > 0.3 * 4000.0 * 52.0 * (1.0 + frame as f64).powi(2), "{spread}");
    }
    // Between two frames, on a line.
    dir.runs("extract run.pgs --time a=0.525 -o between.pgs --quiet");
    let model = dir.model("between.pgs");
    let g = &model.layers[0].content[0].gaussians;
    let mean: f64 = (0..g.len()).map(|i| g.count[i] * g.fields.get("temperature").unwrap().mean[0][i]).sum::<f64>();
    assert!((mean / 4000.0 - 33.0).abs() < 1.0, "{}", mean / 4000.0);
    dir.runs("render run.pgs --frame 1 --field temperature -o f.png --size 64x48 --quiet");
    dir.runs("stats run.pgs -o s --no-plots --quiet");
    assert!(dir.text("s/frames.csv").contains("temperature"));
}

/// Rows of a table whose remarks stand behind `#`, by the names of the columns.
fn rows(text: &str) -> Vec<HashMap<String, String>> {
    let mut lines = text.lines().filter(|l| !l.starts_with('#'));
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        assert_eq!(cells.len(), names.len(), "{line}");
        names.iter().zip(cells).map(|(name, cell)| (name.to_string(), cell.to_string())).collect()
    };
    lines.map(row).collect()
}

fn value(row: &HashMap<String, String>, name: &str) -> f64 {
    row[name].parse().unwrap_or_else(|_| panic!("{name}: {row:?}"))
}

#[test]
fn a_table_has_a_row_for_each_frame_and_nothing_of_a_gap() {
    let dir = TestFolder::new();
    snapshots(&dir.at(""), 4);
    std::fs::rename(dir.at("snap-2/yy.f32"), dir.at("away")).unwrap();
    let options = OPTIONS.replace("--certificate none", "--certificate quick");
    dir.runs(&format!("series snap-0 snap-1 snap-2 snap-3 -o run.pgs {options}"));
    let [text, _] = dir.runs("info run.pgs --csv");
    let (rows, info) = (rows(&text), dir.says("info run.pgs"));
    assert!(text.contains("\n# masked_psnr_far [dB]: "), "{text}");
    assert_eq!(rows.iter().map(|r| &r["kind"][..]).collect::<Vec<_>>(), ["keyframe", "changes", "missing", "changes"]);
    for (i, row) in rows.iter().enumerate() {
        assert_eq!(value(row, "frame"), i as f64);
        if i == 2 {
            assert!(row.iter().all(|(name, v)| v.is_empty() || ["frame", "kind"].contains(&&name[..])), "{row:?}");
            continue;
        }
        let a = 0.5 + 0.05 * i as f64;
        assert!(
            (value(row, "scale_factor") - a).abs() < 1e-12 && (value(row, "redshift") - 1.0 / a + 1.0).abs() < 1e-12
        );
        assert_eq!((value(row, "particles"), &row["time"][..]), (4000.0, ""));
        assert_eq!(Some(value(row, "bytes")), info["frames"][i]["bytes"].as_f64());
        let one = dir.says(&format!("info run.pgs --frame {i}"));
        assert_eq!(Some(value(row, "gaussians")), one["gaussians"].as_f64());
        let mean = ["far", "mid", "near"].map(|o| value(row, &format!("masked_psnr_{o}"))).iter().sum::<f64>() / 3.0;
        assert!((mean - info["frames"][i]["masked_psnr"].as_f64().unwrap()).abs() < 1e-9);
    }
    dir.runs("extract run.pgs -o m.pgs --quiet");
    for other in ["m.pgs", "snap-0", "run.pgs --frame 1"] {
        dir.fails(&format!("info {other} --csv"), 2, "--csv has no effect here; it applies to a whole series");
    }
}

#[test]
fn statistics_over_time_are_those_of_each_frame() {
    let dir = TestFolder::new();
    snapshots(&dir.at(""), 4);
    std::fs::rename(dir.at("snap-1/yy.f32"), dir.at("away")).unwrap();
    dir.runs(&format!("series snap-0 snap-1 snap-2 snap-3 -o run.pgs {OPTIONS}"));
    let [said, _] = dir.runs("stats run.pgs -o s --spectrum-grid 32 --plots png,svg");
    assert!(said.contains("3 frames, z = 1.000 to z = 0.538"), "{said}");
    let name = |path: std::path::PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
    let names: Vec<String> = crate::common::files(&dir.at("s")).into_iter().map(name).collect();
    for name in ["frames.csv", "power_frames.csv", "stats.json", "power_frames.png", "groups_frames.svg"] {
        assert!(names.iter().any(|n| n == name), "{names:?}");
    }
    let (table, spectra) = (rows(&dir.text("s/frames.csv")), rows(&dir.text("s/power_frames.csv")));
    assert_eq!(table.len(), 4);
    assert!(table[1].iter().all(|(name, v)| v.is_empty() || ["frame", "kind"].contains(&&name[..])));
    let of_frame = |i: usize| spectra.iter().filter(move |r| value(r, "frame") == i as f64);
    assert_eq!(of_frame(1).count(), 0);
    // Each frame as the models of these frames are measured on their own.
    for i in [0, 3] {
        dir.runs(&format!("extract run.pgs --frame {i} -o f{i}.pgs --quiet"));
        dir.runs(&format!("stats f{i}.pgs f{i}.pgs -o one{i} --only spectrum --spectrum-grid 32 --no-plots --quiet"));
        let alone = rows(&dir.text(&format!("one{i}/power.csv")));
        assert_eq!(alone.len(), of_frame(i).count());
        for (row, one) in of_frame(i).zip(&alone) {
            let (row, one) = ([value(row, "k"), value(row, "power")], [value(one, "k"), value(one, "power_truth")]);
            // A frame between is coded anew where it is extracted, which the smallest scales show most.
            let share = if i == 0 { 1e-12 } else { 0.05 };
            assert!((0..2).all(|k| (row[k] / one[k] - 1.0).abs() < share), "{row:?} {one:?}");
        }
        let first = of_frame(i).next().unwrap();
        let name = table[0].keys().filter(|n| n.starts_with("power_")).min_by(|a, b| {
            let k = |name: &str| name["power_".len()..].parse::<f64>().unwrap();
            k(a).total_cmp(&k(b))
        });
        assert_eq!(table[i][name.unwrap()], first["power"]);
    }
    dir.runs("recover f0.pgs -o drawn --quiet");
    dir.runs("stats drawn drawn -o groups --only groups --no-plots --quiet");
    let groups: f64 = rows(&dir.text("groups/groups.csv")).iter().map(|r| value(r, "groups_truth")).sum();
    assert!(groups > 3.0 && value(&table[0], "groups_20") == groups, "{groups} {:?}", table[0]);
    // All frames by the first one's links, whatever the threads.
    dir.runs("stats run.pgs -o again --spectrum-grid 32 --plots png,svg --threads 1 --quiet");
    for name in names {
        assert!(dir.bytes(&format!("s/{name}")) == dir.bytes(&format!("again/{name}")), "{name}");
    }
    dir.fails("stats run.pgs -o no --only density", 2, "density compares two inputs");
    dir.fails("stats run.pgs -o no --joint-bins 5", 2, "--joint-bins has no effect here");
    dir.fails("stats run.pgs -o no --frame 1", 2, "only one is given");
    dir.fails("stats f0.pgs -o no", 2, "only one is given");
    assert!(!dir.at("no").exists());
}

#[test]
fn means_of_fields_over_time_are_those_of_the_particles() {
    let dir = TestFolder::new();
    snapshots(&dir.at(""), 3);
    let mut means = Vec::new();
    let mut frames = Vec::new();
    for i in 0..3 {
        // The last frame has no temperature.
        let values: Vec<f32> = (0..4000).map(|p| 100.0 * (i + 1) as f32 + (p % 7) as f32).collect();
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        if i < 2 {
            std::fs::write(dir.at(&format!("snap-{i}/temperature.f32")), bytes).unwrap();
        }
        means.push(values.iter().map(|v| f64::from(*v)).sum::<f64>() / 4000.0);
        let fields = if i < 2 { "--fields all" } else { "" };
        let model = dir.makes(&format!("compress snap-{i} -o m{i}.pgs --gaussians 40 --certificate none -q {fields}"));
        frames.push(Some(CodedFrame { time: 0.5 + 0.05 * i as f64, keyframe: true, bytes: model }));
    }
    dir.write("run.pgs", codec::assemble_series(SeriesClock::ScaleFactor, "", &frames).unwrap());
    dir.runs("stats run.pgs -o s --only groups --quiet");
    let table = rows(&dir.text("s/frames.csv"));
    for (row, mean) in table.iter().zip(&means).take(2) {
        assert!((value(row, "mean_temperature") / mean - 1.0).abs() < 1e-6, "{row:?} {mean}");
    }
    assert_eq!(table[2]["mean_temperature"], "");
    assert!(dir.at("s/fields_frames.png").exists() && !dir.at("s/power_frames.csv").exists());
}

/// The focal points and positions of a views file.
fn cameras(dir: &TestFolder, name: &str) -> Vec<[[f64; 3]; 2]> {
    let views = dir.json(name);
    let three = |v: &serde_json::Value| std::array::from_fn(|k| v[k].as_f64().unwrap());
    let camera = |v: &serde_json::Value| [three(&v["focal_point"]), three(&v["position"])];
    views["views"].as_array().unwrap().iter().map(camera).collect()
}

/// The shortest way between places in a box of 10.
fn way(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| (b[k] - a[k] + 5.0).rem_euclid(10.0) - 5.0)
}

fn is_near(a: [f64; 3], b: [f64; 3], by: f64) -> bool {
    way(a, b).iter().all(|d| d.abs() <= by)
}

#[test]
fn the_camera_follows_a_halo_across_the_face_of_the_box() {
    let dir = TestFolder::new();
    snapshots(&dir.at(""), 4);
    // Enough that each group has its own.
    let many = OPTIONS.replace("60", "200");
    dir.runs(&format!("series snap-0 snap-1 snap-2 snap-3 -o run.pgs {many}"));
    // The group at the corner, which drifts by (0.05, 0.1, 0.15) a frame.
    let drift = |frame: f64| [1.0, 2.0, 3.0].map(|k| 0.05 * frame * k);
    dir.write(
        "first.csv",
        "id,x,y,z,radius\n# positions and radii in kpc/h\n# a = 0.5\n3,5000,5000,5000,600\n8,30,9990,0,600\n",
    );
    let [x, y, z] = drift(3.0);
    dir.write("last.csv", format!("x,y,z,radius\n# positions and radii in Mpc/h\n# a = 0.65\n{x},{y},{z},0.6\n"));
    let film = "render run.pgs --width 2 --depth 1.6 --size 64x48 --no-annotations --quiet";
    dir.runs(&format!("{film} --frames all --follow first.csv:8 -o a --save-views a.json"));
    dir.runs(&format!("{film} --frames all --follow last.csv:1 -o b --save-views b.json"));
    dir.runs(&format!("{film} --frames 7 --follow first.csv:8 -o c --save-views c.json"));
    dir.runs(&format!("{film} --frames all --center 0,0,0 -o still"));
    let [a, b, c] = ["a.json", "b.json", "c.json"].map(|name| cameras(&dir, name));
    assert_eq!([a.len(), b.len(), c.len()], [4, 4, 7]);
    for (i, [focal, position]) in a.iter().enumerate() {
        assert!(is_near(*focal, drift(i as f64), 0.12), "{i}: {focal:?}");
        assert!(focal.iter().all(|v| (0.0..=10.0).contains(v)), "{focal:?}");
        let offset = |[focal, position]: [[f64; 3]; 2]| -> [f64; 3] { std::array::from_fn(|k| position[k] - focal[k]) };
        let (view_offset, first) = (offset([*focal, *position]), offset(a[0]));
        assert!((0..3).all(|k| (view_offset[k] - first[k]).abs() < 1e-9), "{view_offset:?} {first:?}");
        // Backwards from the last frame it is the same way.
        assert!(is_near(*focal, b[i][0], 0.02), "{i}: {focal:?} {:?}", b[i]);
        assert!(is_near(c[2 * i][0], *focal, 1e-9));
    }
    let middle = way(a[1][0], a[2][0]).map(|d| 0.5 * d);
    assert!(is_near(c[3][0], std::array::from_fn(|k| a[1][0][k] + middle[k]), 1e-9));
    // Followed, the group stays whole and in the middle; the corner itself shows an eighth of it.
    let light = |name: &str| {
        let picture = particlegs_files::png::read_png(&dir.at(name)).unwrap().data;
        let (mut all, mut across) = (0.0, 0.0);
        for (i, v) in picture.iter().enumerate() {
            all += f64::from(*v);
            across += f64::from(*v) * ((i / (picture.len() / 3072) % 64) as f64 - 31.5) / 64.0;
        }
        (all, across / all)
    };
    let followed: Vec<(f64, f64)> = (0..4).map(|i| light(&format!("a/frame_000{i}.png"))).collect();
    assert!(followed.iter().all(|(_, across)| across.abs() < 0.08), "{followed:?}");
    assert!(followed.iter().all(|(all, _)| (all / followed[0].0 - 1.0).abs() < 0.3), "{followed:?}");
    assert!(followed[0].0 > 2.5 * light("still/frame_0000.png").0, "{followed:?} {:?}", light("still/frame_0000.png"));
    let all = "render run.pgs -o no --frames all";
    dir.fails(&format!("{all} --follow first.csv:5"), 3, "it lists no halo 5");
    dir.fails(&format!("{all} --follow first.csv"), 2, "write FILE:NUMBER");
    dir.fails("render run.pgs -o no --follow first.csv:8", 2, "required arguments");
    // Where the group is gone, the camera stays.
    let mut x = dir.bytes("snap-1/xx.f32");
    for group in x.chunks_exact_mut(4 * 25) {
        group[..4].copy_from_slice(&5f32.to_le_bytes());
    }
    dir.write("snap-1/xx.f32", x);
    dir.runs(&format!("series snap-0 snap-1 -o gone.pgs {OPTIONS}"));
    let gone = "render gone.pgs --frames all --follow first.csv:8 --size 32x24";
    let [_, said] = dir.runs(&format!("{gone} -o gone --save-views gone.json"));
    assert!(said.contains("warning: frame 1 (z = 0.818) has no mass near the place of halo 8"), "{said}");
    let views = cameras(&dir, "gone.json");
    assert_eq!(views[0], views[1]);
    dir.write("late.csv", "id,x,y,z,radius\n# positions and radii in Mpc/h\n# a = 0.9\n1,1,1,1,1\n");
    dir.fails(&format!("{all} --follow late.csv:1"), 3, "the nearest frame's is 0.65");
    dir.write("point.csv", "id,x,y,z\n# a = 0.5\n1,1,1,1\n");
    dir.fails(&format!("{all} --follow point.csv:1"), 3, "halo 1 has no radius");
    dir.write("second.csv", "id,x,y,z,radius\n# positions and radii in Mpc/h\n# a = 0.55\n1,0,0,0,0.6\n");
    dir.fails(&format!("{gone} -o no --follow second.csv:1").replace(" --follow first.csv:8", ""), 3, "no mass near");
}

#[test]
fn pictures_are_about_the_mass_of_a_region_or_of_layers() {
    let dir = TestFolder::new();
    snapshots(&dir.at(""), 3);
    dir.runs(&format!("series snap-0 snap-1 snap-2 -o run.pgs {OPTIONS}"));
    let small = "--width 3 --radius 0.05 --size 64x48 --quiet";
    // A group at (1.11, 1.48, 1.85).
    let region = "--center 0.4,1.9,0.7,2.3,1.0,2.7";
    dir.runs(&format!("render run.pgs --frames all --no-annotations {region} -o film {small} --save-views film.json"));
    for (i, [focal, _]) in cameras(&dir, "film.json").into_iter().enumerate() {
        let place = [1.11 + 0.05 * i as f64, 1.48 + 0.1 * i as f64, 1.85 + 0.15 * i as f64];
        assert!(is_near(focal, place, 0.15), "{i}: {focal:?}");
    }
    // One frame is drawn as it is in the film.
    dir.runs(&format!("render run.pgs --frame 0 {region} -o one {small} --save-views one.json"));
    assert!(is_near(cameras(&dir, "one.json")[0][0], cameras(&dir, "film.json")[0][0], 1e-12));
    let pixels = |name: &str| particlegs_files::png::read_png(&dir.at(name)).unwrap().data;
    assert!(pixels("one/view.png") == pixels("film/frame_0000.png"));
    dir.fails("render run.pgs --frame 0 --center all -o no", 3, "fills the periodic box");
    dir.fails("render run.pgs --frames all --center stars -o no", 2, "no layer `stars`");
    dir.fails("render run.pgs --frame 0 --center 20,21,20,21,20,21 -o no", 3, "there is no mass");
    dir.fails("reference snap-0 --center stars -o no", 2, "a centre is X,Y,Z here");
    dir.runs("extract run.pgs --frame 0 -o m.pgs --quiet");
    dir.fails("render m.pgs --frames all --follow a.csv:1 -o no", 2, "--follow has no effect here");
}

/// A helix of CA atoms with two hydrogens each that turns about z and drifts across the faces of its box, as GRO files.
fn molecule(dir: &TestFolder, frames: usize) {
    for frame in 0..frames {
        let (sine, cosine) = (0.9 * frame as f64).sin_cos();
        let mut text = format!("helix t= {:.5}\n{:>5}\n", 2.0 * frame as f64, 300);
        for i in 0..300 {
            let (t, side) = ((i / 3) as f64 * 0.03, [0.0, 0.08, -0.08][i % 3]);
            let p = [t - 1.5, 0.5 * (3.0 * t).sin() + side, 0.3 * (3.0 * t).cos() - side];
            let p = [cosine * p[0] - sine * p[1] + 0.4 * frame as f64, sine * p[0] + cosine * p[1] + 0.2, p[2]];
            let [x, y, z] = p.map(|v| v.rem_euclid(5.0));
            let name = ["CA", "H", "H"][i % 3];
            text += &format!("{:>5}{:<5}{:>5}{:>5}{x:>8.3}{y:>8.3}{z:>8.3}\n", i / 3 + 1, "ALA", name, i + 1);
        }
        dir.write(&format!("mol{frame}.gro"), text + "   5.00000   5.00000   5.00000\n");
    }
}

#[test]
fn molecules_are_aligned_onto_the_first_frame() {
    let dir = TestFolder::new();
    molecule(&dir, 4);
    let options = "--gaussians 30 --certificate none --keyframe-interval 2";
    let all = "series mol0.gro mol1.gro mol2.gro mol3.gro";
    let mut command = dir.command(&format!("{all} -o run.pgs {options}"));
    let [_, said] = crate::common::success(command.args(["--align", "name CA"]));
    assert!(said.contains("aligned frames have no periodic box"), "{said}");
    let (first, plain) = (dir.says("info run.pgs --frame 0"), format!("{all} -o plain.pgs {options} -q"));
    dir.runs(&plain);
    for frame in 1..4 {
        let other = dir.says(&format!("info run.pgs --frame {frame}"));
        assert!(other["metadata"]["cell"].is_null());
        for (end, k) in [("min", 0), ("max", 1), ("max", 2)] {
            let edge = |info: &serde_json::Value| info["metadata"]["bounds"][end][k].as_f64().unwrap();
            assert!((edge(&other) - edge(&first)).abs() < 0.01, "{frame} {end} {k}: {} {}", edge(&other), edge(&first));
        }
    }
    assert!(!dir.says("info plain.pgs --frame 0")["metadata"]["cell"].is_null());
    for (name, is_told) in [("run", true), ("plain", false)] {
        let [_, said] = dir.runs(&format!("eval {name}.pgs mol1.gro --frame 1 --frames 1 --size 32x24"));
        assert_eq!(said.contains("the frames of run.pgs were aligned"), is_told, "{said}");
    }
    // Other options make another series.
    let mut command = dir.command(&format!("{all} -o run.pgs {options}"));
    crate::common::fails(command.args(["--align", "name H"]), 8, "run.pgs: exists already");
    let mut command = dir.command(&format!("{all} -o no.pgs {options}"));
    crate::common::fails(command.args(["--align", "resid 1"]), 2, "atoms that lie on a line");
}

#[test]
fn a_species_that_appears_later_leaves_the_first_frames_empty() {
    let dir = TestFolder::new();
    let options = "--gaussians 4 --certificate none --quiet";
    let dark = dir.makes(&format!("compress FIXTURES/species.hdf5 -o dark.pgs --particle-type dm {options}"));
    let both = dir.makes(&format!("compress FIXTURES/species.hdf5 -o both.pgs --share-gaussians no {options}"));
    let frame = |time: f64, bytes: Vec<u8>| Some(CodedFrame { time, keyframe: true, bytes });
    let frames = [frame(1.0, dark), frame(2.0, both)];
    dir.write("run.pgs", codec::assemble_series(SeriesClock::Time, "", &frames).unwrap());
    dir.runs("stats run.pgs -o s --only groups --particle-type gas --quiet");
    let table = rows(&dir.text("s/frames.csv"));
    assert_eq!((&table[0]["groups_20"][..], &table[0]["particles"][..]), ("", "0"));
    assert_eq!((&table[1]["groups_100"][..], &table[1]["particles"][..]), ("0", "20"));
    // The table is replaced by one with other columns.
    dir.runs("stats run.pgs -o s --only spectrum --spectrum-grid 8 --no-plots --quiet");
    dir.fails("stats run.pgs -o no --particle-type stars", 2, "no layer `stars`");
    let film = "render run.pgs --frames all --size 32x24 --save-views views.json -o film";
    let [_, said] = dir.runs(&format!("{film} --center gas"));
    assert!(said.contains("warning: frame 0 has no mass to be centred on"), "{said}");
    let views = cameras(&dir, "views.json");
    assert_eq!(views[0], views[1]);
}

/// Between keyframes all Gaussians fade: near one of them, most of the other's stand for less than a particle.
#[test]
fn models_between_frames_have_no_gaussians_without_particles() {
    let dir = TestFolder::new();
    snapshots(&dir.at(""), 2);
    dir.runs(&format!(
        "series snap-0 snap-1 -o run.pgs {} --keyframe-interval 1",
        OPTIONS.replace("--keyframe-interval 3", "")
    ));
    let report = dir.says("export run.pgs --time a=0.5005 -o x.csv --quiet");
    let text = dir.text("x.csv");
    let mut rows = text.lines().filter(|l| !l.starts_with('#'));
    let at = rows.next().unwrap().split(',').position(|name| name == "count").unwrap();
    let counts: Vec<f64> = rows.map(|row| row.split(',').nth(at).unwrap().parse().unwrap()).collect();
    assert_eq!(report["gaussians"].as_u64(), Some(counts.len() as u64));
    assert_eq!(counts.iter().sum::<f64>(), 4000.0);
    assert!(counts.iter().all(|n| *n >= 1.0) && counts.len() < 120, "{counts:?}");
    dir.runs("extract run.pgs --time a=0.5005 -o m.pgs --quiet");
    assert_eq!(dir.model("m.pgs").gaussians(), counts.len());
}
