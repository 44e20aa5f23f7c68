// needs: optics, lens
// The projector's axes, which rotate a vector from the rig's frame into the projector's: `v *
// projector_axes()`.

fn projector_axes() -> mat3x3f {
    return mat3x3f(
        optics[0].projector_x.xyz, optics[0].projector_y.xyz, optics[0].projector_z.xyz,
    );
}
