// The plan: which terms of image formation a pipeline computes, as constants known when it is
// compiled, so that terms that a scene does not need are removed. Twin of `term.rs`.

override has_camera_distortion: bool = false;
override has_projector_distortion: bool = false;
override has_camera_vignetting: bool = false;
override has_projector_vignetting: bool = false;
override has_projector_defocus: bool = false;
override has_shadows: bool = false;
override has_depth_of_field: bool = false;
override has_albedo_maps: bool = false;
override has_specular: bool = false;
override has_lights: bool = false;
override has_subsurface: bool = false;
override has_interreflection: bool = false;
override has_footprint_x: bool = false;
override has_footprint_y: bool = false;
override has_projector_response: bool = false;
override has_contrast_ratio: bool = false;
override has_motion: bool = false;
override has_flicker: bool = false;
override has_rolling_shutter: bool = false;
override has_pattern_timing: bool = false;
override has_glare: bool = false;
override has_dark_current: bool = false;
override has_fixed_pattern: bool = false;
override has_blooming: bool = false;
override has_noise: bool = false;
override has_camera_response: bool = false;

// Threads per workgroup.
const GROUP: u32 = 64u;

// Linear index of an invocation in a two-dimensional grid of workgroups: one dimension is limited
// to 65535 workgroups.
fn linear(id: vec3u, groups: vec3u) -> u32 {
    return id.y * groups.x * GROUP + id.x;
}
