// Every entry of the lists has a slot for the sums that its tile's pixels add up to. Those of a footprint lie side by side
// in the order of its tiles, so that they are added in that order, without a search and without atomic adds.

// Numbers of a slot.
const NUMBERS: u32 = 7u;

// The slot of a tile by its footprint's place: the slot that tile (0, 0) would have, and tiles to a row of the footprint's.
// What would lie before the first wraps, and comes back.
fn slot_of(place: vec2u, tile: vec2u) -> u32 {
    return place.x + tile.y * place.y + tile.x;
}
