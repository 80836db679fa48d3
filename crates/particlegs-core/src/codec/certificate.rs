//! The certificate's section: its tagged groups of figures (docs/format.md, section 3). `model` declares the figures.

use super::wire::WireReader;
use crate::model::{
    Certificate, CertificateLevel, Coding, Metric, MetricField, MetricGroup, MetricValue, MetricVisitor, PictureScore,
};
use std::convert::Infallible;

/// Steps of a decibel, and of SSIM.
const PER_DECIBEL: f64 = 200.0;
const PER_SSIM: f64 = 32_767.0;
/// Stands for an [`Coding::OptionalF32`] that there is none of.
const NONE: f32 = -2.0;
/// Stand for a limit that was not measured, and for nowhere.
const NOT_MEASURED: f32 = -1.0;
const NEVER: f32 = 0.0;

pub(super) fn write(c: &Certificate) -> Vec<u8> {
    encoded(c, &|_, is_present| is_present)
}

/// A certificate as a file has it, in the digits that it keeps.
pub fn rounded(c: &Certificate) -> Certificate {
    read(&write(c)).unwrap_or(*c)
}

/// Bytes of the section at a level, with the groups that `like` has as well.
pub(super) fn size(level: CertificateLevel, like: &Certificate) -> usize {
    encoded(like, &|group, is_present| is_present || group.levels.contains(&level)).len()
}

fn encoded(c: &Certificate, wanted: &dyn Fn(&MetricGroup, bool) -> bool) -> Vec<u8> {
    let mut encoder = CertificateEncoder { out: Vec::new(), start: 0, wanted };
    let mut certificate = *c;
    let Ok(()) = certificate.visit("", &mut encoder);
    encoder.out
}

/// Reads the section. Groups of unknown tags are skipped.
pub(super) fn read(bytes: &[u8]) -> Result<Certificate, String> {
    let (mut r, mut groups) = (WireReader::new(bytes), Vec::new());
    let mut last = 0;
    while !r.is_done() {
        let tag = r.u8()?;
        if tag <= last {
            return Err(format!("group {tag} of the certificate follows group {last}"));
        }
        let length = usize::from(r.u16()?);
        groups.push((tag, r.take(length)?));
        last = tag;
    }
    let (mut certificate, mut decoder) =
        (Certificate::default(), CertificateDecoder { groups, left: WireReader::new(&[]) });
    certificate.visit("", &mut decoder)?;
    Ok(certificate)
}

struct CertificateEncoder<'a> {
    out: Vec<u8>,
    /// Start of the group's value in `out`.
    start: usize,
    wanted: &'a dyn Fn(&MetricGroup, bool) -> bool,
}

impl MetricVisitor for CertificateEncoder<'_> {
    type Error = Infallible;

    fn begin(&mut self, group: &MetricGroup, is_present: bool) -> Result<bool, Infallible> {
        let is_wanted = (self.wanted)(group, is_present);
        if is_wanted {
            self.out.extend([group.tag, 0, 0]);
            self.start = self.out.len();
        }
        Ok(is_wanted)
    }

    fn end(&mut self, _: &MetricGroup) -> Result<(), Infallible> {
        let length = (self.out.len() - self.start) as u16;
        self.out[self.start - 2..self.start].copy_from_slice(&length.to_le_bytes());
        Ok(())
    }

    fn metric(&mut self, metric: &Metric, value: MetricValue) -> Result<MetricValue, Infallible> {
        let short = |v: f64| (v as f32).to_le_bytes();
        let (real, count) = match value {
            MetricValue::Real(v) => (v, v as u64),
            MetricValue::Count(n) => (n as f64, n),
            _ => (0.0, 0),
        };
        match metric.coding {
            // The largest that is held stands for itself and all above.
            Coding::Whole(bytes) => {
                let most = u64::MAX >> (64 - 8 * bytes);
                self.out.extend(&count.min(most).to_le_bytes()[..bytes]);
            }
            Coding::Name(_) => self.out.push(count as u8),
            Coding::F32 => self.out.extend(short(real)),
            Coding::F64 => self.out.extend(real.to_le_bytes()),
            Coding::OptionalF32 => {
                self.out.extend(if value == MetricValue::None { NONE.to_le_bytes() } else { short(real) })
            }
            Coding::UpTo => self.out.extend(match value {
                MetricValue::None => NOT_MEASURED.to_le_bytes(),
                MetricValue::Never => NEVER.to_le_bytes(),
                // 0 stands for nowhere, so a smaller wave number becomes the least above it.
                _ => (real as f32).max(f32::from_bits(1)).to_le_bytes(),
            }),
            Coding::From => self.out.extend(match value {
                MetricValue::None => u32::MAX.to_le_bytes(),
                MetricValue::Never => [0; 4],
                _ => (real as u32).clamp(1, u32::MAX - 1).to_le_bytes(),
            }),
            Coding::Score => {
                let score = if let MetricValue::Score(s) = value { Some(s) } else { None };
                // The largest that is not none stands for itself and all above.
                let decibels = |v: f64| (v * PER_DECIBEL).round().clamp(0.0, f64::from(u16::MAX - 1)) as u16;
                let similarity = |v: f64| (v * PER_SSIM).round().clamp(-PER_SSIM, PER_SSIM) as i16;
                self.out.extend(score.and_then(|s| s.masked_psnr).map_or(u16::MAX, decibels).to_le_bytes());
                self.out.extend(score.map_or(i16::MIN, |s| similarity(s.ssim)).to_le_bytes());
            }
        }
        Ok(value)
    }
}

struct CertificateDecoder<'a> {
    groups: Vec<(u8, &'a [u8])>,
    /// Rest of the group that is read.
    left: WireReader<'a>,
}

impl MetricVisitor for CertificateDecoder<'_> {
    type Error = String;

    fn begin(&mut self, group: &MetricGroup, _: bool) -> Result<bool, String> {
        let stored_group = self.groups.iter().find(|g| g.0 == group.tag);
        // Groups that must be there are visited all the same: without bytes their first figure is missing.
        self.left = WireReader::new(stored_group.map_or(&[], |g| g.1));
        Ok(stored_group.is_some())
    }

    fn end(&mut self, group: &MetricGroup) -> Result<(), String> {
        if self.left.is_done() { Ok(()) } else { Err(format!("group {} of the certificate is too long", group.tag)) }
    }

    fn more(&mut self, _: bool) -> bool {
        !self.left.is_done()
    }

    fn agree(&mut self, check: impl FnOnce() -> Result<(), String>) -> Result<(), String> {
        check()
    }

    fn metric(&mut self, metric: &Metric, _: MetricValue) -> Result<MetricValue, String> {
        let r = &mut self.left;
        let value = match metric.coding {
            Coding::Whole(bytes) => {
                let mut number = [0; 8];
                number[..bytes].copy_from_slice(r.take(bytes)?);
                MetricValue::Count(u64::from_le_bytes(number))
            }
            Coding::Name(_) => MetricValue::Count(u64::from(r.u8()?)),
            Coding::F32 => MetricValue::Real(f64::from(r.f32()?)),
            Coding::F64 => MetricValue::Real(r.f64()?),
            Coding::OptionalF32 => match r.f32()? {
                NONE => MetricValue::None,
                v => MetricValue::Real(f64::from(v)),
            },
            Coding::UpTo => match r.f32()? {
                NOT_MEASURED => MetricValue::None,
                NEVER => MetricValue::Never,
                k => MetricValue::Real(f64::from(k)),
            },
            Coding::From => match r.u32()? {
                u32::MAX => MetricValue::None,
                0 => MetricValue::Never,
                n => MetricValue::Real(f64::from(n)),
            },
            Coding::Score => match (r.u16()?, r.u16()? as i16) {
                (u16::MAX, i16::MIN) => MetricValue::None,
                (_, i16::MIN) => return Err("a picture that was not drawn has a score".into()),
                (psnr, ssim) => MetricValue::Score(PictureScore {
                    masked_psnr: (psnr != u16::MAX).then(|| f64::from(psnr) / PER_DECIBEL),
                    ssim: f64::from(ssim) / PER_SSIM,
                }),
            },
        };
        let [least, most] = metric.range;
        let in_range = match (value, metric.coding) {
            (MetricValue::Count(n), Coding::Name(names)) => (n as usize) < names.len(),
            (MetricValue::Count(n), _) => n as f64 >= least,
            // Not a number is in no range.
            (MetricValue::Real(v), _) => (least..=most).contains(&v),
            _ => true,
        };
        if in_range { Ok(value) } else { Err(format!("the certificate value `{}` is invalid: {value:?}", metric.name)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{LayerRatios, Limit, MassPower, Sample};
    use crate::space::Bounds;
    use proptest::prelude::*;

    /// Values that the file holds, from a stream of random bytes: decoded figure by figure, again until one is held.
    struct RandomFigures {
        state: u64,
        groups: bool,
    }

    impl RandomFigures {
        fn next(&mut self) -> u64 {
            self.state = self.state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            self.state ^ self.state >> 29
        }
    }

    impl MetricVisitor for RandomFigures {
        type Error = Infallible;

        fn begin(&mut self, _: &MetricGroup, _: bool) -> Result<bool, Infallible> {
            Ok(self.groups || self.next() & 1 == 0)
        }

        fn more(&mut self, _: bool) -> bool {
            self.groups
        }

        fn metric(&mut self, metric: &Metric, _: MetricValue) -> Result<MetricValue, Infallible> {
            let special = self.next() % 4;
            loop {
                let bytes = match (special, metric.coding) {
                    // What stands for none, nowhere, not measured, or 1.
                    (0, Coding::OptionalF32) => [NONE.to_le_bytes(), [0; 4]].concat(),
                    (0, Coding::UpTo) => [NEVER.to_le_bytes(), [0; 4]].concat(),
                    (1, Coding::UpTo) => [NOT_MEASURED.to_le_bytes(), [0; 4]].concat(),
                    (0, Coding::Score) => vec![255, 255, 0, 128],
                    (_, Coding::Name(_)) => vec![(self.next() % 2) as u8],
                    _ => self.next().to_le_bytes().into(),
                };
                let mut decoder = CertificateDecoder { groups: Vec::new(), left: WireReader::new(&bytes) };
                if let Ok(value) = decoder.metric(metric, MetricValue::None) {
                    return Ok(value);
                }
            }
        }
    }

    /// A certificate of random figures; with every group, or some.
    fn random(seed: u64, groups: bool) -> Certificate {
        let mut c = Certificate::default();
        let Ok(()) = c.visit("", &mut RandomFigures { state: seed, groups });
        agreed(&mut c);
        c
    }

    /// Has figures say of each other what they can.
    fn agreed(c: &mut Certificate) {
        let itself = Some(PictureScore { masked_psnr: None, ssim: 1.0 });
        let some = |s: Option<PictureScore>| {
            let s = s.unwrap_or_default();
            Some(PictureScore { masked_psnr: s.masked_psnr.map(|v| v.min(90.0)), ..s })
        };
        (c.views.width, c.views.height) = (1920, 1080);
        for o in &mut c.views.orbits {
            for s in [&mut o.paraview, &mut o.paraview_no_fxaa, &mut o.expected] {
                (s.model, s.noise_free) = (some(s.model), some(s.noise_free));
                (s.all_black, s.uniform_box) = (some(s.all_black), some(s.uniform_box));
                s.subset = c.subset.and(some(s.subset));
            }
            o.expected.noise_free = itself;
            if c.blocks.is_some() {
                (o.paraview, o.paraview_no_fxaa) = Default::default();
            }
        }
        for s in c.pictures.iter_mut().flat_map(|p| &mut p.settings) {
            (s.expected.mean.noise_free, s.expected.worst.noise_free) = (itself, itself);
        }
        if let Some([a, b, c]) = &mut c.densities {
            (a.edge, a.particles) = (3.125, 5.5);
            (b.edge, b.particles, c.edge, c.particles) = (6.25, 44.0, 12.5, 352.0);
        }
        if let Some(s) = &mut c.science {
            s.k_max = f64::from(f32::MAX);
            (s.power_within_1_percent_to, s.r_above_0_99_to) = (s.power_within_5_percent_to, s.r_above_0_9_to);
            s.groups_within_10_percent_from = Limit::At(57.0);
        }
        for g in c.groups.iter_mut().flatten() {
            g.groups = g.groups.max(1);
            (g.number, g.completeness, g.mass) = (g.number.or(Some(1.0)), Some(0.75), g.mass.or(Some(1.0)));
            g.number_scatter = g.number.unwrap_or(0.0);
        }
        c.drawn_densities = c.drawn_densities.filter(|_| c.densities.is_some());
        for t in c.held_out.iter_mut().flat_map(|h| &mut h.transfer) {
            t.deviation = t.deviation.or(Some(0.25));
        }
        if let Some(Sample { bounds: Bounds { min, max }, .. }) = &mut c.sample {
            (0..3).for_each(|k| (min[k], max[k]) = (min[k].min(max[k]), min[k].max(max[k])));
        }
    }

    #[test]
    fn sizes_are_those_of_what_is_written() {
        let none = Certificate::default();
        let size = |level| size(level, &none);
        let mut full = Certificate {
            mass_power: None,
            sample: None,
            blocks: None,
            goal: None,
            layer_ratios: None,
            fields: None,
            ..random(1, true)
        };
        agreed(&mut full);
        let quick = Certificate { groups: None, held_out: None, pictures: None, ..full };
        let blocks = Certificate { spacing: None, subset: None, drawn_densities: None, blocks: Some(3), ..quick };
        for (level, c) in [(CertificateLevel::Full, full), (CertificateLevel::Quick, quick)] {
            assert_eq!(size(level), write(&c).len());
        }
        assert_eq!(size(CertificateLevel::Blocks), write(&blocks).len());
        // They are a part of small files.
        assert!(size(CertificateLevel::Quick) <= 416 && size(CertificateLevel::Full) <= 1216);
        let sample = Some(Sample::default());
        let large =
            Certificate { sample, mass_power: Some(MassPower::new(2)), layer_ratios: LayerRatios::new(2), ..none };
        let beside = 3 + 56 + 3 + 3 * 8 + 3 + 28;
        assert_eq!(super::size(CertificateLevel::Full, &large), size(CertificateLevel::Full) + beside);
    }

    #[test]
    fn rounded_to_their_steps_figures_come_back() {
        let mut c = random(7, true);
        let score = PictureScore { masked_psnr: Some(31.234_56), ssim: -0.1 };
        c.views.orbits[2].expected.model = Some(score);
        c.pictures.as_mut().unwrap().settings[0].paraview.mean.model =
            Some(PictureScore { masked_psnr: Some(1e9), ssim: 1.5 });
        c.density.correlation = 0.999;
        let science = c.science.as_mut().unwrap();
        (science.r_above_0_99_to, science.r_above_0_9_to) = (Limit::Never, Limit::At(1e-60));
        let decoded = read(&write(&c)).unwrap();
        let decoded_score = decoded.views.orbits[2].expected.model.unwrap();
        assert!(
            (decoded_score.masked_psnr.unwrap() - 31.234_56).abs() <= 0.0025 && (decoded_score.ssim + 0.1).abs() < 2e-5
        );
        let best = PictureScore { masked_psnr: Some(65_534.0 / 200.0), ssim: 1.0 };
        assert_eq!(decoded.pictures.unwrap().settings[0].paraview.mean.model, Some(best));
        assert_eq!(decoded.density.correlation, f64::from(0.999f32));
        assert_eq!(decoded.science.unwrap().r_above_0_9_to, Limit::At(f64::from(f32::from_bits(1))));
        assert_eq!(write(&decoded), write(&c));
    }

    #[test]
    fn groups_are_checked() {
        let whole = write(&random(3, true));
        // A group that is yet to be thought of.
        assert!(read(&[&whole[..], &[200, 2, 0, 7, 7]].concat()).unwrap() == random(3, true));
        // Two of one tag; one that is longer or shorter; none of those that each certificate has.
        assert!(read(&[&whole[..], &whole[..]].concat()).is_err());
        let [mut longer, mut shorter] = [whole.clone(), whole.clone()];
        (longer[1], shorter[1]) = (whole[1] + 1, whole[1] - 1);
        longer.insert(3, 0);
        shorter.remove(3);
        assert!(read(&longer).is_err() && read(&shorter).is_err());
        let first = 3 + usize::from(whole[1]);
        assert!(read(&whole[first..]).is_err() && read(&whole[..first]).is_err() && read(&[]).is_err());
    }

    #[test]
    fn contradictions_are_refused() {
        let refused = |change: &dyn Fn(&mut Certificate)| {
            let mut c = random(5, true);
            change(&mut c);
            assert!(read(&write(&c)).is_err(), "{c:?}");
        };
        refused(&|c| c.density.correlation = f64::NAN);
        refused(&|c| c.density.correlation = 1.5);
        refused(&|c| c.density.mean_absolute_error = -0.5);
        refused(&|c| c.densities.as_mut().unwrap()[1].edge = 0.0);
        refused(&|c| c.spacing.as_mut().unwrap().median = f64::INFINITY);
        refused(&|c| c.subset.as_mut().unwrap().kept = 0);
        refused(&|c| c.sample.as_mut().unwrap().particles = 0);
        refused(&|c| c.sample.as_mut().unwrap().bounds.min[1] = f64::MAX);
        refused(&|c| c.pictures.as_mut().unwrap().settings[6].opacity = 1.5);
        refused(&|c| c.pictures.as_mut().unwrap().settings[0].paraview.worst_view = 3);
        refused(&|c| {
            let s = c.science.as_mut().unwrap();
            (s.k_max, s.r_above_0_9_to) = (8.0, Limit::At(8.5));
        });
        refused(&|c| c.science.as_mut().unwrap().power_within_5_percent_to = Limit::Never);
        refused(&|c| c.science.as_mut().unwrap().r_above_0_99_to = Limit::At(f64::from(f32::MAX)));
        refused(&|c| c.science.as_mut().unwrap().groups_within_10_percent_from = Limit::At(2.0));
        refused(&|c| c.densities.as_mut().unwrap()[0].edge = 0.001);
        refused(&|c| c.densities.as_mut().unwrap()[0].particles = 0.0);
        refused(&|c| c.densities.as_mut().unwrap()[2].mean_absolute_error = 3.0);
        refused(&|c| c.spacing.as_mut().unwrap().drawn_regularity = 1.5);
        refused(&|c| c.groups.as_mut().unwrap()[2].completeness = None);
        refused(&|c| c.groups.as_mut().unwrap()[2].purity = Some(1.25));
        refused(&|c| c.groups.as_mut().unwrap()[2].number_scatter = f64::from(f32::MAX));
        refused(&|c| c.groups.as_mut().unwrap()[2].groups = 0);
        refused(&|c| c.held_out.as_mut().unwrap().transfer[3].deviation = None);
        refused(&|c| c.views.orbits[0].expected.model = None);
        refused(&|c| c.views.orbits[0].expected.subset = None);
        refused(&|c| c.views.orbits[0].expected.noise_free = c.views.orbits[0].expected.model);
        refused(&|c| c.views.width = 0);
        refused(&|c| c.subset = None);
        refused(&|c| c.densities = None);
        refused(&|c| c.drawn_densities.as_mut().unwrap()[0].correlation = -1.5);
        // With all groups it is of blocks: no picture of ParaView's was drawn.
        refused(&|c| c.blocks = None);
        refused(&|c| c.views.orbits[0].expected.model = Some(PictureScore { masked_psnr: Some(120.0), ssim: 0.9 }));
    }

    fn cases(cases: u32) -> ProptestConfig {
        ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
    }

    proptest! {
        #![proptest_config(cases(64))]

        #[test]
        fn any_certificate_comes_back(seed: u64, groups: bool) {
            let c = random(seed, groups);
            prop_assert!(read(&write(&c)).unwrap() == c);
        }
    }

    proptest! {
        #![proptest_config(cases(4))]

        /// Whatever is read writes the same bytes, unknown groups apart.
        #[test]
        fn altered_sections_are_refused_or_valid(seed: u64, groups: bool, cut: prop::sample::Index) {
            let bytes = write(&random(seed, groups));
            for bit in 0..8 * bytes.len() {
                let mut altered = bytes.clone();
                altered[bit / 8] ^= 1 << (bit % 8);
                if let Ok(c) = read(&altered) {
                    prop_assert!(read(&write(&c)).unwrap() == c);
                    prop_assert!(write(&c).len() <= altered.len());
                }
            }
            if let Ok(c) = read(&bytes[..cut.index(bytes.len())]) {
                prop_assert!(write(&c) == bytes[..cut.index(bytes.len())]);
            }
        }
    }
}
