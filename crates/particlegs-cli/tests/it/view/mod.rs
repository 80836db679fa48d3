//! `view` as a browser meets it, and as others do who should not.

mod refused;
mod serving;
mod truth;

use crate::common::{fails, particlegs, sample, waited};
use particlegs::picture::{Plane, Size};
use serde_json::{Value, json};
use serving::{TestServer, subjects};
use std::path::Path;

#[test]
fn the_page_and_all_that_it_needs_are_served() {
    let dir = tempfile::tempdir().unwrap();
    let [model, particles] = subjects(dir.path());
    let bytes = std::fs::read(&model).unwrap();
    let serving = TestServer::new(|c| c.arg(&model).arg(&model).arg("--snapshot").arg(&particles));
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
    assert_eq!(setup["truth"], json!({"url": "truth", "name": "spiral", "particles": 3000, "smoothed": 32}));
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

/// The poster of a large model is the density that `render` draws of the first view.
#[test]
#[ignore = "slow"]
fn a_large_model_has_a_poster() {
    let dir = tempfile::tempdir().unwrap();
    let (model, picture) = (dir.path().join("large.pgs"), dir.path().join("large.png"));
    let made = ["--gaussians", "101000", "--effort", "fast", "--certificate=none", "--quiet"];
    particlegs().arg("compress").arg(sample()).args(made).arg("-o").arg(&model).assert().success();
    let drawn = |more: &[&str], out: &Path| {
        let density = ["--style", "density", "--size", "1280x720", "--quiet"];
        particlegs().arg("render").arg(&model).args(density).args(more).arg("-o").arg(out).assert().success();
    };
    // The page's first range, of the values.
    drawn(&["--raw"], &dir.path().join("values"));
    let values = std::fs::read(dir.path().join("values/view.f32")).unwrap();
    let values = values.chunks_exact(4).map(|v| f32::from_le_bytes(v.try_into().unwrap())).collect();
    let plane = Plane { size: Size { width: 1280, height: 720 }, data: values };
    let [low, high] = plane.first_range().unwrap();
    drawn(&["--no-annotations", "--range", &format!("{low},{high}")], &picture);
    let serving = TestServer::of(&model);
    assert!(serving.get("").text().contains("<img id=\"poster\" alt=\"large.pgs\" src=\"poster\">"));
    let poster = serving.get("poster");
    assert_eq!((poster.status, poster.header("content-type")), (200, Some("image/png")));
    let served = dir.path().join("served.png");
    std::fs::write(&served, poster.body).unwrap();
    let pixels = |path: &Path| particlegs::picture::read_png(path).unwrap();
    assert!(pixels(&served) == pixels(&picture));
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
    fails(view().arg(&model).args(["--allow-host", "https://hub.example.org"]), 2, "is not the name of a host");
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
    let serving = TestServer::new(|c| {
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
    let serving = TestServer::new(|c| c.arg(&model).args(["--host", "0.0.0.0", "--allow-host", "hub.example.org"]));
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

/// A browser is started where it can appear, with an address that leads to the page once.
#[test]
#[cfg(target_os = "linux")]
fn a_browser_is_started_by_a_way_for_once() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().unwrap();
    let [model, _] = subjects(dir.path());
    let (browser, opened) = (dir.path().join("xdg-open"), dir.path().join("opened"));
    let script = format!("#!/bin/sh\nprintf %s \"$1\" > '{0}.part' && mv '{0}.part' '{0}'\n", opened.display());
    std::fs::write(&browser, script).unwrap();
    std::fs::set_permissions(&browser, std::fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!("{}:{}", dir.path().display(), std::env::var("PATH").unwrap());
    let serving = TestServer::new(|c| c.arg(&model).env("PATH", &path).env("DISPLAY", ":7"));
    waited("the browser", || opened.exists());
    let once = std::fs::read_to_string(&opened).unwrap();
    let (host, token) = serving.parts();
    let way = once.strip_prefix(&format!("http://{host}")).unwrap_or_else(|| panic!("{once}"));
    assert!(!once.contains(token.trim_matches('/')), "{once}");
    let get = || serving.raw(format!("GET {way} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").as_bytes());
    let first = get();
    assert_eq!((first.status, first.header("location")), (303, Some(&token[1..])));
    assert_eq!(get().status, 404);
    // None in an SSH session, nor where it is not wanted.
    for (name, value, argument) in
        [("SSH_CONNECTION", "203.0.113.9 1 127.0.0.1 22", "--quiet"), ("A", "b", "--no-open")]
    {
        std::fs::remove_file(&opened).unwrap_or_default();
        let serving =
            TestServer::new(|c| c.arg(&model).arg(argument).env(name, value).env("PATH", &path).env("DISPLAY", ":7"));
        assert_eq!(serving.get("").status, 200);
        assert_eq!(serving.end("-INT").0, Some(0));
        assert!(!opened.exists(), "{name}");
    }
}
