//! Chunks that blosc itself wrote, for tests.

/// Chunks of python-blosc 1.11.4: `i / 7 + i * i % 13` as u32, by codec, shuffle and count.
pub fn chunks() -> impl Iterator<Item = (&'static str, u32, Vec<u8>)> {
    include_str!("../../tests/data/blosc_chunks.txt").lines().map(|line| {
        let [name, count, bytes] = line.split(", ").collect::<Vec<_>>().try_into().unwrap();
        (name, count.parse().unwrap(), crate::testing::hex(bytes))
    })
}
