// 64-bit integers as two words, low word first, because WGSL lacks them. They wrap around like the
// CPU's.

fn wide_difference(a: vec2u, b: vec2u) -> vec2u {
    return vec2u(a.x - b.x, a.y - b.y - u32(a.x < b.x));
}

// The full 64-bit product of two words, from 16-bit halves.
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

// Sign-extends a number.
fn wide_signed(a: i32) -> vec2u {
    return vec2u(bitcast<u32>(a), bitcast<u32>(a >> 31u));
}

// Converts an unsigned number, within one unit in the last place.
fn wide_to_f32(a: vec2u) -> f32 {
    return f32(a.y) * 4294967296.0 + f32(a.x);
}

// Converts a signed number.
fn wide_signed_to_f32(a: vec2u) -> f32 {
    if (a.y >> 31u) == 1u {
        return -wide_to_f32(wide_difference(vec2u(0u), a));
    }
    return wide_to_f32(a);
}
