//! Floor 5: evaluation over views, and the certificate.
