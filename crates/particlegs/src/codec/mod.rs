//! Floor 3: mixture to bytes and back (docs/format.md).
