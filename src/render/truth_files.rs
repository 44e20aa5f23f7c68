//! Ground truth as files: an archive of NumPy arrays, and the depth as an image.

use crate::npz::{self, Array};
use crate::truth::Truth;
use image::{ImageBuffer, ImageFormat, Luma};
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::{replace, replace_image};
use std::path::Path;

/// Unit of the numbers in the depth image, in millimetres.
const UNIT_MM: f32 = 0.1;

impl Truth {
    /// Writes the maps as an archive of NumPy arrays (`numpy.load`) named like the fields: float32
    /// of shape (height, width), `point_mm` and `normal` of shape (height, width, 3), `object` as
    /// uint16 and `flags` as uint8. An existing file is replaced.
    ///
    /// # Errors
    /// Returns the system's error.
    pub fn write_npz(&self, path: &Path) -> Result<()> {
        let map = [self.height as usize, self.width as usize];
        let vectors = [map[0], map[1], 3];
        let one = |name, values: &[f32]| Array::floats(name, &map, values);
        let three =
            |name, values: &[[f32; 3]]| Array::floats(name, &vectors, values.as_flattened());
        let whole = |name, kind, bytes| Array {
            name,
            kind,
            shape: map.to_vec(),
            bytes,
        };
        let objects = self.object.iter().flat_map(|n| n.to_le_bytes()).collect();
        let arrays = [
            one("depth_mm", &self.depth_mm),
            one("projector_x", &self.projector_x),
            one("projector_y", &self.projector_y),
            three("point_mm", &self.point_mm),
            three("normal", &self.normal),
            whole("object", "<u2", objects),
            one("albedo", &self.albedo),
            one("irradiance_w_m2", &self.irradiance_w_m2),
            one("mean_dn", &self.mean_dn),
            one("modulation_dn", &self.modulation_dn),
            one("noise_dn", &self.noise_dn),
            whole("flags", "|u1", self.flags.clone()),
        ];
        replace(path, |out| npz::write(out, arrays))
    }

    /// Writes the depth as a greyscale PNG of 16 bits in units of 0.1 mm; 0 if it is missing or
    /// exceeds 6553.5 mm. An existing file is replaced.
    ///
    /// # Errors
    /// Returns the system's error.
    pub fn write_depth_png(&self, path: &Path) -> Result<()> {
        let unit = |depth: &f32| match (depth / UNIT_MM).round() {
            level if level >= 0.0 && level <= f32::from(u16::MAX) => level as u16,
            _ => 0,
        };
        let levels: Vec<u16> = self.depth_mm.iter().map(unit).collect();
        let picture = ImageBuffer::<Luma<u16>, _>::from_raw(self.width, self.height, levels)
            .ok_or_else(|| Error::device("truth: the depth map has another size"))?;
        replace_image(path, |out| picture.write_to(out, ImageFormat::Png))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    fn truth() -> Truth {
        Truth {
            width: 2,
            height: 1,
            depth_mm: vec![1000.04, f32::NAN],
            projector_x: vec![3.0, 4.0],
            projector_y: vec![5.0, 6.0],
            point_mm: vec![[0.1, 0.2, 1000.04], [f32::NAN; 3]],
            normal: vec![[0.0, 0.6, -0.8], [f32::NAN; 3]],
            object: vec![2, Truth::NO_OBJECT],
            albedo: vec![0.5, f32::NAN],
            irradiance_w_m2: vec![0.0, f32::NAN],
            mean_dn: vec![7.0, 8.0],
            modulation_dn: vec![9.0, 10.0],
            noise_dn: vec![1.0, 1.1],
            flags: vec![1, 0],
        }
    }

    #[test]
    fn archive_has_an_array_for_each_map() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("truth.npz");
        truth().write_npz(&path).unwrap();
        let mut archive = zip::ZipArchive::new(std::fs::File::open(&path).unwrap()).unwrap();
        assert_eq!(archive.len(), 12);
        let mut bytes = Vec::new();
        let mut normal = archive.by_name("normal.npy").unwrap();
        normal.read_to_end(&mut bytes).unwrap();
        let text = String::from_utf8_lossy(&bytes[10..]);
        assert!(
            text.contains("'<f4'") && text.contains("(1, 2, 3)"),
            "{text}"
        );
        assert_eq!(bytes[bytes.len() - 20..][..4], 0.6f32.to_le_bytes());
    }

    #[test]
    fn depth_image_is_in_tenths_of_a_millimetre() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("depth.png");
        truth().write_depth_png(&path).unwrap();
        let levels = image::open(&path).unwrap().into_luma16();
        assert_eq!(levels.as_raw(), &[10_000, 0]);
    }
}
