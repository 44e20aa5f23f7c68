// needs: plan, elementary, normal
// Input: a word. Output: ln(x) and exp(-x) for x = (word + 1/2) 80 / 2^32, and the word's normal
// number.

@group(0) @binding(110) var<storage, read> input: array<u32>;
@group(0) @binding(111) var<storage, read_write> output: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if i >= arrayLength(&output) / 3u {
        return;
    }
    let x = (f32(input[i]) + 0.5) * (80.0 / 4294967296.0);
    output[3u * i] = bitcast<u32>(ln(x));
    output[3u * i + 1u] = bitcast<u32>(exp_negative(x));
    output[3u * i + 2u] = bitcast<u32>(quantile(tail_of_word(input[i])));
}
