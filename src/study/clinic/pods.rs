//! The pods of a station, whose projectors light up in turn.

use super::pod::Pod;
use phasmid_core::error::{Error, Result};
use phasmid_decode::Decoded;
use phasmid_profile::{Configuration, Profile, RigPlace, Scene};
use phasmid_sgrt::Measured;

/// The station with ceiling-mounted pods.
const STATION: &str = "sgrt-ceiling";

/// Reduces a camera's number of pixels over the same field of view, as by binning: each larger pixel
/// holds more electrons, has more read noise, and gives the same grey level in the same light.
pub fn binned(profile: &mut Profile, size_px: [u32; 2]) {
    let camera = &mut profile.camera;
    let area = |[columns, rows]: [u32; 2]| f64::from(columns) * f64::from(rows);
    let pixels = area([camera.width_px, camera.height_px]) / area(size_px);
    [camera.width_px, camera.height_px] = size_px;
    camera.sensor.full_well_e *= pixels;
    camera.sensor.gain_dn_per_e /= pixels;
    camera.sensor.read_noise_e *= pixels.sqrt();
}

/// The pods of a station in front of one scene.
pub struct Pods {
    /// The pods in the order of their turns.
    pub all: Vec<Pod>,
}

impl Pods {
    /// Creates the ceiling pods in front of a scene, each with its profile changed by `adapt`.
    ///
    /// # Errors
    /// Returns the errors of [`Pod::new`].
    pub fn new(scene: &Scene, seed: u64, adapt: &dyn Fn(&mut Profile)) -> Result<Self> {
        Self::as_built(scene, seed, &|_, profile, _| adapt(profile))
    }

    /// Like [`Self::new`], but `adapt` may also change the pod's place: it receives the pod's number in
    /// the order of turns, its profile, and its place in the station's file.
    ///
    /// # Errors
    /// Returns the errors of [`Self::new`].
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

    /// Returns the nanoseconds from the start of the first exposure to the end of the last pod's last
    /// exposure.
    pub fn duration_ns(&self) -> u64 {
        let Some((last, others)) = self.all.split_last() else {
            return 0;
        };
        others.iter().map(Pod::turn_ns).sum::<u64>() + last.duration_ns()
    }

    /// Scans with all pods in turn from a device time on, and decodes. If `still` is set, the scene is
    /// frozen in its state at the middle of the scan.
    ///
    /// # Errors
    /// Returns the decoder's errors.
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

    /// Returns at most `most` points of a scan, from all pods together, in the room's frame.
    pub fn measured(&self, scan: &[Decoded], most: usize) -> Measured {
        self.measured_without(scan, most, None)
    }

    /// Like [`Self::measured`], without the points of one pod, counted from 0 in the order of turns.
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
