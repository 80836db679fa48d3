//! `--certificate`: how much of a decoded model is measured.

use crate::common::named;
use clap::Args;
use particlegs::model::CertificateLevel;

#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct CertificateArgs {
    /// How much of the decoded model is measured and stored in the file.
    #[arg(long, value_name = "LEVEL", default_value = "quick", value_parser = named::<CertificateLevel>())]
    certificate: CertificateLevel,
}

impl CertificateArgs {
    pub fn level(&self) -> CertificateLevel {
        self.certificate
    }
}
