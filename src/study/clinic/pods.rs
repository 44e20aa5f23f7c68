//! The pods of a station, whose projectors take turns.

use super::pod::Pod;
use phasmid_core::error::{Error, Result};
use phasmid_decode::Decoded;
use phasmid_profile::{Configuration, Profile, RigPlace, Scene};
use phasmid_sgrt::Measured;

/// The station that stands under the ceiling.
const STATION: &str = "sgrt-ceiling";

/// Makes a camera one of fewer columns and rows over the same field: its pixels are binned, so that a
/// larger one holds more electrons, has more read noise, and gives the same grey levels in the same
/// light.
pub fn binned(profile: &mut Profile, size_px: [u32; 2]) {
    let camera = &mut profile.camera;
    let area = |[columns, rows]: [u32; 2]| f64::from(columns) * f64::from(rows);
    let pixels = area([camera.width_px, camera.height_px]) / area(size_px);
    [camera.width_px, camera.height_px] = size_px;
    camera.sensor.full_well_e *= pixels;
    camera.sensor.gain_dn_per_e /= pixels;
    camera.sensor.read_noise_e *= pixels.sqrt();
}

/// The pods of a station before one scene.
pub struct Pods {
    /// Each, in the order in which they take turns.
    pub all: Vec<Pod>,
}

impl Pods {
    /// The pods of the ceiling before a scene, each as `adapt` makes it of its profile.
    ///
    /// # Errors
    /// What [`Pod::new`] refuses.
    pub fn new(scene: &Scene, seed: u64, adapt: &dyn Fn(&mut Profile)) -> Result<Self> {
        Self::as_built(scene, seed, &|_, profile, _| adapt(profile))
    }

    /// The same, each as it is built and where it stands: `adapt` has its number in the order of turns,
    /// its profile, and its place by the station's file.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn as_built(
        scene: &Scene,
        seed: u64,
        adapt: &dyn Fn(usize, &mut Profile, &mut RigPlace),
    ) -> Result<Self> {
        let Configuration::Station(station) = Configuration::load(STATION)? else {
            return Err(Error::input(STATION, "a device", "a station"));
        };
        let pods = station.device.iter().enumerate().map(|(number, device)| {
            let mut profile = Profile::load(&station.profile(device))?;
            let mut place = device.rig().unwrap_or(scene.rig);
            adapt(number, &mut profile, &mut place);
            Pod::new(
                &profile,
                scene,
                place,
                seed.wrapping_add(device.seed.unwrap_or(0)),
            )
        });
        Ok(Self {
            all: pods.collect::<Result<_>>()?,
        })
    }

    /// Nanoseconds from the start of the first exposure to the end of the last pod's last one.
    pub fn duration_ns(&self) -> u64 {
        let Some((last, others)) = self.all.split_last() else {
            return 0;
        };
        others.iter().map(Pod::turn_ns).sum::<u64>() + last.duration_ns()
    }

    /// Scans with all pods in turn from a device time on, and decodes; with a scene that stands as it
    /// is half way through the scan where `still` is asked for.
    ///
    /// # Errors
    /// What the decoder refuses.
    pub fn scan(&mut self, start_ns: u64, still: bool) -> Result<Vec<Decoded>> {
        let middle_ns = start_ns + self.duration_ns() / 2;
        let mut begin_ns = start_ns;
        let scan = |pod: &mut Pod| {
            let scanned = pod.scan(begin_ns, still.then_some(middle_ns))?;
            begin_ns += pod.turn_ns();
            pod.decode(&scanned)
        };
        self.all.iter_mut().map(scan).collect()
    }

    /// The points of a scan in the room, at most so many of all pods together.
    pub fn measured(&self, scan: &[Decoded], most: usize) -> Measured {
        self.measured_without(scan, most, None)
    }

    /// The same without those of one pod, counted from 0 in the order of turns.
    pub fn measured_without(
        &self,
        scan: &[Decoded],
        most: usize,
        without: Option<usize>,
    ) -> Measured {
        let mut measured = Measured::default();
        for (i, (pod, decoded)) in self.all.iter().zip(scan).enumerate() {
            if Some(i) != without {
                pod.measure(decoded, &mut measured, most / self.all.len());
            }
        }
        measured
    }
}
