//! Decimal numbers, fast: most of them are a few digits that one division makes a float.

/// Powers of ten that a float holds exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// The number at byte `at`, correctly rounded; `at` moves to its end.
#[inline(always)]
pub fn number_at(bytes: &[u8], at: &mut usize) -> Option<f64> {
    match short_number(bytes, at) {
        Some(value) => Some(value),
        None => any_number(bytes, at),
    }
}

#[cold]
fn any_number(bytes: &[u8], at: &mut usize) -> Option<f64> {
    let (value, length) = fast_float2::parse_partial(bytes.get(*at..)?).ok()?;
    *at += length;
    Some(value)
}

/// A number whose digits and power of ten are floats without rounding: one multiplication or
/// division of them then rounds once. Nothing where that is not so, or where it is not a number.
#[inline(always)]
fn short_number(bytes: &[u8], place: &mut usize) -> Option<f64> {
    let mut at = *place;
    let negative = bytes.get(at) == Some(&b'-');
    at += usize::from(negative);
    let start = at;
    let mut digits = 0u64;
    while let Some(digit) = digit_at(bytes, at) {
        digits = digits.wrapping_mul(10).wrapping_add(digit);
        at += 1;
    }
    let mut count = at - start;
    let mut power = 0i32;
    if bytes.get(at) == Some(&b'.') {
        at += 1;
        let point = at;
        if let Some(eight) = eight_digits(bytes, at) {
            digits = digits.wrapping_mul(100_000_000).wrapping_add(eight);
            at += 8;
        }
        while let Some(digit) = digit_at(bytes, at) {
            digits = digits.wrapping_mul(10).wrapping_add(digit);
            at += 1;
        }
        count += at - point;
        power = -((at - point) as i32);
    }
    // Up to 19 digits the sum has not wrapped.
    if count == 0 || count > 19 || digits > 1 << 53 {
        return None;
    }
    if let Some(b'e' | b'E') = bytes.get(at) {
        at += 1;
        power += exponent(bytes, &mut at)?;
    }
    let value = match power {
        0..=22 => digits as f64 * POWERS[power as usize],
        -22..0 => digits as f64 / POWERS[-power as usize],
        _ => return None,
    };
    *place = at;
    Some(if negative { -value } else { value })
}

#[inline(always)]
fn digit_at(bytes: &[u8], at: usize) -> Option<u64> {
    let digit = bytes.get(at)?.wrapping_sub(b'0');
    (digit < 10).then_some(u64::from(digit))
}

/// A power of ten of up to three digits.
#[inline]
fn exponent(bytes: &[u8], at: &mut usize) -> Option<i32> {
    let sign = *bytes.get(*at)?;
    *at += usize::from(matches!(sign, b'+' | b'-'));
    let start = *at;
    let mut value = 0;
    while let Some(digit) = digit_at(bytes, *at) {
        value = 10 * value + digit as i32;
        *at += 1;
        if *at - start > 3 {
            return None;
        }
    }
    (*at > start).then_some(if sign == b'-' { -value } else { value })
}

/// Eight bytes as digits, taken together: pairs, then fours, then all.
#[inline(always)]
fn eight_digits(bytes: &[u8], at: usize) -> Option<u64> {
    let word = u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?);
    let nibbles = word.wrapping_sub(0x3030_3030_3030_3030);
    // A byte below '0' borrows into its top bit; one above '9' carries into it.
    if (nibbles | word.wrapping_add(0x4646_4646_4646_4646)) & 0x8080_8080_8080_8080 != 0 {
        return None;
    }
    let pairs = nibbles.wrapping_mul(10).wrapping_add(nibbles >> 8) & 0x00ff_00ff_00ff_00ff;
    let fours = pairs.wrapping_mul(100).wrapping_add(pairs >> 16) & 0x0000_ffff_0000_ffff;
    Some(fours.wrapping_mul(10_000).wrapping_add(fours >> 32) & 0xffff_ffff)
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    fn both(text: &str) {
        let expected = fast_float2::parse_partial::<f64, _>(text).ok();
        let mut at = 0;
        let got = number_at(text.as_bytes(), &mut at).map(|value| (value, at));
        assert_eq!(got.map(|(v, n)| (v.to_bits(), n)), expected.map(|(v, n)| (v.to_bits(), n)), "{text}");
    }

    #[test]
    fn short_numbers_are_those_of_the_full_parser() {
        let texts = ",-,.,-.,e1,1e,1e+,1e-,0,-0,-0.0,5.,.5,-.5e1,1e22,1e23,1e-22,1e-23,1e0001,1e400,123456789,\
            12345678 ,0.12345678,0.123456789x,9007199254740993,9007199254740992,1.0000000000000000000,\
            99999999999999999999,18446744073709551616.5,nan,inf,+1,1.2345678:,1.2345678/,--1,1.5e3.2,\
            1E5,0x10";
        for text in texts.split(',') {
            both(text);
        }
    }

    #[test]
    fn so_are_random_ones() {
        let mut random = Random::new(7, 1, 0);
        for _ in 0..200_000 {
            let bits = random.bits();
            let value = f64::from_bits(bits);
            let small = (bits % 2_000_000_000) as f64 * 1e-7 - 100.0;
            both(&format!("{value:e}"));
            both(&format!("{small}"));
            both(&format!("{small:.9} 7"));
            both(&format!("{:e}", small as f32));
        }
    }
}
