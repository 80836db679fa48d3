//! The engine's responses.

use particlegs_core::Result;
use serde::Serialize;

/// JSON and numbers. As bytes: u32 length of the JSON, the JSON, padding to a multiple of 8, the numbers. An error is
/// the JSON `{"error": "one line"}` without numbers.
#[derive(Debug)]
pub struct EngineResponse {
    pub json: String,
    pub numbers: Vec<u8>,
}

impl EngineResponse {
    /// `json` without numbers.
    pub(crate) fn new(json: &impl Serialize) -> Result<EngineResponse> {
        EngineResponse::with(json, Vec::new())
    }

    /// `json` and numbers.
    pub(crate) fn with(json: &impl Serialize, numbers: Vec<u8>) -> Result<EngineResponse> {
        let json = serde_json::to_string(json).map_err(|e| particlegs_core::Error::argument(e.to_string()))?;
        Ok(EngineResponse { json, numbers })
    }

    /// The response, or the error as JSON.
    pub(crate) fn or_error(result: Result<EngineResponse>) -> EngineResponse {
        result.unwrap_or_else(|error| {
            let json = serde_json::json!({ "error": error.to_string() }).to_string();
            EngineResponse { json, numbers: Vec::new() }
        })
    }

    pub fn into_bytes(self) -> Vec<u8> {
        let start = (4 + self.json.len()).next_multiple_of(8);
        let mut bytes = Vec::with_capacity(start + self.numbers.len());
        bytes.extend((self.json.len() as u32).to_le_bytes());
        bytes.extend(self.json.as_bytes());
        bytes.resize(start, 0);
        bytes.extend(self.numbers);
        bytes
    }
}
