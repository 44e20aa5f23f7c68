// needs: plan, philox
// Input: six words, a counter and a key. Output: the counter's four words, then the words of its
// four pixels, one by one.

@group(0) @binding(110) var<storage, read> input: array<u32>;
@group(0) @binding(111) var<storage, read_write> output: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if i >= arrayLength(&input) / 6u {
        return;
    }
    let counter = vec4u(input[6u * i], input[6u * i + 1u], input[6u * i + 2u], input[6u * i + 3u]);
    let key = vec2u(input[6u * i + 4u], input[6u * i + 5u]);
    let words = philox(counter, key);
    output[8u * i] = words.x;
    output[8u * i + 1u] = words.y;
    output[8u * i + 2u] = words.z;
    output[8u * i + 3u] = words.w;
    for (var w = 0u; w < 4u; w++) {
        let pixel = philox_first_pixel(counter.x >> 5u) + w * PHILOX_WIDTH;
        output[8u * i + 4u + w] = philox_of_pixel(pixel, counter.y, vec4u(key, counter.zw));
    }
}
