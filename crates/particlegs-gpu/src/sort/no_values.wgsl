// Keys carry nothing but their own lower bits.
fn carry(place: u32, to: u32) {
}
