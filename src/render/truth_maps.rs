//! Ground truth in the format of the service channel.

use crate::truth::Truth;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::service::Maps;

/// Names of maps that depend on device settings and not only on the scene.
const LEVELS: [&str; 3] = ["mean_dn", "modulation_dn", "noise_dn"];

impl Truth {
    /// Returns all maps for the service channel.
    pub fn to_maps(&self) -> Maps {
        self.maps_but(&[])
    }

    /// Returns the maps that do not depend on device settings.
    pub fn to_maps_of_geometry(&self) -> Maps {
        self.maps_but(&LEVELS)
    }

    fn maps_but(&self, left_out: &[&str]) -> Maps {
        Maps {
            width: self.width,
            height: self.height,
            maps: self
                .maps()
                .into_iter()
                .filter(|(name, _)| !left_out.contains(name))
                .map(|(name, map)| (name.to_owned(), map))
                .collect(),
            flags: self.flags.clone(),
            render_us: 0,
        }
    }

    /// Builds ground truth from maps received over the service channel; unknown maps are ignored.
    ///
    /// # Errors
    /// Returns an error if a map is missing or does not have width * height values.
    pub fn from_maps(maps: Maps) -> Result<Self> {
        let pixels = maps.width as usize * maps.height as usize;
        let mut named = maps.maps;
        let mut take = |name: &str| {
            named
                .iter_mut()
                .find(|(other, map)| other == name && map.len() == pixels)
                .map(|(_, map)| std::mem::take(map))
                .ok_or_else(|| Error::device(format!("truth: no map {name} of {pixels} pixels")))
        };
        let depth_mm = take("depth_mm")?;
        let vectors = |x: Vec<f32>, y: Vec<f32>, z: &[f32]| {
            let both = x.into_iter().zip(y).zip(z);
            both.map(|((x, y), z)| [x, y, *z]).collect()
        };
        let truth = Self {
            width: maps.width,
            height: maps.height,
            projector_x: take("projector_x")?,
            projector_y: take("projector_y")?,
            point_mm: vectors(take("point_x_mm")?, take("point_y_mm")?, &depth_mm),
            normal: vectors(take("normal_x")?, take("normal_y")?, &take("normal_z")?),
            object: take("object")?
                .into_iter()
                .map(|number| number as u16)
                .collect(),
            albedo: take("albedo")?,
            irradiance_w_m2: take("irradiance_w_m2")?,
            mean_dn: take("mean_dn")?,
            modulation_dn: take("modulation_dn")?,
            noise_dn: take("noise_dn")?,
            flags: maps.flags,
            depth_mm,
        };
        if truth.flags.len() != pixels {
            return Err(Error::device(format!(
                "truth: {} flags, expected {pixels}",
                truth.flags.len()
            )));
        }
        Ok(truth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_read_back_and_missing_maps_are_named() {
        let truth = Truth {
            width: 2,
            height: 1,
            depth_mm: vec![1.0, 2.0],
            projector_x: vec![3.0, 4.0],
            projector_y: vec![5.0, 6.0],
            point_mm: vec![[0.1, 0.2, 1.0], [0.3, 0.4, 2.0]],
            normal: vec![[0.0, 0.6, -0.8], [0.0, 0.0, -1.0]],
            object: vec![2, Truth::NO_OBJECT],
            albedo: vec![0.5, 0.6],
            irradiance_w_m2: vec![0.0, 1.5],
            mean_dn: vec![7.0, 8.0],
            modulation_dn: vec![9.0, 10.0],
            noise_dn: vec![1.0, 1.1],
            flags: vec![1, 3],
        };
        assert_eq!(Truth::from_maps(truth.to_maps()).unwrap(), truth);
        let geometry = truth.to_maps_of_geometry();
        let names: Vec<_> = geometry
            .maps
            .iter()
            .map(|(name, _)| name.as_str())
            .collect();
        assert_eq!(names, Truth::MAPS[..11]);
        let mut maps = truth.to_maps();
        maps.maps.remove(1);
        let message = Truth::from_maps(maps).unwrap_err().to_string();
        assert!(message.contains("projector_x"), "{message}");
    }
}
