// needs: plan, board
// Fraction of ink on pieces of boards.

@group(0) @binding(110) var<storage, read> input: array<u32>;
@group(0) @binding(111) var<storage, read_write> output: array<u32>;

fn input_number(at: u32) -> f32 {
    return bitcast<f32>(input[at]);
}

fn input_vec2(at: u32) -> vec2f {
    return vec2f(input_number(at), input_number(at + 1u));
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear(id, groups);
    if 13u * i >= arrayLength(&input) || i >= arrayLength(&output) {
        return;
    }
    let at = 13u * i;
    let board = Board(
        input[at] != 0u,
        input_vec2(at + 1u),
        input_number(at + 3u),
        input_number(at + 4u),
        input_number(at + 5u),
        input_number(at + 6u),
    );
    let ink = board_ink(board, input_vec2(at + 7u), input_vec2(at + 9u), input_vec2(at + 11u));
    output[i] = bitcast<u32>(ink);
}
