// needs: gathered
// Computes the charge of the whole frame before blooming, which moves electrons between pixels
// before they are read.

@group(0) @binding(55) var<storage, read_write> electrons: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let pixel = linear(id, groups);
    if pixel < sensor_parameters.pixels {
        electrons[pixel] = gathered(electrons[pixel], pixel);
    }
}
