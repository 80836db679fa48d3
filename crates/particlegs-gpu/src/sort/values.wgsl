// Each key carries a value.

@group(0) @binding(5) var<storage, read> values: array<u32>;
@group(0) @binding(6) var<storage, read_write> values_out: array<u32>;

fn carry(place: u32, to: u32) {
    values_out[to] = values[place];
}
