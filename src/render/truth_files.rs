//! Ground truth as files: an archive of NumPy arrays, and the depth as an image.

use crate::truth::Truth;
use image::{ImageBuffer, ImageFormat, Luma};
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::{replace, replace_image};
use phasmid_core::npy;
use std::io::Write;
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Unit of the depth image in millimetres.
const UNIT_MM: f32 = 0.1;

impl Truth {
    /// Writes the maps as an archive of NumPy arrays (`numpy.load`) named as the fields: float32 of
    /// shape (height, width), `point_mm` and `normal` of shape (height, width, 3), `object` as uint16
    /// and `flags` as uint8. A file of the name is replaced.
    ///
    /// # Errors
    /// Returns the system's error.
    pub fn write_npz(&self, path: &Path) -> Result<()> {
        let floats =
            |map: &[f32]| -> Vec<u8> { map.iter().flat_map(|v| v.to_le_bytes()).collect() };
        let vectors = |map: &[[f32; 3]]| floats(map.as_flattened());
        let one: &[usize] = &[];
        let arrays: [(&str, &str, &[usize], Vec<u8>); 12] = [
            ("depth_mm", "<f4", one, floats(&self.depth_mm)),
            ("projector_x", "<f4", one, floats(&self.projector_x)),
            ("projector_y", "<f4", one, floats(&self.projector_y)),
            ("point_mm", "<f4", &[3], vectors(&self.point_mm)),
            ("normal", "<f4", &[3], vectors(&self.normal)),
            (
                "object",
                "<u2",
                one,
                self.object.iter().flat_map(|n| n.to_le_bytes()).collect(),
            ),
            ("albedo", "<f4", one, floats(&self.albedo)),
            ("irradiance_w_m2", "<f4", one, floats(&self.irradiance_w_m2)),
            ("mean_dn", "<f4", one, floats(&self.mean_dn)),
            ("modulation_dn", "<f4", one, floats(&self.modulation_dn)),
            ("noise_dn", "<f4", one, floats(&self.noise_dn)),
            ("flags", "|u1", one, self.flags.clone()),
        ];
        replace(path, |out| {
            let mut archive = ZipWriter::new_stream(out);
            let options =
                SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
            for (name, kind, inner, bytes) in &arrays {
                let shape = [&[self.height as usize, self.width as usize], *inner].concat();
                archive.start_file(format!("{name}.npy"), options)?;
                archive.write_all(&npy::header(kind, &shape))?;
                archive.write_all(bytes)?;
            }
            archive.finish()?;
            Ok(())
        })
    }

    /// Writes the depth as a greyscale PNG of 16 bits in units of 0.1 mm; 0 where there is none or it
    /// exceeds 6553.5 mm. A file of the name is replaced.
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
