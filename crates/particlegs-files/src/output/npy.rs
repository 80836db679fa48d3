//! Heads of NumPy's files.

/// The head of a NumPy array of this element type (`<f4`, `<f8`, `<U7`, ...) and shape, in C order: what
/// stands before its elements. Its length is a multiple of 64 bytes. No sides are a single value.
///
/// Source: NEP 1, version 1.0 of the format, which holds heads of less than 65 536 bytes.
pub fn npy_header(element: &str, shape: &[u64]) -> Vec<u8> {
    let sides: Vec<String> = shape.iter().map(u64::to_string).collect();
    let comma = if sides.len() == 1 { "," } else { "" };
    let sides = format!("({}{comma})", sides.join(", "));
    let mut text = format!("{{'descr': '{element}', 'fortran_order': False, 'shape': {sides}, }}");
    while (10 + text.len() + 1) % 64 != 0 {
        text.push(' ');
    }
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend((text.len() as u16).to_le_bytes());
    header.extend(text.as_bytes());
    header
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_pythons() {
        for (shape, words) in [(&[][..], "()"), (&[7], "(7,)"), (&[7, 3], "(7, 3)"), (&[2, 3, 4], "(2, 3, 4)")] {
            let header = npy_header("<f4", shape);
            let text = String::from_utf8_lossy(&header[10..]).into_owned();
            assert!(header.len().is_multiple_of(64) && text.ends_with('\n'));
            assert_eq!(usize::from(u16::from_le_bytes([header[8], header[9]])), header.len() - 10);
            assert!(text.contains(&format!("'descr': '<f4', 'fortran_order': False, 'shape': {words}, }}")), "{text}");
        }
    }
}
