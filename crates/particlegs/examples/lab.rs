#![allow(missing_docs, dead_code)]
use particlegs::camera::{read_views, View};
use particlegs::fit::{candidates, em::*, split_merge::*};
use particlegs::math::Sym3;
use particlegs::picture::{read_gray_png, Size};
use particlegs::progress::Silent;
use rayon::prelude::*;
use std::path::Path;
use std::time::Instant;

pub fn cpu() -> f64 {
    let s = std::fs::read_to_string("/proc/self/stat").unwrap();
    let f: Vec<&str> = s[s.rfind(')').unwrap()..].split_whitespace().collect();
    (f[12].parse::<f64>().unwrap() + f[13].parse::<f64>().unwrap()) / 100.0
}

fn erf(x: f32) -> f32 {
    let t = 1.0 / (1.0 + 0.3275911 * x.abs());
    let y = 1.0 - (((((1.061405429 * t - 1.453152027) * t) + 1.421413741) * t - 0.284496736) * t + 0.254829592) * t * (-x * x).exp();
    if x < 0.0 { -y } else { y }
}

fn axis_weights(c: f64, s: f64, out: &mut Vec<f32>) -> i32 {
    let lo = (c - 3.0 * s).floor() as i32;
    let hi = (c + 3.0 * s).floor() as i32;
    out.clear();
    let g = |x: f64| -> f32 { erf(((x / s).clamp(-3.0, 3.0) / std::f64::consts::SQRT_2) as f32) };
    let mut prev = g(lo as f64 - c);
    for p in lo..=hi {
        let next = g((p + 1) as f64 - c);
        out.push((next - prev) * (std::f64::consts::PI / 2.0).sqrt() as f32 * s as f32);
        prev = next;
    }
    lo
}

pub fn truth(xyz: &[[f32; 3]], scale: f64, v: &View, size: Size) -> Vec<f32> {
    let frame = v.camera.frame().unwrap();
    let f = v.camera.focal_pixels(size);
    let clip = v.camera.clipping_range.unwrap_or([0.0, f64::INFINITY]);
    let chunks: Vec<_> = xyz.chunks(xyz.len().div_ceil(2)).collect();
    let parts: Vec<Vec<f32>> = chunks.par_iter().map(|ch| {
        let mut img = vec![0f32; size.pixels()];
        let (mut wx, mut wy) = (vec![], vec![]);
        for p in ch.iter() {
            let c = frame.to_camera(p.map(|q| f64::from(q) * scale));
            let z = -c[2];
            if z < clip[0] || z > clip[1] { continue; }
            let (tx, ty) = (c[0] / z, c[1] / z);
            let (px, py) = (0.5 * size.width as f64 + f * tx, 0.5 * size.height as f64 - f * ty);
            let r = v.radius * f / z;
            let (sx, sy) = (r * (1.0 + tx * tx).sqrt(), r * (1.0 + ty * ty).sqrt());
            if px + 3.0 * sx < 0.0 || py + 3.0 * sy < 0.0 || px - 3.0 * sx >= size.width as f64 || py - 3.0 * sy >= size.height as f64 { continue; }
            let x0 = axis_weights(px, sx, &mut wx);
            let y0 = axis_weights(py, sy, &mut wy);
            for (j, b) in wy.iter().enumerate() {
                let y = y0 + j as i32;
                if y < 0 || y >= size.height as i32 { continue; }
                for (i, a) in wx.iter().enumerate() {
                    let x = x0 + i as i32;
                    if x < 0 || x >= size.width as i32 { continue; }
                    let m = v.opacity as f32 * a * b;
                    img[y as usize * size.width + x as usize] += m + 0.5 * m * m + m * m * m / 3.0;
                }
            }
        }
        img
    }).collect();
    let mut it = parts.into_iter();
    let mut a = it.next().unwrap();
    for b in it { for (x, y) in a.iter_mut().zip(b) { *x += y; } }
    a
}

pub struct Mix { pub mean: Vec<[f64; 3]>, pub cov: Vec<Sym3>, pub count: Vec<f64> }

pub fn draw(m: &Mix, v: &View, size: Size) -> Vec<f32> {
    let frame = v.camera.frame().unwrap();
    let f = v.camera.focal_pixels(size);
    let clip = v.camera.clipping_range.unwrap_or([0.0, f64::INFINITY]);
    const L: usize = 7;
    const PAD: usize = 4;
    let dims: Vec<(usize, usize)> = (0..L).map(|l| ((size.width >> l) + 2 * PAD + 2, (size.height >> l) + 2 * PAD + 2)).collect();
    let mut levels: Vec<Vec<f32>> = dims.iter().map(|d| vec![0f32; d.0 * d.1]).collect();
    let e = 0.9973f64;
    for i in 0..m.count.len() {
        let n = m.count[i];
        let c = frame.to_camera(m.mean[i]);
        let z = -c[2];
        if z < clip[0] || z > clip[1] || n <= 0.0 { continue; }
        let (tx, ty) = (c[0] / z, c[1] / z);
        let ax = frame.axes;
        let jx: [f64; 3] = std::array::from_fn(|k| f / z * (ax[0][k] + tx * ax[2][k]));
        let jy: [f64; 3] = std::array::from_fn(|k| -f / z * (ax[1][k] + ty * ax[2][k]));
        let s = m.cov[i].add(&Sym3::scaled_identity(v.radius * v.radius));
        let sj = s.apply(jx);
        let sjy = s.apply(jy);
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (a, b, d) = (dot(jx, sj) + 1.0 / 12.0, dot(jx, sjy), dot(jy, sjy) + 1.0 / 12.0);
        let rp = v.radius * f / z;
        let w = n * 2.0 * std::f64::consts::PI * v.opacity * e * e * rp * rp * ((1.0 + tx * tx) * (1.0 + ty * ty)).sqrt();
        let det = a * d - b * b;
        let tr = 0.5 * (a + d);
        let mins = (tr - (tr * tr - det).max(0.0).sqrt()).max(1e-9).sqrt();
        let mut l = 0;
        while l + 1 < L && mins >= 1.6 * (1 << (l + 1)) as f64 { l += 1; }
        let q = 1.0 / (1 << l) as f64;
        let (px, py) = ((0.5 * size.width as f64 + f * tx) * q, (0.5 * size.height as f64 - f * ty) * q);
        let (a, b, d) = (a * q * q, b * q * q, d * q * q);
        let det = a * d - b * b;
        let amp = (w * q * q / (2.0 * std::f64::consts::PI * det.sqrt())) as f32;
        let (ia, ib, id) = ((d / det) as f32, (-b / det) as f32, (a / det) as f32);
        let (w_, h_) = dims[l];
        let (rx, ry) = (4.0 * a.sqrt(), 4.0 * d.sqrt());
        let x0 = (px - rx).floor().max(-(PAD as f64)) as i64;
        let x1 = (px + rx).ceil().min((w_ - PAD - 1) as f64) as i64;
        let y0 = (py - ry).floor().max(-(PAD as f64)) as i64;
        let y1 = (py + ry).ceil().min((h_ - PAD - 1) as f64) as i64;
        let img = &mut levels[l];
        for y in y0..=y1 {
            let dy = (y as f64 + 0.5 - py) as f32;
            let row = &mut img[(y + PAD as i64) as usize * w_..][..w_];
            for x in x0..=x1 {
                let dx = (x as f64 + 0.5 - px) as f32;
                let qq = ia * dx * dx + 2.0 * ib * dx * dy + id * dy * dy;
                if qq < 16.0 { row[(x + PAD as i64) as usize] += amp * (-0.5 * qq).exp(); }
            }
        }
    }
    const T: [f32; 4] = [-7.0 / 128.0, 105.0 / 128.0, 35.0 / 128.0, -5.0 / 128.0];
    for l in (1..L).rev() {
        let (cw, ch) = dims[l];
        let (fw, fh) = dims[l - 1];
        let coarse = std::mem::take(&mut levels[l]);
        // fine pixel x (0-based, pad removed) at (x+.5)/2 - .5 coarse
        let mut tmp = vec![0f32; fw * ch];
        for y in 0..ch { for x in 0..fw {
            let xf = x as i64 - PAD as i64;
            let base = xf.div_euclid(2) + PAD as i64;
            let odd = xf.rem_euclid(2) == 1;
            let mut s = 0.0;
            for (k, t) in T.iter().enumerate() {
                // offsets: even phase (x.25 left): taps at base+1, base, base-1, base-2
                let o = if odd { base - 1 + k as i64 } else { base + 1 - k as i64 };
                if o >= 0 && (o as usize) < cw { s += t * coarse[y * cw + o as usize]; }
            }
            tmp[y * fw + x] = s;
        } }
        let fine = &mut levels[l - 1];
        for y in 0..fh {
            let yf = y as i64 - PAD as i64;
            let base = yf.div_euclid(2) + PAD as i64;
            let odd = yf.rem_euclid(2) == 1;
            for (k, t) in T.iter().enumerate() {
                let o = if odd { base - 1 + k as i64 } else { base + 1 - k as i64 };
                if o >= 0 && (o as usize) < ch { for x in 0..fw { fine[y * fw + x] += t * tmp[o as usize * fw + x]; } }
            }
        }
    }
    let (w_, _) = dims[0];
    let mut out = Vec::with_capacity(size.pixels());
    for y in 0..size.height { out.extend(levels[0][(y + PAD) * w_ + PAD..][..size.width].iter().map(|v| v.max(0.0))); }
    out
}

pub struct Judge { views: Vec<View>, size: Size, truth: Vec<Vec<f32>>, shot: Vec<Vec<u8>>, curve: Vec<Vec<f64>> }
const NB: usize = 400;
fn bin(t: f32) -> f64 { (((t.max(1e-5) as f64).ln() - (1e-4f64).ln()) / ((20f64 / 1e-4).ln()) * NB as f64).clamp(0.0, NB as f64 - 1.001) }

impl Judge {
    pub fn new(xyz: &[[f32; 3]], scale: f64) -> Self {
        let root = Path::new("/work/shared/reference/nbody128");
        let set = read_views(&root.join("views.json")).unwrap();
        let views: Vec<View> = set.views.into_iter().filter(|v| v.name.starts_with("far") || v.name.starts_with("mid") || v.name.starts_with("near") || v.name == "large_radius").collect();
        let mut truths = vec![]; let mut shot = vec![]; let mut curve = vec![];
        for v in &views {
            let cache = format!("/tmp/refine/truth_{}.f32", v.name);
            let t: Vec<f32> = if let Ok(b) = std::fs::read(&cache) { b.chunks_exact(4).map(|c| f32::from_le_bytes(c.try_into().unwrap())).collect() } else {
                let t = truth(xyz, scale, v, set.size);
                std::fs::write(&cache, t.iter().flat_map(|f| f.to_le_bytes()).collect::<Vec<u8>>()).unwrap(); t };
            let s = read_gray_png(&root.join("paraview").join(format!("{}.png", v.name))).unwrap().data;
            let mut h = vec![(0f64, 0f64); NB];
            for (a, b) in t.iter().zip(&s) { let k = (bin(*a) + 0.5) as usize; h[k].0 += 1.0; h[k].1 += f64::from(*b); }
            let mut c = vec![0f64; NB];
            let mut last = 0.0;
            for k in 0..NB { let lo = k.saturating_sub(4); let hi = (k + 5).min(NB); let n: f64 = h[lo..hi].iter().map(|x| x.0).sum(); if n > 20.0 { last = h[lo..hi].iter().map(|x| x.1).sum::<f64>() / n; } c[k] = last; }
            truths.push(t); shot.push(s); curve.push(c);
        }
        Judge { views, size: set.size, truth: truths, shot, curve }
    }
    /// means far mid near large of exp, paraview
    pub fn score(&self, m: &Mix) -> String {
        let r: Vec<(f64, f64)> = (0..self.views.len()).into_par_iter().map(|i| {
            let t = draw(m, &self.views[i], self.size);
            let (mut e, mut p) = ((0f64, 0f64), (0f64, 0f64));
            for k in 0..t.len() {
                let a = (255.0 * (1.0 - (-t[k]).exp())).round(); let b = (255.0 * (1.0 - (-self.truth[i][k]).exp())).round();
                if a > 2.5 || b > 2.5 { e.0 += 1.0; e.1 += f64::from((a - b) / 255.0).powi(2); }
                let x = bin(t[k]); let j = x as usize; let fr = x - j as f64;
                let a = (self.curve[i][j] * (1.0 - fr) + self.curve[i][j + 1] * fr).round(); let b = f64::from(self.shot[i][k]);
                if a > 2.5 || b > 2.5 { p.0 += 1.0; p.1 += ((a - b) / 255.0).powi(2); }
            }
            let db = |x: (f64, f64)| -10.0 * (x.1 / x.0).log10();
            (db(e), db(p))
        }).collect();
        let mean = |pre: &str, k: usize| { let v: Vec<f64> = (0..self.views.len()).filter(|&i| self.views[i].name.starts_with(pre)).map(|i| if k == 0 { r[i].0 } else { r[i].1 }).collect(); v.iter().sum::<f64>() / v.len() as f64 };
        let g = |k| { let (a, b, c) = (mean("far", k), mean("mid", k), mean("near", k)); format!("{:.2} ({a:.2} {b:.2} {c:.2}) L {:.2}", (a + b + c) / 3.0, mean("large", k)) };
        format!("exp {} | pv {}", g(0), g(1))
    }
}

pub const SCALE: f64 = 64.0;
pub fn load() -> Vec<[f32; 3]> {
    let c: Vec<Vec<f32>> = ["xx", "yy", "zz"].iter().map(|n| std::fs::read(format!("/work/shared/data/nbody128/{n}.f32")).unwrap().chunks_exact(4).map(|c| f32::from_le_bytes(c.try_into().unwrap())).collect()).collect();
    (0..c[0].len()).map(|i| [c[0][i], c[1][i], c[2][i]].map(|v| v / SCALE as f32)).collect()
}

pub fn partition(mut xyz: Vec<[f32; 3]>, m: usize, s: f64) -> (Vec<[f32; 3]>, Vec<std::ops::Range<usize>>) {
    let cache = format!("/tmp/refine/part_{m}_{s:.4}.bin");
    if let Ok(b) = std::fs::read(&cache) {
        let n = xyz.len();
        for i in 0..n { xyz[i] = std::array::from_fn(|k| f32::from_le_bytes(b[12 * i + 4 * k..][..4].try_into().unwrap())); }
        let r = b[12 * n..].chunks_exact(16).map(|c| usize::from_le_bytes(c[..8].try_into().unwrap())..usize::from_le_bytes(c[8..].try_into().unwrap())).collect();
        return (xyz, r);
    }
    #[derive(PartialEq)] struct It(f64, std::ops::Range<usize>, [f64; 3], [f64; 3], f64);
    impl Eq for It {} impl PartialOrd for It { fn partial_cmp(&self, o: &Self) -> Option<std::cmp::Ordering> { Some(self.cmp(o)) } }
    impl Ord for It { fn cmp(&self, o: &Self) -> std::cmp::Ordering { self.0.total_cmp(&o.0) } }
    let blur2 = 2.0 * s * s;
    let look = |x: &mut [[f32; 3]], r: std::ops::Range<usize>| -> It {
        let p = &mut x[r.clone()];
        let (mean, cov) = moments(p);
        let axis = cov.eigen().vectors[0];
        match cut(p, mean, axis) { None => It(-1.0, r, mean, axis, 0.0), Some((a, b)) => {
            let w = Blob { count: p.len() as f64, mean, cov };
            let g = difference(&w, &a, &b, blur2);
            // partition by nearest along the axis to the boundary with a.count on the low side
            let k = a.count as usize;
            let key = |p: &[f32; 3]| (0..3).map(|k| (f64::from(p[k]) - mean[k]) * axis[k]).sum::<f64>();
            p.select_nth_unstable_by(k, |a, b| key(a).total_cmp(&key(b)));
            It(g, r, mean, axis, k as f64) } }
    };
    let mut heap = std::collections::BinaryHeap::new();
    let n = xyz.len();
    heap.push(look(&mut xyz, 0..n));
    while heap.len() < m {
        let it = heap.pop().unwrap();
        let mid = it.1.start + it.4 as usize;
        heap.push(look(&mut xyz, it.1.start..mid));
        heap.push(look(&mut xyz, mid..it.1.end));
    }
    let mut r: Vec<_> = heap.into_iter().map(|i| i.1).collect();
    r.sort_by_key(|r| r.start);
    let mut b: Vec<u8> = xyz.iter().flatten().flat_map(|f| f.to_le_bytes()).collect();
    for q in &r { b.extend(q.start.to_le_bytes()); b.extend(q.end.to_le_bytes()); }
    std::fs::write(&cache, b).unwrap();
    (xyz, r)
}

pub fn mix(g: &Gaussians) -> Mix {
    Mix { mean: g.mean.iter().map(|m| m.map(|v| v * SCALE)).collect(), cov: g.cov.iter().map(|c| c.scale(SCALE * SCALE)).collect(), count: g.count.clone() }
}

fn arg(name: &str, default: f64) -> f64 {
    std::env::args().find_map(|a| a.strip_prefix(&format!("{name}=")).map(|v| v.parse().unwrap())).unwrap_or(default)
}

fn main() {
    let xyz = load();
    let r0 = 0.015859368207607454 / SCALE;
    let judge = Judge::new(&xyz, SCALE);
    let m = arg("m", 19000.0) as usize;
    let c0 = cpu();
    let (xyz, cells) = partition(xyz, m, arg("ps", 6.0) * r0);
    println!("partition {:.2} s", cpu() - c0);
    let mut cloud = Cloud { xyz, weight: None };
    let mut groups = Groups::new(cells, &cloud.xyz);
    let mut g = Gaussians::default();
    for j in 0..groups.range.len() { g.push(groups.mean[j], groups.cov[j], groups.range[j].len() as f64, 0.0); }
    println!("start     {}", judge.score(&mix(&g)));
    let floor = (arg("floor", 0.3) * r0).powi(2);
    let reach = Reach { most: arg("k", 24.0) as usize, reach: arg("reach", 18.0), floor };
    let rounds = arg("rounds", 8.0) as usize;
    let its = arg("its", 3.0) as usize;
    let verbose = arg("v", 0.0) > 0.0;
    let mut total = 0.0;
    for round in 0..=rounds {
        let c0 = cpu(); let w0 = Instant::now();
        let cand = Candidates::find(&groups, &g, reach);
        let c1 = cpu();
        let n = if round == 0 { arg("its0", 4.0) as usize } else { its };
        let mut owner = vec![];
        for i in 0..n {
            let e = expect(&cloud, &groups, &cand, &g, floor, i + 1 == n, verbose, &Silent).unwrap();
            maximise(&e, &groups, &cand, &mut g, false);
            if verbose { println!("   ll {:.1}", e.likelihood); }
            owner = e.owner;
        }
        let c2 = cpu();
        let (mut made, mut c3) = (0, c2);
        if round < rounds {
            groups = regroup(&mut cloud, &owner, g.len());
            c3 = cpu();
            let near = Candidates::find(&groups, &g, Reach { most: 11, reach: 1e9, floor });
            let _ = candidates::Ellipsoid::new;
            made = exchange(&mut g, &groups, &cloud.xyz, |j| near.of(j), MoveOptions { blur: arg("s", 6.0) * r0, ratio: arg("ratio", 1.3), share: arg("share", 0.1) });
        }
        let c4 = cpu();
        total += c4 - c0;
        print!("round {round:2} cand {:.1} find {:.2} em {:.2} regroup {:.2} exch {:.2} wall {:.2} total {total:.2} made {made}", cand.mean_count(), c1 - c0, c2 - c1, c3 - c2, c4 - c3, w0.elapsed().as_secs_f64());
        if verbose || round % (arg("every", 4.0) as usize) == 0 || round == rounds { print!("\n   {}", judge.score(&mix(&g))); }
        println!();
    }
}
