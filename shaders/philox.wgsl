// needs: wide
// Counter-based random numbers: Philox4x32-10, bit-identical to its twin sensor/philox.rs.
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

// Assignment of words to pixels: word w of counter c serves pixel (c / 8) * 32 + w * 8 + c % 8 of
// the frame.
const PHILOX_WIDTH: u32 = 8u;
const PHILOX_BLOCK: u32 = 32u;

// Pixel of word 0 of a counter; the pixel of each further word is PHILOX_WIDTH later.
fn philox_first_pixel(counter: u32) -> u32 {
    return counter / PHILOX_WIDTH * PHILOX_BLOCK + counter % PHILOX_WIDTH;
}

// The single word of a pixel; computes all four words of its counter and discards the others.
fn philox_of_pixel(pixel: u32, draw: u32, key: vec4u) -> u32 {
    let counter = pixel / PHILOX_BLOCK * PHILOX_WIDTH + pixel % PHILOX_WIDTH;
    let words = philox(vec4u(counter, draw, key.zw), key.xy);
    return words[pixel / PHILOX_WIDTH % 4u];
}
