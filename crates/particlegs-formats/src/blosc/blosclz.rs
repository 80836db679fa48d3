//! BloscLZ, blosc's own codec: literals and copies of what came before, after FastLZ.

/// Decompresses `bytes` into exactly `out`; `None` for broken bytes.
pub fn decompress(bytes: &[u8], out: &mut [u8]) -> Option<()> {
    let mut at = 0;
    let mut next = || {
        let byte = bytes.get(at).copied();
        at += 1;
        byte
    };
    let mut done = 0;
    // The first three bits of the stream are its version.
    let mut control = Some(next()? & 31);
    while let Some(c) = control {
        if c < 32 {
            for _ in 0..=c {
                *out.get_mut(done)? = next()?;
                done += 1;
            }
        } else {
            let mut length = usize::from(c >> 5) + 2;
            if c >> 5 == 7 {
                loop {
                    let more = next()?;
                    length += usize::from(more);
                    if more != 255 {
                        break;
                    }
                }
            }
            let (high, low) = (usize::from(c & 31), usize::from(next()?));
            // The largest short distance says that a long one follows.
            let distance = if high == 31 && low == 255 {
                (usize::from(next()?) << 8) + usize::from(next()?) + 8192
            } else {
                (high << 8) + low + 1
            };
            let from = done.checked_sub(distance)?;
            let end = done.checked_add(length).filter(|&e| e <= out.len())?;
            // Byte by byte: a copy may run into what it writes.
            for i in 0..length {
                out[done + i] = out[from + i];
            }
            done = end;
        }
        control = next();
    }
    (done == out.len()).then_some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literals_copies_and_runs() {
        // "abc", then 6 from 3 back, then a run.
        let mut out = [0; 9];
        assert_eq!(decompress(&[2, b'a', b'b', b'c', 4 << 5, 2], &mut out), Some(()));
        assert_eq!(&out, b"abcabcabc");
        let mut out = [0; 10];
        assert_eq!(decompress(&[0, b'x', 7 << 5, 0, 0], &mut out), Some(()));
        assert_eq!(&out, b"xxxxxxxxxx");
    }

    #[test]
    fn broken_streams_are_refused() {
        let mut out = [0; 9];
        for bad in [&[][..], &[31], &[2, b'a'], &[0, b'a', 4 << 5, 2], &[2, b'a', b'b', b'c', 7 << 5, 255, 255, 0]] {
            assert_eq!(decompress(bad, &mut out), None);
        }
    }
}
