// needs: plan, footprint
// Levels of one table under footprints: twelve words in, one out.

@group(0) @binding(110) var<storage, read> input: array<vec4u>;
@group(0) @binding(111) var<storage, read_write> output: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if i >= arrayLength(&output) || 3u * i + 2u >= arrayLength(&input) {
        return;
    }
    let a = input[3u * i];
    let slopes = bitcast<vec4f>(input[3u * i + 1u]);
    let b = input[3u * i + 2u];
    let footprint = Footprint(
        bitcast<vec2f>(a.xy), slopes, bitcast<f32>(a.z), a.w, bitcast<vec2f>(b.xy),
    );
    output[i] = bitcast<u32>(footprint_level(schedule_table(0u), footprint));
}
