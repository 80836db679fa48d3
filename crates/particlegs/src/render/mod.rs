//! Floor 3: mixture to picture.
