//! BLAKE3: of bytes by all threads, and as text.

pub(crate) fn update(hasher: &mut blake3::Hasher, bytes: &[u8]) {
    #[cfg(feature = "threads")]
    hasher.update_rayon(bytes);
    #[cfg(not(feature = "threads"))]
    hasher.update(bytes);
}

/// A hash as text: 64 hexadecimal digits.
pub fn hex(hash: &[u8; 32]) -> String {
    blake3::Hash::from_bytes(*hash).to_hex().to_string()
}

/// [`hex`] in serde's terms.
pub(crate) mod hexadecimal {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(hash: &[u8; 32], to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(&super::hex(hash))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<[u8; 32], D::Error> {
        let hash = blake3::Hash::from_hex(String::deserialize(from)?).map_err(D::Error::custom)?;
        Ok(*hash.as_bytes())
    }
}
