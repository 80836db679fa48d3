//! `view` as browsers and intruders see it.

mod refused;
mod serving;
mod truth;

use crate::common::{TestFolder, fails, spiral, waited};
use particlegs_core::picture::{Plane, Size};
use serde_json::{Value, json};
use serving::TestServer;

#[test]
fn the_page_and_its_files_are_served() {
    let dir = spiral();
    let bytes = dir.bytes("spiral.pgs");
    let serving = TestServer::new(&dir, |c| c.args(["spiral.pgs", "spiral.pgs", "--snapshot", "spiral"]));
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
    assert_eq!(
        setup["truth"],
        json!({"url": "truth", "name": "spiral", "particles": 3000, "density_of": "particles", "smoothed": 32})
    );
    assert_eq!((&setup["served"], &setup["engine"]["url"]), (&json!(true), &json!("engine")));
    for place in ["model/0", "model/1"] {
        let answer = serving.get(place);
        assert!(answer.status == 200 && answer.body == bytes, "{place}");
    }
    // A header without a body, with the same length.
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
    // Without its slash the address redirects to the page, with a relative path.
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
    let dir = TestFolder::new();
    dir.runs("compress SAMPLE --gaussians 101000 --effort fast --certificate=none --quiet -o large.pgs");
    let draw = |more: &str| {
        dir.runs(&format!("render large.pgs --style density --size 1280x720 --quiet {more}"));
    };
    // The page's initial range.
    draw("--raw -o values");
    let values = dir.bytes("values/view.f32");
    let values = values.chunks_exact(4).map(|v| f32::from_le_bytes(v.try_into().unwrap())).collect();
    let plane = Plane { size: Size { width: 1280, height: 720 }, data: values };
    let [low, high] = plane.first_range().unwrap();
    draw(&format!("--no-annotations --range {low},{high} -o large.png"));
    let serving = TestServer::new(&dir, |c| c.arg("large.pgs"));
    assert!(serving.get("").text().contains("<img id=\"poster\" alt=\"large.pgs\" src=\"poster\">"));
    let poster = serving.get("poster");
    assert_eq!((poster.status, poster.header("content-type")), (200, Some("image/png")));
    dir.write("served.png", poster.body);
    let pixels = |name: &str| particlegs_files::png::read_png(&dir.at(name)).unwrap();
    assert!(pixels("served.png") == pixels("large.png"));
}

#[test]
fn impossible_views_are_refused_before_the_page_is_served() {
    let dir = spiral();
    let mut bytes = dir.bytes("spiral.pgs");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    dir.write("corrupt.pgs", &bytes);
    for unit in ["nm", "Angstrom"] {
        let options = "--gaussians 4 --effort fast --certificate none --quiet";
        dir.runs(&format!("compress spiral -o {unit}.pgs --length-unit {unit} {options}"));
    }
    dir.write("list.csv", "x,y,z,radius\n0,0,0,1\n");
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let at = format!("cannot listen at 127.0.0.1, port {port}");
    for (words, code, text) in [
        ("spiral.pgs corrupt.pgs", 4, "corrupt.pgs"),
        ("missing.pgs", 6, "missing.pgs"),
        ("spiral", 3, "not a model file"),
        ("spiral.pgs --snapshot nowhere", 6, "nowhere"),
        ("spiral.pgs --every 2", 2, "--every has no effect here"),
        ("spiral.pgs --allow-host https://hub.example.org", 2, "is not the name of a host"),
        ("nm.pgs Angstrom.pgs --overlay list.csv", 2, "these have different units of length"),
        ("spiral.pgs --host 192.0.2.1", 2, "cannot listen at 192.0.2.1"),
    ] {
        let words = format!("view --no-open --port 0 {words}");
        fails(dir.command(&words).env_remove("PARTICLEGS_TOKEN"), code, text);
    }
    let mut secret = dir.command("view --no-open --port 0 spiral.pgs");
    fails(secret.env("PARTICLEGS_TOKEN", "secret"), 2, "PARTICLEGS_TOKEN: a token is 32 to 256 letters");
    dir.fails(&format!("view --no-open --port {port} spiral.pgs"), 2, &at);
}

#[test]
fn the_address_of_the_page_is_printed() {
    let dir = spiral();
    let token = "0123456789abcdefABCDEF0123456789";
    let serving = TestServer::new(&dir, |c| {
        c.args(["spiral.pgs", "--json", "view.json"]).env("PARTICLEGS_TOKEN", token).env("USER", "ada");
        c.env("SSH_CONNECTION", "203.0.113.9 51022 127.0.0.1 22")
    });
    let port = serving.parts().0.rsplit(':').next().unwrap().to_string();
    assert_eq!(serving.url, format!("http://127.0.0.1:{port}/{token}/"));
    let report = dir.json("view.json");
    let ssh = format!("ssh -L {port}:127.0.0.1:{port} ada@127.0.0.1");
    assert_eq!((&report["url"], &report["ssh"]), (&json!(serving.url), &json!(ssh)));
    assert_eq!((&report["token"], report["port"].to_string()), (&json!(token), port));
    assert_eq!(report["models"], json!([{"name": "spiral.pgs", "gaussians": 40}]));
    let (_, out, _) = serving.end("-INT");
    assert!(out.lines().any(|l| l == ssh), "{out}");
}

#[test]
fn other_machines_are_let_in_with_a_warning_and_proxies_by_name() {
    let dir = spiral();
    let serving =
        TestServer::new(&dir, |c| c.args(["spiral.pgs", "--host", "0.0.0.0", "--allow-host", "hub.example.org"]));
    // The address to open is on this machine.
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

/// A browser is started if there is a display, with a one-time address.
#[test]
#[cfg(target_os = "linux")]
fn a_browser_is_started_with_a_one_time_address() {
    use std::os::unix::fs::PermissionsExt;
    let dir = spiral();
    let (browser, opened) = (dir.at("xdg-open"), dir.at("opened"));
    let script = format!("#!/bin/sh\nprintf %s \"$1\" > '{0}.part' && mv '{0}.part' '{0}'\n", opened.display());
    std::fs::write(&browser, script).unwrap();
    std::fs::set_permissions(&browser, std::fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!("{}:{}", dir.path().display(), std::env::var("PATH").unwrap());
    let serving = TestServer::new(&dir, |c| c.arg("spiral.pgs").env("PATH", &path).env("DISPLAY", ":7"));
    waited("the browser", || opened.exists());
    let once = std::fs::read_to_string(&opened).unwrap();
    let (host, token) = serving.parts();
    let way = once.strip_prefix(&format!("http://{host}")).unwrap_or_else(|| panic!("{once}"));
    assert!(!once.contains(token.trim_matches('/')), "{once}");
    let get = || serving.raw(format!("GET {way} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").as_bytes());
    let first = get();
    assert_eq!((first.status, first.header("location")), (303, Some(&token[1..])));
    assert_eq!(get().status, 404);
    // No browser in an SSH session or with --no-open.
    for (name, value, argument) in
        [("SSH_CONNECTION", "203.0.113.9 1 127.0.0.1 22", "--quiet"), ("A", "b", "--no-open")]
    {
        std::fs::remove_file(&opened).unwrap_or_default();
        let serving = TestServer::new(&dir, |c| {
            c.args(["spiral.pgs", argument]).env(name, value).env("PATH", &path).env("DISPLAY", ":7")
        });
        assert_eq!(serving.get("").status, 200);
        assert_eq!(serving.end("-INT").0, Some(0));
        assert!(!opened.exists(), "{name}");
    }
}
