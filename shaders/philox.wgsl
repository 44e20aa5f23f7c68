// needs: wide
// Counter-based random numbers: Philox4x32-10, twin of sensor/philox.rs and equal to the bit.
//
// Salmon, Moraes, Dror, Shaw: "Parallel Random Numbers: As Easy as 1, 2, 3", SC11, 2011.

// The four words of a counter under a key (seed low, seed high).
fn philox(counter: vec4u, key: vec2u) -> vec4u {
    var c = counter;
    var k = key;
    for (var round = 0u; round < 10u; round++) {
        let p0 = wide_product(0xD2511F53u, c.x);
        let p1 = wide_product(0xCD9E8D57u, c.z);
        c = vec4u(p1.y ^ c.y ^ k.x, p1.x, p0.y ^ c.w ^ k.y, p0.x);
        k += vec2u(0x9E3779B9u, 0xBB67AE85u);
    }
    return c;
}

// Counters whose words lie side by side: word w of counter c serves pixel
// (c / 8) * 32 + w * 8 + c % 8 of the frame.
const PHILOX_WIDTH: u32 = 8u;
const PHILOX_BLOCK: u32 = 32u;

// The pixel that word 0 of a counter belongs to; each next word's is PHILOX_WIDTH further.
fn philox_first_pixel(counter: u32) -> u32 {
    return counter / PHILOX_WIDTH * PHILOX_BLOCK + counter % PHILOX_WIDTH;
}

// The one word of a pixel: its counter's other three go unused.
fn philox_of_pixel(pixel: u32, draw: u32, key: vec4u) -> u32 {
    let counter = pixel / PHILOX_BLOCK * PHILOX_WIDTH + pixel % PHILOX_WIDTH;
    let words = philox(vec4u(counter, draw, key.zw), key.xy);
    return words[pixel / PHILOX_WIDTH % 4u];
}
