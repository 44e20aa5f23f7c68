//! Patient files.

use super::files::with_file;
use phasmid::patient::isosurface::{Parts, isosurface};
use phasmid::patient::planning::PlanningFile;
use phasmid::patient::volume::Volume;
use phasmid::patient::{dicom as ct, metaimage as image};

/// Reads a MetaImage file, a volume or a field: writing and rereading it must give the same data.
pub fn metaimage(bytes: &[u8]) -> bool {
    with_file("mha", bytes, |path| {
        if let Ok(volume) = image::read_volume(&path) {
            image::write_volume(&path, &volume, image::Packing::Zlib).expect("room for it");
            assert_eq!(
                image::read_volume(&path).expect("as it was written"),
                volume
            );
            surface(&volume);
            return true;
        }
        let Ok(field) = image::read_field(&path) else {
            return false;
        };
        assert_eq!(field.vectors().len(), field.grid().voxels());
        image::write_field(&path, &field, image::Packing::Plain).expect("room for it");
        assert_eq!(image::read_field(&path).expect("as it was written"), field);
        true
    })
}

/// Reads a DICOM CT image.
pub fn dicom(bytes: &[u8]) -> bool {
    with_file("dcm", bytes, |path| {
        let Ok(volume) = ct::read_slice(&path) else {
            return false;
        };
        assert_eq!(volume.voxels().len(), volume.grid().voxels());
        surface(&volume);
        true
    })
}

/// Checks that the surface of a volume refers only to existing vertices.
fn surface(volume: &Volume) {
    if let Ok(mesh) = isosurface(volume, -500.0, Parts::LargestFilled, "fuzz") {
        mesh.checked("fuzz").expect("a surface of voxels");
    }
}

/// Reads a planning file: writing and rereading it must give the same data.
pub fn planning(bytes: &[u8]) -> bool {
    let Ok(file) = PlanningFile::parse(&String::from_utf8_lossy(bytes), "fuzz") else {
        return false;
    };
    let again = PlanningFile::parse(&file.to_toml(), "fuzz").expect("as it was written");
    assert_eq!(again, file);
    true
}
