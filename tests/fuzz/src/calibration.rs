//! Arbitrary calibration files: reading ends with a rig or with an error message.

use phasmid::calibrate::files::{Format, Reprojection, Sizes, rig_from_bytes, to_opencv};

/// Reads bytes as a calibration. If they give a rig, it must be valid, and must have the same lenses
/// after it has been written and read again.
pub fn run(bytes: &[u8]) {
    let sizes = Sizes {
        camera: Some([640, 480]),
        projector: Some([1024, 768]),
    };
    let _ = rig_from_bytes(bytes, "fuzz", Sizes::default());
    let Ok(rig) = rig_from_bytes(bytes, "fuzz", sizes) else {
        return;
    };
    rig.check().unwrap();
    for format in [Format::Yaml, Format::Xml] {
        let text = to_opencv(&rig, &Reprojection::default(), format);
        // If the camera is far from the rig's origin, rounding may lose the whole baseline.
        let Ok(back) = rig_from_bytes(text.as_bytes(), "fuzz", Sizes::default()) else {
            let (a, b) = (rig.camera.center(), rig.projector.center());
            let baseline = a.distance(b);
            assert!(!(baseline > 1e-3 && baseline > 1e-9 * (a.length() + b.length())));
            continue;
        };
        assert_eq!(back.camera.lens, rig.camera.lens);
        assert_eq!(back.projector.lens, rig.projector.lens);
    }
}
