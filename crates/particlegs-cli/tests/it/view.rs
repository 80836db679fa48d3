//! `view` as a browser meets it, and as others do who should not.

use crate::common::{fails, particlegs, sample, signal, snapshot, waited};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A few particles on a spiral, and a model of them.
fn subjects(dir: &Path) -> [PathBuf; 2] {
    let along = |f: fn(f32) -> f32| (0..3000).map(|i| f(i as f32 / 3000.0)).collect::<Vec<f32>>();
    let columns = [along(|t| (19.0 * t).cos() * t), along(|t| t), along(|t| (19.0 * t).sin() * t)];
    let (particles, model) = (dir.join("spiral"), dir.join("spiral.pgs"));
    snapshot(&particles, &columns);
    let mut c = particlegs();
    c.arg("compress").arg(&particles).arg("-o").arg(&model);
    c.args(["--gaussians", "40", "--effort", "fast", "--certificate=none", "--quiet"]).assert().success();
    [model, particles]
}

/// The command, serving.
struct Serving {
    child: Child,
    /// What it printed first.
    url: String,
    rest: BufReader<std::process::ChildStdout>,
}

impl Serving {
    fn new(prepare: impl FnOnce(&mut Command) -> &mut Command) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_particlegs"));
        command.args(["view", "--no-open", "--port", "0"]).env_remove("SSH_CONNECTION").env_remove("PARTICLEGS_TOKEN");
        prepare(&mut command);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut rest = BufReader::new(child.stdout.take().unwrap());
        let mut url = String::new();
        rest.read_line(&mut url).unwrap();
        assert!(url.starts_with("http://"), "{url}");
        Serving { child, url: url.trim().to_string(), rest }
    }

    fn of(model: &Path) -> Self {
        Self::new(|c| c.arg(model))
    }

    /// `127.0.0.1:PORT`, and the path with the token.
    fn parts(&self) -> (&str, &str) {
        let rest = self.url.strip_prefix("http://").unwrap();
        rest.split_at(rest.find('/').unwrap())
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.parts().0).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        stream
    }

    /// What comes back for bytes sent as they are.
    fn raw(&self, request: &[u8]) -> Answer {
        let mut stream = self.connect();
        // It may be refused before all of it is sent.
        let _ = stream.write_all(request);
        Answer::read(stream)
    }

    /// `METHOD` of a path behind the token, with further lines of the head.
    fn ask(&self, method: &str, path: &str, head: &str, body: &[u8]) -> Answer {
        self.raw(&self.request(method, path, head, body))
    }

    fn request(&self, method: &str, path: &str, head: &str, body: &[u8]) -> Vec<u8> {
        let (host, token) = self.parts();
        let host = if head.contains("Host:") { String::new() } else { format!("Host: {host}\r\n") };
        let start = format!(
            "{method} {token}{path} HTTP/1.1\r\n{host}Connection: close\r\nContent-Length: {}\r\n{head}\r\n",
            body.len()
        );
        [start.as_bytes(), body].concat()
    }

    fn get(&self, path: &str) -> Answer {
        self.ask("GET", path, "", b"")
    }

    fn truth(&self, question: &Value) -> Answer {
        self.raw(&self.question(question))
    }

    fn question(&self, question: &Value) -> Vec<u8> {
        let origin = format!("Content-Type: application/json\r\nOrigin: http://{}\r\n", self.parts().0);
        self.request("POST", "truth", &origin, question.to_string().as_bytes())
    }

    /// Ends it by a signal: its exit code, and what it printed beside the address.
    fn end(mut self, name: &str) -> (Option<i32>, String, String) {
        signal(&self.child, name);
        let start = Instant::now();
        let code = self.child.wait().unwrap().code();
        assert!(start.elapsed() < Duration::from_secs(5), "it took {:?} to end", start.elapsed());
        let (mut out, mut err) = (String::new(), String::new());
        self.rest.read_to_string(&mut out).unwrap();
        self.child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
        assert!(!err.contains("panicked"), "{err}");
        (code, out, err)
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

struct Answer {
    status: u16,
    head: String,
    body: Vec<u8>,
}

impl Answer {
    fn read(mut stream: TcpStream) -> Self {
        let mut bytes = Vec::new();
        // A connection that is cut says no more.
        let _ = stream.read_to_end(&mut bytes);
        let end = bytes.windows(4).position(|w| w == b"\r\n\r\n").map_or(bytes.len(), |at| at + 4);
        let head = String::from_utf8(bytes[..end].to_vec()).unwrap();
        let status = head.get(9..12).map_or(0, |code| code.parse().unwrap());
        Answer { status, head: head.to_ascii_lowercase(), body: bytes[end..].to_vec() }
    }

    fn text(&self) -> &str {
        std::str::from_utf8(&self.body).unwrap()
    }

    fn header(&self, name: &str) -> Option<&str> {
        self.head.lines().find_map(|l| l.strip_prefix(name)?.strip_prefix(": "))
    }
}

#[test]
fn the_page_and_all_that_it_needs_are_served() {
    let dir = tempfile::tempdir().unwrap();
    let [model, particles] = subjects(dir.path());
    let bytes = std::fs::read(&model).unwrap();
    let serving = Serving::new(|c| c.arg(&model).arg(&model).arg("--snapshot").arg(&particles));
    let page = serving.get("");
    assert_eq!((page.status, page.header("content-type")), (200, Some("text/html; charset=utf-8")));
    let policy = page.header("content-security-policy").unwrap();
    assert!(policy.contains("default-src 'none'") && policy.contains("connect-src 'self'"), "{policy}");
    assert!(policy.contains("frame-ancestors 'self'"), "{policy}");
    assert!(!policy.contains("unsafe-inline") && !policy.contains("'unsafe-eval'"), "{policy}");
    let setup = page.text().split("id=\"setup\">").nth(1).unwrap().split("</script>").next().unwrap();
    let setup: Value = serde_json::from_str(setup).unwrap();
    assert_eq!(setup["models"][1]["url"], "model/1");
    assert_eq!(setup["models"][1]["bytes"], bytes.len());
    assert_eq!(setup["truth"], json!({"url": "truth", "name": "spiral", "particles": 3000}));
    assert_eq!((&setup["served"], &setup["engine"]["url"]), (&json!(true), &json!("engine")));
    for place in ["model/0", "model/1"] {
        let answer = serving.get(place);
        assert!(answer.status == 200 && answer.body == bytes, "{place}");
    }
    // A head without its body, of the same length.
    let head = serving.ask("HEAD", "model/0", "", b"");
    assert_eq!((head.status, head.body.len()), (200, 0));
    assert_eq!(head.header("content-length"), Some(&bytes.len().to_string()[..]));
    // The engine and the page in both forms.
    let plain = serving.get("engine");
    assert_eq!((plain.header("content-type"), &plain.body[..4]), (Some("application/wasm"), &b"\0asm"[..]));
    for place in ["engine", ""] {
        let packed = serving.ask("GET", place, "Accept-Encoding: br, gzip\r\n", b"");
        assert_eq!((packed.header("content-encoding"), &packed.body[..2]), (Some("gzip"), &[0x1f, 0x8b][..]));
    }
    // The same headers everywhere.
    for answer in [page, plain, serving.get("nothing"), serving.ask("PUT", "", "", b"")] {
        for (name, value) in [
            ("x-content-type-options", "nosniff"),
            ("referrer-policy", "no-referrer"),
            ("cache-control", "no-store"),
            ("cross-origin-opener-policy", "same-origin"),
            ("cross-origin-resource-policy", "same-origin"),
        ] {
            assert_eq!(answer.header(name), Some(value), "{}", answer.head);
        }
        assert!(answer.header("content-security-policy").is_some());
    }
    // Without its slash the address leads to the page, by a relative way.
    let (host, token) = serving.parts();
    let bare = serving.raw(
        format!("GET {} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n", token.trim_end_matches('/')).as_bytes(),
    );
    assert_eq!((bare.status, bare.header("location")), (303, Some(&token[1..])));
    assert_eq!(serving.end("-INT").0, Some(0));
}

#[test]
fn others_find_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let [model, _] = subjects(dir.path());
    let serving = Serving::of(&model);
    let (host, token) = serving.parts();
    let to = |path: &str, head: &str| {
        serving.raw(format!("GET {path} HTTP/1.1\r\n{head}Connection: close\r\n\r\n").as_bytes())
    };
    let own = format!("Host: {host}\r\n");
    let other = if token.ends_with("0/") { '1' } else { '0' };
    let wrong = format!("{}{other}/", &token[..token.len() - 2]);
    let nowhere = [
        "/",
        "//",
        "/favicon.ico",
        "/robots.txt",
        "/../",
        "/..%2f",
        "/%2e%2e/%2e%2e/etc/passwd",
        &wrong,
        &format!("{token}../"),
        &format!("{token}%2e%2e/"),
        &format!("{token}../../etc/passwd"),
        &format!("{token}model/../../../etc/passwd"),
        &format!("{token}model/..%2f..%2fetc%2fpasswd"),
        &format!("{token}model/"),
        &format!("{token}model/1"),
        &format!("{token}model/00"),
        &format!("{token}model/0/"),
        &format!("{token}model/-1"),
        &format!("{token}model/99999999999999999999999999"),
        &format!("{token}model/0%00"),
        &format!("{token}setup"),
        &format!("{token}poster"),
        &format!("{token}truth"),
        &format!("{token}/"),
        &format!("/{token}"),
    ];
    for path in nowhere {
        let answer = to(path, &own);
        assert_eq!(answer.status, 404, "{path}: {}", answer.text());
        assert!(!answer.text().contains(&token[1..token.len() - 1]), "{path}");
    }
    // Names of other sites, and their pages.
    for name in ["evil.example", &format!("127.0.0.1.evil.example{}", &host[9..]), "0.0.0.0", "192.0.2.1"] {
        let answer = to(token, &format!("Host: {name}\r\n"));
        assert_eq!(answer.status, 403, "{name}");
    }
    for head in ["", "Host:\r\n", "Host: a b\r\n", "Host: 127.0.0.1:99999\r\n", &format!("{own}Host: evil.example\r\n")]
    {
        assert_eq!(to(token, head).status, 400, "{head:?}");
    }
    for origin in ["null", "https://evil.example", "http://127.0.0.1:1", "file://"] {
        assert_eq!(to(token, &format!("{own}Origin: {origin}\r\n")).status, 403, "{origin}");
    }
    assert_eq!(to(&format!("http://evil.example{token}"), &own).status, 400);
    assert_eq!(to(token, &format!("{own}Origin: http://{host}\r\n")).status, 200);
    assert_eq!(to(token, &format!("Host: localhost{}\r\n", &host[9..])).status, 200);
    // Other methods.
    for method in ["POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "CONNECT", "BREW"] {
        let answer = serving.ask(method, "", "", b"");
        assert!([400, 405].contains(&answer.status), "{method}: {}", answer.status);
    }
    assert_eq!(serving.ask("POST", "", "", b"").header("allow"), Some("get, head"));
    // It is there as before, and has told who was refused.
    assert_eq!(serving.get("").status, 200);
    let (code, _, said) = serving.end("-TERM");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("`--allow-host evil.example`"), "{said}");
    assert_eq!(said.matches("page of another site").count(), 1, "{said}");
}

#[test]
fn huge_and_broken_requests_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let [model, particles] = subjects(dir.path());
    let serving = Serving::new(|c| c.arg(&model).arg("--snapshot").arg(&particles));
    let (host, token) = serving.parts();
    let long = "x".repeat(1 << 20);
    for head in [
        format!("GET {token} HTTP/1.1\r\nHost: {host}\r\nX-Long: {long}\r\n\r\n"),
        format!("GET /{long} HTTP/1.1\r\nHost: {host}\r\n\r\n"),
        format!("GET {token} HTTP/1.1\r\nHost: {host}\r\n{}\r\n", "X-Many: y\r\n".repeat(5000)),
        "GET / SPDY/9\r\n\r\n".into(),
        "\0\u{1}\u{2}\r\n\r\n".into(),
    ] {
        let answer = serving.raw(head.as_bytes());
        assert!([0, 400, 414, 431].contains(&answer.status), "{}: {:?}", answer.status, &head[..40.min(head.len())]);
    }
    let json = "Content-Type: application/json\r\n";
    assert_eq!(serving.ask("POST", "truth", json, &vec![b' '; 1 << 20]).status, 413);
    // A length that is only promised.
    let promised = format!("POST {token}truth HTTP/1.1\r\nHost: {host}\r\n{json}Content-Length: 99999999999\r\n\r\n");
    let mut stream = serving.connect();
    stream.write_all(&[promised.as_bytes(), &vec![b' '; 20_000]].concat()).unwrap();
    assert_eq!(Answer::read(stream).status, 413);
    // A body that breaks off.
    let mut stream = serving.connect();
    stream
        .write_all(
            format!("POST {token}truth HTTP/1.1\r\nHost: {host}\r\n{json}Content-Length: 9\r\n\r\n{{").as_bytes(),
        )
        .unwrap();
    stream.shutdown(Shutdown::Write).unwrap();
    assert!([0, 400].contains(&Answer::read(stream).status));
    assert_eq!(serving.ask("POST", "truth", "Content-Type: text/plain\r\n", b"{}").status, 415);
    assert_eq!(serving.ask("GET", "truth", "", b"").status, 405);
    assert_eq!(serving.get("").status, 200);
    assert_eq!(serving.end("-INT").0, Some(0));
}

/// A question for the spiral, in every look but for what `change` says.
fn question(look: &str) -> Value {
    json!({
        "camera": {
            "position": [2.5, 1.25, 3.125], "focal_point": [0.1, 0.5, 0.0], "view_up": [0.0, 1.0, 0.0],
            "fov_deg": 30.0, "height": null, "clipping_range": null
        },
        "radius": 0.012, "opacity": 0.3, "look": look, "width": 160, "height_pixels": 90
    })
}

#[test]
fn pictures_of_all_particles_are_those_of_reference() {
    let dir = tempfile::tempdir().unwrap();
    let [model, particles] = subjects(dir.path());
    // In a box that repeats, for orthographic windows.
    let serving = Serving::new(|c| c.arg(&model).arg("--snapshot").arg(&particles).args(["--box", "3"]));
    let reference = |arguments: &[&str], out: &Path| {
        let mut c = particlegs();
        c.arg("reference")
            .arg(&particles)
            .args(["--box", "3"])
            .args(arguments)
            .arg("-o")
            .arg(out)
            .arg("--quiet")
            .assert()
            .success();
    };
    let q = question("paraview");
    let views = json!({"width": 160, "height": 90, "fov_deg": 30.0, "views": [{
        "name": "view", "position": q["camera"]["position"], "focal_point": q["camera"]["focal_point"],
        "view_up": q["camera"]["view_up"], "radius": q["radius"], "opacity": q["opacity"]}]});
    let file = dir.path().join("views.json");
    std::fs::write(&file, views.to_string()).unwrap();
    let file = file.to_str().unwrap();
    for look in ["paraview", "paraview-no-fxaa", "expected"] {
        let png = dir.path().join(format!("{look}.png"));
        reference(&["--views", file, "--style", look], &png);
        let answer = serving.truth(&question(look));
        assert_eq!(answer.status, 200, "{}", answer.text());
        let truth = particlegs::picture::read_png(&png).unwrap().data;
        assert!(truth.iter().any(|&v| v > 20) && answer.body == truth, "{look}");
    }
    let folder = dir.path().join("sigma");
    reference(&["--views", file, "--style", "density", "--raw"], &folder);
    let sigma = std::fs::read(folder.join("view.f32")).unwrap();
    assert!(sigma.iter().any(|&b| b > 0) && serving.truth(&question("density")).body == sigma);
    // An orthographic window, by the camera that `reference` reports.
    let (report, folder) = (dir.path().join("report.json"), dir.path().join("slab"));
    let window = [
        "--style",
        "density",
        "--raw",
        "--projection",
        "orthographic",
        "--size",
        "160x90",
        "--azimuth",
        "20",
        "--width",
        "7",
    ];
    reference(&[&window[..], &["--json", report.to_str().unwrap()]].concat(), &folder);
    let report: Value = serde_json::from_slice(&std::fs::read(report).unwrap()).unwrap();
    let camera = &report["views"][0];
    let mut q = question("density");
    q["camera"] = json!({
        "position": camera["position"], "focal_point": camera["focal_point"], "view_up": camera["view_up"],
        "height": camera["height_world"], "clipping_range": camera["clipping_range"]
    });
    let slab = std::fs::read(folder.join("view.f32")).unwrap();
    let answer = serving.truth(&q);
    assert_eq!(answer.status, 200, "{}", answer.text());
    assert!(slab.iter().any(|&b| b > 0) && answer.body == slab);
    // The copies are in it, and only where they are wanted.
    q["periodic"] = json!(false);
    assert!(serving.truth(&q).body != slab);
}

/// A share of the particles stands for all of them.
#[test]
fn coarse_pictures_are_of_fewer_particles() {
    let dir = tempfile::tempdir().unwrap();
    let serving = of_the_sample(dir.path());
    let draw = |look: &str, share: f64| {
        let mut q = long();
        (q["look"], q["share"], q["radius"]) = (json!(look), json!(share), json!(0.1));
        (q["width"], q["height_pixels"], q["opacity"]) = (json!(96), json!(96), json!(0.2));
        let answer = serving.truth(&q);
        assert_eq!(answer.status, 200, "{}", answer.text());
        answer.body
    };
    for look in ["paraview", "paraview-no-fxaa", "expected"] {
        let (whole, half) = (draw(look, 1.0), draw(look, 0.5));
        let mean = |p: &[u8]| p.iter().map(|&v| f64::from(v)).sum::<f64>() / p.len() as f64;
        let difference = whole.iter().zip(&half).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / 96.0 / 96.0;
        assert!(whole != half && (mean(&whole) - mean(&half)).abs() < 0.05 * mean(&whole), "{look}");
        assert!(mean(&whole) > 20.0 && difference < 0.2 * mean(&whole), "{look}: {difference} of {}", mean(&whole));
        assert!(draw(look, 0.5) == half, "the same particles again");
    }
    let sum = |share| {
        let bytes = draw("density", share);
        bytes.chunks_exact(4).map(|v| f64::from(f32::from_le_bytes(v.try_into().unwrap()))).sum::<f64>()
    };
    assert!((sum(0.1) / sum(1.0) - 1.0).abs() < 0.02, "{} and {}", sum(0.1), sum(1.0));
}

#[test]
fn wrong_questions_are_told_in_a_line() {
    let dir = tempfile::tempdir().unwrap();
    let [model, particles] = subjects(dir.path());
    let serving = Serving::new(|c| c.arg(&model).arg("--snapshot").arg(&particles));
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
        (set(&["camera", "position"], json!([0.1, 0.5, 0.0])), "stands at its focal point"),
        (set(&["camera", "view_up"], json!([0, 0, 0])), "view_up"),
        (set(&["camera", "fov_deg"], json!(180)), "field of view"),
        (set(&["camera", "fov_deg"], json!(null)), "either fov_deg or height"),
        (set(&["camera", "height"], json!(1)), "either fov_deg or height"),
        (set(&["camera", "clipping_range"], json!([2, 1])), "clipping range"),
    ] {
        let answer = serving.truth(&wrong);
        assert!(answer.status == 400 && answer.text().contains(says), "{wrong}: {} {}", answer.status, answer.text());
        assert!(answer.text().lines().count() == 1 && !answer.text().contains('\u{1b}'), "{}", answer.text());
    }
    let mut flat = question("expected");
    flat["camera"]["fov_deg"] = json!(null);
    flat["camera"]["height"] = json!(1.0);
    assert!(serving.truth(&flat).text().contains("orthographic in the look density alone"));
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
fn of_the_sample(dir: &Path) -> Serving {
    let [model, _] = subjects(dir);
    Serving::new(|c| c.arg(&model).arg("--snapshot").arg(sample()))
}

#[test]
fn a_newer_picture_gives_the_older_up() {
    let dir = tempfile::tempdir().unwrap();
    let serving = of_the_sample(dir.path());
    let start = Instant::now();
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
        let answer = Answer::read(stream);
        assert!(answer.status == 409 && answer.text().contains("another picture"), "{}", answer.text());
    }
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
}

/// Processor time that a process has taken, in ticks of the kernel.
#[cfg(target_os = "linux")]
fn ticks(child: &Child) -> u64 {
    let stat = std::fs::read_to_string(format!("/proc/{}/stat", child.id())).unwrap();
    let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_whitespace().collect();
    fields[11].parse::<u64>().unwrap() + fields[12].parse::<u64>().unwrap()
}

#[test]
#[cfg(target_os = "linux")]
fn a_closed_connection_gives_its_picture_up() {
    let dir = tempfile::tempdir().unwrap();
    let serving = of_the_sample(dir.path());
    let before = ticks(&serving.child);
    let mut stream = serving.connect();
    stream.write_all(&serving.question(&long())).unwrap();
    waited("the drawing", || ticks(&serving.child) > before + 20);
    drop(stream);
    let mut last = (Instant::now(), ticks(&serving.child));
    waited("the drawing to end", || {
        if last.0.elapsed() < Duration::from_millis(300) {
            return false;
        }
        let now = ticks(&serving.child);
        let done = now <= last.1 + 1;
        last = (Instant::now(), now);
        done
    });
}

#[test]
fn ctrl_c_ends_it_while_a_picture_is_drawn() {
    let dir = tempfile::tempdir().unwrap();
    let serving = of_the_sample(dir.path());
    let mut stream = serving.connect();
    stream.write_all(&serving.question(&long())).unwrap();
    std::thread::sleep(Duration::from_millis(300));
    let (code, out, said) = serving.end("-INT");
    assert_eq!(code, Some(0), "{said}");
    assert_eq!((out.trim(), &said[..]), ("Ctrl-C ends it.", ""));
}

/// The poster of a large model is what `render` draws of the first view.
#[test]
#[ignore = "slow"]
fn a_large_model_has_a_poster() {
    let dir = tempfile::tempdir().unwrap();
    let (model, picture) = (dir.path().join("large.pgs"), dir.path().join("large.png"));
    let made = ["--gaussians", "101000", "--effort", "fast", "--certificate=none", "--quiet"];
    particlegs().arg("compress").arg(sample()).args(made).arg("-o").arg(&model).assert().success();
    particlegs()
        .arg("render")
        .arg(&model)
        .args(["--size", "1280x720", "--quiet", "-o"])
        .arg(&picture)
        .assert()
        .success();
    let serving = Serving::of(&model);
    assert!(serving.get("").text().contains("<img id=\"poster\" alt=\"large.pgs\" src=\"poster\">"));
    let poster = serving.get("poster");
    assert_eq!((poster.status, poster.header("content-type")), (200, Some("image/png")));
    let served = dir.path().join("served.png");
    std::fs::write(&served, poster.body).unwrap();
    let pixels = |path: &Path| particlegs::picture::read_png(path).unwrap();
    assert!(pixels(&served) == pixels(&picture));
}

#[test]
fn names_cannot_break_the_page() {
    let dir = tempfile::tempdir().unwrap();
    let [model, _] = subjects(dir.path());
    let name = "<img src=x onerror=alert(1)> \"' & <!--<script> \u{202e}ü.pgs";
    let hostile = dir.path().join(name);
    std::fs::copy(model, &hostile).unwrap();
    let serving = Serving::of(&hostile);
    let page = serving.get("");
    let html = page.text();
    assert!(!html.contains("<img src=x") && !html.contains("<!--<script>"), "{html}");
    let setup = html.split("id=\"setup\">").nth(1).unwrap().split("</script>").next().unwrap();
    assert_eq!(serde_json::from_str::<Value>(setup).unwrap()["models"][0]["name"], name);
    assert_eq!(serving.get("model/0").status, 200);
}

#[test]
fn what_cannot_be_shown_is_said_before_anything_is_served() {
    let dir = tempfile::tempdir().unwrap();
    let [model, particles] = subjects(dir.path());
    let view = || {
        let mut c = particlegs();
        c.args(["view", "--no-open", "--port", "0"]).env_remove("PARTICLEGS_TOKEN");
        c
    };
    let mut bytes = std::fs::read(&model).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    let corrupt = dir.path().join("corrupt.pgs");
    std::fs::write(&corrupt, &bytes).unwrap();
    fails(view().arg(&model).arg(&corrupt), 4, "corrupt.pgs");
    fails(view().arg(dir.path().join("missing.pgs")), 6, "missing.pgs");
    fails(view().arg(&particles), 3, "not a model file");
    fails(view().arg(&model).arg("--snapshot").arg(dir.path().join("nowhere")), 6, "nowhere");
    fails(view().arg(&model).args(["--every", "2"]), 2, "--every does nothing here");
    fails(view().arg(&model).env("PARTICLEGS_TOKEN", "secret"), 2, "PARTICLEGS_TOKEN: a token is 32 to 256 letters");
    fails(view().arg(&model).args(["--host", "192.0.2.1"]), 2, "cannot listen at 192.0.2.1");
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let mut c = particlegs();
    fails(
        c.args(["view", "--no-open", "--port", &port]).arg(&model),
        2,
        &format!("cannot listen at 127.0.0.1, port {port}"),
    );
}

#[test]
fn it_says_where_the_page_is() {
    let dir = tempfile::tempdir().unwrap();
    let [model, _] = subjects(dir.path());
    let chosen = "0123456789abcdefABCDEF0123456789";
    let report = dir.path().join("view.json");
    let serving = Serving::new(|c| {
        c.arg(&model).arg("--json").arg(&report).env("PARTICLEGS_TOKEN", chosen).env("USER", "ada");
        c.env("SSH_CONNECTION", "203.0.113.9 51022 127.0.0.1 22")
    });
    let port = serving.parts().0.rsplit(':').next().unwrap().to_string();
    assert_eq!(serving.url, format!("http://127.0.0.1:{port}/{chosen}/"));
    let report: Value = serde_json::from_slice(&std::fs::read(&report).unwrap()).unwrap();
    let ssh = format!("ssh -L {port}:127.0.0.1:{port} ada@127.0.0.1");
    assert_eq!((&report["url"], &report["ssh"]), (&json!(serving.url), &json!(ssh)));
    assert_eq!((&report["token"], report["port"].to_string()), (&json!(chosen), port));
    assert_eq!(report["models"], json!([{"name": "spiral.pgs", "gaussians": 40}]));
    let (_, out, _) = serving.end("-INT");
    assert!(out.lines().any(|l| l == ssh), "{out}");
}

#[test]
fn other_machines_are_let_in_with_a_warning_and_proxies_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let [model, _] = subjects(dir.path());
    let serving = Serving::new(|c| c.arg(&model).args(["--host", "0.0.0.0", "--allow-host", "hub.example.org"]));
    // The address to open is one of this machine.
    assert!(serving.url.starts_with("http://127.0.0.1:"), "{}", serving.url);
    for (host, origin, status) in [
        ("hub.example.org", "https://hub.example.org", 200),
        ("192.0.2.17:8317", "https://hub.example.org", 200),
        ("192.0.2.17:8317", "http://192.0.2.17:8317", 200),
        ("192.0.2.17:8317", "http://192.0.2.18:8317", 403),
        ("evil.example", "https://hub.example.org", 403),
    ] {
        let answer = serving.ask("GET", "", &format!("Host: {host}\r\nOrigin: {origin}\r\n"), b"");
        assert_eq!(answer.status, status, "{host} {origin}");
    }
    let (code, _, said) = serving.end("-INT");
    assert_eq!(code, Some(0));
    assert!(said.starts_with("warning: --host 0.0.0.0: other machines can reach the page"), "{said}");
}
