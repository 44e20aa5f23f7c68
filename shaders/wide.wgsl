// Whole numbers of 64 bits as two words, the low one first: WGSL has none. They wrap around, as the
// CPU's do.

fn wide_difference(a: vec2u, b: vec2u) -> vec2u {
    return vec2u(a.x - b.x, a.y - b.y - u32(a.x < b.x));
}

// The whole product of two words, by halves.
fn wide_product(a: u32, b: u32) -> vec2u {
    let low = (a & 0xffffu) * (b & 0xffffu);
    let middle = (a >> 16u) * (b & 0xffffu) + (low >> 16u);
    let other = (a & 0xffffu) * (b >> 16u) + (middle & 0xffffu);
    let high = (a >> 16u) * (b >> 16u) + (middle >> 16u) + (other >> 16u);
    return vec2u((other << 16u) | (low & 0xffffu), high);
}

fn wide_times(a: vec2u, b: vec2u) -> vec2u {
    let low = wide_product(a.x, b.x);
    return vec2u(low.x, low.y + a.x * b.y + a.y * b.x);
}

// A number with its sign.
fn wide_signed(a: i32) -> vec2u {
    return vec2u(bitcast<u32>(a), bitcast<u32>(a >> 31u));
}

// Of a number without a sign, within one unit of the last place.
fn wide_to_f32(a: vec2u) -> f32 {
    return f32(a.y) * 4294967296.0 + f32(a.x);
}

// Of a number with a sign.
fn wide_signed_to_f32(a: vec2u) -> f32 {
    if (a.y >> 31u) == 1u {
        return -wide_to_f32(wide_difference(vec2u(0u), a));
    }
    return wide_to_f32(a);
}
