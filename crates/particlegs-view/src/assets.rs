//! The built parts of the page, committed in `assets/`.

pub const STYLE: &str = include_str!("../assets/viewer.css");
pub const SCRIPT: &str = include_str!("../assets/viewer.js");
/// SHA-256 of style sheet and script, base64, for the page's security policy.
pub const STYLE_HASH: &str = include_str!("../assets/viewer.css.sha256");
pub const SCRIPT_HASH: &str = include_str!("../assets/viewer.js.sha256");
/// The source of the worker that decodes and draws: a page from disk can start a worker only from a Blob.
pub const WORKER: &str = include_str!("../assets/worker.js");
/// The engine, compiled to WebAssembly and compressed by gzip.
pub const ENGINE: &[u8] = include_bytes!("../assets/engine.wasm.gz");

#[cfg(test)]
mod tests {
    use super::*;
    use crate::markup;
    use flate2::read::GzDecoder;
    use std::io::Read;

    /// The parts are not escaped: none may end its element, begin a comment or another script, or be changed by a
    /// browser before it is hashed.
    #[test]
    fn every_part_can_stand_inside_its_element() {
        for (name, text) in [("viewer.css", STYLE), ("viewer.js", SCRIPT), ("worker.js", WORKER)] {
            assert!(markup::can_stand_inside(text), "{name}");
        }
    }

    #[test]
    fn the_engine_is_webassembly() {
        let mut engine = Vec::new();
        GzDecoder::new(ENGINE).read_to_end(&mut engine).unwrap();
        assert_eq!(engine[..8], *b"\0asm\x01\0\0\0");
    }
}
