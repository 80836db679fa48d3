use super::*;
use crate::testing::open_bytes;

fn header(format: &str, rest: &str) -> Vec<u8> {
    format!("ply\nformat {format} 1.0\ncomment by hand\n{rest}end_header\n").into_bytes()
}

const FACES: &str = "element face 2\nproperty list uchar int vertex_indices\nproperty uchar flags\n";

fn rows(bytes: &[u8]) -> Result<Vec<[f64; 4]>> {
    let snapshot = open_bytes("a", bytes)?;
    crate::testing::rows(&*snapshot, 0, &Choice::default())
}

#[test]
fn text_with_other_elements_first() {
    let properties = "element vertex 2\nproperty double z\nproperty list uchar float t\nproperty float x\nproperty \
                      float y\nproperty float mass\n";
    let mut bytes = header("ascii", &format!("{FACES}{properties}"));
    bytes.extend(b"3 0 1 1 7\n\n0 9\n3 2 8 9 1 2e0 0.5\r\n-6 0 4 5 0.25");
    assert_eq!(rows(&bytes).unwrap(), [[1.0, 2.0, 3.0, 0.5], [4.0, 5.0, -6.0, 0.25]]);
    for end in ["3 2 8 9 1 2 0.5 7\n", "3 2 8 9 1 2\n", "3 2 8 9 1 x 0.5\n", "3 9 8 9 1 2 0.5\n"] {
        let mut bytes = header("ascii", properties);
        bytes.extend(end.repeat(2).as_bytes());
        assert!(rows(&bytes).err().unwrap().to_string().contains("vertex 0"), "{end}");
    }
}

#[test]
fn binary_with_lists_before_and_within() {
    for big in [false, true] {
        let f = |v: f32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
        let format = if big { "binary_big_endian" } else { "binary_little_endian" };
        let faces = [2u8, 0, 0, 0, 1, 0, 0, 0, 2, 7, 0, 8];
        let mut plain = header(
            format,
            &format!(
                "{FACES}element vertex 2\nproperty float y\nproperty uchar c\n\
                                                 property float x\nproperty float z\n"
            ),
        );
        let mut lists = header(
            format,
            &format!(
                "{FACES}element vertex 2\nproperty float y\nproperty list uchar \
                                                 uchar l\nproperty float x\nproperty float z\n"
            ),
        );
        plain.extend(faces);
        lists.extend(faces);
        for (row, list) in [([2f32, 1., 3.], &[2u8, 9, 9][..]), ([5., 4., 6.], &[0])] {
            for (out, between) in [(&mut plain, &[1u8][..]), (&mut lists, list)] {
                out.extend(f(row[0]));
                out.extend(between);
                out.extend(f(row[1]));
                out.extend(f(row[2]));
            }
        }
        for bytes in [plain, lists] {
            assert_eq!(rows(&bytes).unwrap(), [[1.0, 2.0, 3.0, 0.0], [4.0, 5.0, 6.0, 0.0]]);
            for cut in 0..bytes.len() {
                assert!(rows(&bytes[..cut]).is_err(), "cut at {cut}");
            }
        }
    }
}

#[test]
fn lies_are_refused() {
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    let error = |elements: &str, data: &[u8]| {
        let mut bytes = header("binary_little_endian", elements);
        bytes.extend(data);
        rows(&bytes).err().unwrap().to_string()
    };
    assert!(error(&format!("element vertex 1000000000000000\n{xyz}"), &[0; 24]).contains("but the file has only"));
    assert!(error(&format!("element vertex 18446744073709551615\n{xyz}"), &[0; 24]).contains("but the file has only"));
    assert!(error("element vertex 0\n", &[]).contains("no vertices"));
    assert!(error("element point 1\nproperty float x\n", &[0; 4]).contains("no element `vertex`"));
    assert!(error("element vertex 1\nproperty float x\n", &[0; 4]).contains("lack x, y and z"));
    let list = format!("element face 1\nproperty list uint int i\nelement vertex 1\n{xyz}");
    assert!(error(&list, &[0xff; 16]).contains("4294967295 items"));
    let list = format!("element face 1\nproperty list float int i\nelement vertex 1\n{xyz}");
    assert!(error(&list, &[0xff; 16]).contains("NaN items"));
}
