// needs: plan, hemisphere
// Directions above surfaces. Each input of four words is a normal and a turn; the outputs are the
// direction with the cosine of the turn, and the sides with its sine.

@group(0) @binding(110) var<storage, read> input: array<vec4u>;
@group(0) @binding(111) var<storage, read_write> output: array<vec4f>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if i >= arrayLength(&input) {
        return;
    }
    let normal = bitcast<vec3f>(input[i].xyz);
    let number = i % arrayLength(&interreflection_disc);
    let side = sqrt(3.14159265 / f32(arrayLength(&interreflection_disc)));
    let found = spoke(number, normal, interreflection_axes(normal, input[i].w), side);
    let turn = of_turn(input[i].w);
    output[3u * i] = vec4f(found.direction, turn.x);
    output[3u * i + 1u] = vec4f(found.sides[0], turn.y);
    output[3u * i + 2u] = vec4f(found.sides[1], 0.0);
}
