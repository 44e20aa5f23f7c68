//! An emulated device in memory.

use phasmid_core::Stop;
use phasmid_core::error::{Error, Result};
use phasmid_decode::Capture;
use phasmid_device::Truth;
#[cfg(target_os = "linux")]
use phasmid_device::link::{ServeOptions, Serving};
use phasmid_geometry::Rig;
use phasmid_host::{Flow, Intake, Progress, ScanOptions, Scanner};
use phasmid_pattern::Pattern;
use phasmid_profile::{Profile, Scene};
use phasmid_protocol::faults::{Fault, Struck};
use phasmid_render::Renderer;
use phasmid_render::shot::Shot;
use phasmid_study::desk::{Desk, Link};
use std::fmt;
use std::time::Duration;

/// Maximum device time to wait for a reply or a frame. The device's clock does not wait in real
/// time.
const PATIENCE: Duration = Duration::from_secs(60);

/// An emulated scanner in memory, without sockets, processes or threads of its own. It has its own
/// clock, which does not wait in real time.
///
/// ```
/// let mut device = phasmid::Device::builder().profile("webcam-grey").scene("sphere").seed(1).build()?;
/// let capture = device.scan("quick-4")?;
/// assert_eq!(capture.images.len(), 13);
/// let truth = device.truth()?;
/// assert_eq!(truth.depth_mm.len(), 640 * 480);
/// # Ok::<(), phasmid::Error>(())
/// ```
pub struct Device {
    desk: Desk,
    profile: Profile,
    scene: Scene,
    last: Option<Last>,
}

/// Data for the truth of the last scan.
struct Last {
    sequence: Vec<(Pattern, Shot)>,
    /// The scene during the last scan. `moved` lists the objects moved since then, by index.
    scene: Scene,
    moved: Vec<usize>,
}

impl fmt::Debug for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Device")
            .field("profile", &self.profile.name)
            .field("scene", &self.scene.name)
            .field("time", &self.time())
            .finish_non_exhaustive()
    }
}

impl Device {
    pub(super) fn new(device: phasmid_device::Device) -> Self {
        Self {
            profile: device.profile.clone(),
            scene: device.scene.clone(),
            desk: Desk::new(device, Link::Identified),
            last: None,
        }
    }

    /// Returns the profile, with the changes of the builder.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// Returns the scene, with the changes of [`Self::place`].
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Returns the device time since power-on.
    pub fn time(&self) -> Duration {
        Duration::from_nanos(self.desk.now_ns())
    }

    /// Lets device time pass.
    pub fn wait(&mut self, time: Duration) {
        let ns = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        self.desk.run_until(self.desk.now_ns().saturating_add(ns));
    }

    /// Scans with a sequence of the device. It uses the device's port and camera as a host does, so
    /// the capture contains only data that a host receives.
    ///
    /// # Errors
    /// Returns an error if the device has no such sequence, or if the scan fails, for example
    /// because of a fault from which a host cannot recover.
    pub fn scan(&mut self, sequence: &str) -> Result<Capture> {
        self.scan_with(sequence, |_| ())
    }

    /// Scans as [`Self::scan`] does, and reports the progress. `progress` may return
    /// `ControlFlow::Break(())` to end the scan between two frames; [`Self::stop`] ends it even
    /// during a frame.
    ///
    /// # Errors
    /// Returns [`Error::Interrupted`] if the scan was ended, and the errors of [`Self::scan`].
    pub fn scan_with<F: Flow>(
        &mut self,
        sequence: &str,
        mut progress: impl FnMut(Progress<'_>) -> F,
    ) -> Result<Capture> {
        let known = self.sequences();
        if !known.iter().any(|name| name == sequence) {
            return Err(Error::input(
                "sequence",
                format!("{sequence:?}"),
                known.join(", "),
            ));
        }
        let dialect = self.profile.control.load_dialect(&self.profile.folder)?;
        let dialect = (dialect.name() != "scpi").then_some(dialect);
        let camera = || Ok(Intake::new(self.desk.camera()));
        let port = self.desk.port();
        let mut scanner = Scanner::with_dialect(port, dialect, PATIENCE, camera)?;
        let options = ScanOptions {
            sequence: Some(sequence.to_owned()),
            manifest: None,
            frame_timeout: PATIENCE,
        };
        let (stop, asked) = (self.stop(), self.stop().times());
        let captured = scanner.scan(&options, &mut progress);
        let finished = scanner.finish();
        let captured = captured?;
        finished?;
        if stop.times() != asked {
            return Err(Error::Interrupted);
        }
        self.last = Some(Last {
            sequence: self.desk.with(|device| device.shots()),
            scene: self.scene.clone(),
            moved: Vec::new(),
        });
        Ok(captured)
    }

    /// Returns a handle with which another thread ends a scan or the computation of a truth within
    /// a fraction of a second; the call then returns [`Error::Interrupted`].
    ///
    /// ```
    /// let mut device = phasmid::Device::builder().profile("webcam-grey").scene("plane").build()?;
    /// let stop = device.stop();
    /// stop.ask();
    /// assert!(matches!(device.scan("quick-4"), Err(phasmid::Error::Interrupted)));
    /// stop.reset();
    /// device.scan("quick-4")?;
    /// # Ok::<(), phasmid::Error>(())
    /// ```
    pub fn stop(&self) -> Stop {
        self.desk.with(|device| device.renderer.stop())
    }

    /// Returns the names of the device's sequences.
    pub fn sequences(&self) -> Vec<String> {
        self.desk.with(|device| {
            let names = device.machine.firmware().sequence_names();
            names.map(str::to_owned).collect()
        })
    }

    /// Sends bytes to the control port, lets device time pass until no operation is pending, and
    /// returns the replies.
    ///
    /// ```
    /// let mut device = phasmid::Device::builder().profile("webcam-grey").scene("plane").build()?;
    /// assert!(device.control(b"*IDN?\n").starts_with(b"Phasmid,webcam-grey,"));
    /// # Ok::<(), phasmid::Error>(())
    /// ```
    pub fn control(&mut self, bytes: &[u8]) -> Vec<u8> {
        self.desk.control(bytes)
    }

    /// Returns the calibration that the device reports: the factory calibration with its uncertainty, or
    /// the exact rig if the device was built to report that.
    ///
    /// # Errors
    /// Returns an error if the factory could not calibrate the device, which then reports no
    /// calibration.
    pub fn factory_calibration(&self) -> Result<Rig> {
        self.desk.with(|device| {
            let calibration = device.machine.firmware().factory_calibration();
            calibration.copied().map_err(Error::device)
        })
    }

    /// Returns the true rig, which no host knows.
    pub fn rig(&self) -> Rig {
        self.profile.nominal_rig()
    }

    /// Returns the truth of the last scan. If the scene moves, this is the truth at the middle of
    /// the scan.
    ///
    /// # Errors
    /// Returns an error if there has been no scan.
    pub fn truth(&mut self) -> Result<Truth> {
        self.truth_of(Renderer::truth)
    }

    /// Returns the truth of the last scan with the scene in its state at a device time.
    ///
    /// # Errors
    /// Same as [`Self::truth`].
    pub fn truth_at(&mut self, time: Duration) -> Result<Truth> {
        let time_ns = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        self.truth_of(|renderer, sequence| renderer.truth_at(sequence, time_ns))
    }

    /// Returns the truth of the last scan with the scene in its state in the middle of an exposure;
    /// `index` counts from 0.
    ///
    /// # Errors
    /// Returns the errors of [`Self::truth`], and an error if the sequence has no such frame.
    pub fn frame_truth(&mut self, index: usize) -> Result<Truth> {
        let frames = self.last.as_ref().map_or(0, |last| last.sequence.len());
        if frames > 0 && index >= frames {
            let allowed = format!("0 to {}", frames - 1);
            return Err(Error::input("frame", index, allowed));
        }
        self.truth_of(|renderer, sequence| {
            let shot = &sequence[index].1;
            let middle_ns = shot.start_ns + shot.end_ns().saturating_sub(shot.start_ns) / 2;
            renderer.truth_at(sequence, middle_ns)
        })
    }

    /// Computes a truth of the last scan, with each object where it was during that scan.
    fn truth_of(
        &mut self,
        of: impl FnOnce(&mut Renderer, &[(Pattern, Shot)]) -> Truth,
    ) -> Result<Truth> {
        let Some(last) = &self.last else {
            return Err(Error::device("no scan has been made that has a truth"));
        };
        self.desk.with(|device| {
            let (stop, asked) = (device.renderer.stop(), device.renderer.stop().times());
            place_all(&mut device.renderer, &last.scene, &last.moved)?;
            let truth = of(&mut device.renderer, &last.sequence);
            place_all(&mut device.renderer, &self.scene, &last.moved)?;
            stop.check()?;
            match stop.times() == asked {
                true => Ok(truth),
                false => Err(Error::Interrupted),
            }
        })
    }

    /// Moves an object of the scene; `object` counts from 0 in the scene's order. The position is
    /// in millimetres and the rotation in degrees, as in the scene's file.
    ///
    /// # Errors
    /// Returns an error if the object does not exist or the numbers are not finite; the scene is
    /// then unchanged.
    ///
    /// ```
    /// let mut device = phasmid::Device::builder().profile("webcam-grey").scene("plane").build()?;
    /// device.place(0, [0.0, 0.0, 900.0], [0.0, 10.0, 0.0])?;
    /// assert!(device.place(7, [0.0; 3], [0.0; 3]).is_err());
    /// # Ok::<(), phasmid::Error>(())
    /// ```
    pub fn place(
        &mut self,
        object: usize,
        position_mm: [f64; 3],
        rotation_deg: [f64; 3],
    ) -> Result<()> {
        self.desk.with(|device| {
            let renderer = &mut device.renderer;
            renderer.place(object, position_mm, rotation_deg)?;
            device.scene.place(object, position_mm, rotation_deg)
        })?;
        self.scene.place(object, position_mm, rotation_deg)?;
        if let Some(last) = &mut self.last
            && !last.moved.contains(&object)
        {
            last.moved.push(object);
        }
        Ok(())
    }

    /// Adds a fault, which may occur from now on, and returns its number.
    ///
    /// # Errors
    /// Returns an error if the fault does not apply to this device.
    ///
    /// ```
    /// use phasmid::profile::faults::{Fault, What};
    /// let mut device = phasmid::Device::builder().profile("webcam-grey").scene("plane").build()?;
    /// device.inject(Fault::once(What::Dropped, 3))?;
    /// device.scan("quick-4")?; // The host repeats the run.
    /// assert_eq!(device.struck().len(), 1);
    /// # Ok::<(), phasmid::Error>(())
    /// ```
    pub fn inject(&mut self, fault: Fault) -> Result<u64> {
        let added = self
            .desk
            .with(|device| device.machine.faults_mut().add(fault));
        added
            .map_err(|flaw| Error::input(format!("fault.{}", flaw.field), flaw.found, flaw.allowed))
    }

    /// Removes all faults.
    pub fn clear_faults(&mut self) {
        self.desk.with(|device| device.machine.faults_mut().clear());
    }

    /// Returns the faults that have occurred, in order.
    pub fn struck(&self) -> Vec<Struck> {
        self.desk
            .with(|device| device.machine.faults().struck().cloned().collect())
    }

    /// Serves the device on new threads, over a control port, a frame socket, and the further links
    /// that the options request. The device ends when the result is dropped.
    ///
    /// # Errors
    /// Returns an error if the run directory cannot be used, or if the system refuses a port, a socket,
    /// a V4L2 node or a USB device.
    ///
    /// ```
    /// # fn main() -> Result<(), phasmid::Error> {
    /// let device = phasmid::Device::builder().profile("webcam-grey").scene("plane").build()?;
    /// let serving = device.serve(&phasmid::ServeOptions::default())?;
    /// println!("{}", serving.endpoints().control.display());
    /// # Ok(())
    /// # }
    /// ```
    #[cfg(target_os = "linux")]
    pub fn serve(self, options: &ServeOptions) -> Result<Serving> {
        match self.desk.into_device() {
            Some(device) => device.serve(options),
            None => Err(Error::device(
                "a camera or port of the device is still open",
            )),
        }
    }
}

/// Moves objects to their places in a scene.
fn place_all(renderer: &mut Renderer, scene: &Scene, objects: &[usize]) -> Result<()> {
    objects.iter().try_for_each(|&at| {
        let object = &scene.object[at];
        renderer.place(at, object.position_mm, object.rotation_deg)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(scene: &str) -> Device {
        let mut profile = Profile::load("webcam-grey").unwrap();
        (profile.camera.width_px, profile.camera.height_px) = (160, 120);
        let builder = Device::builder().profile(profile);
        builder.scene(scene).seed(2).build().unwrap()
    }

    #[test]
    fn every_dialect_gives_the_same_scan() {
        let profile = device("plane").profile().clone();
        let scan = |dialect: &str| {
            let builder = Device::builder().profile(profile.clone()).scene("plane");
            let mut device = builder.seed(2).dialect(dialect).build().unwrap();
            device.scan("quick-4").unwrap()
        };
        let plain = device("plane").scan("quick-4").unwrap();
        for dialect in ["scpi", "okline", "dlpc350"] {
            let capture = scan(dialect);
            assert!(capture.images == plain.images, "{dialect}");
            assert_eq!(capture.manifest, plain.manifest, "{dialect}");
        }
    }

    #[test]
    fn truth_is_that_of_the_scan_also_after_a_move() {
        let mut device = device("plane");
        assert!(device.truth().is_err(), "nothing has been scanned");
        device.scan("quick-4").unwrap();
        let center = |truth: &Truth| truth.depth_mm[60 * 160 + 80];
        let before = center(&device.truth().unwrap());
        let rotation = device.scene().object[0].rotation_deg;
        let mut position = device.scene().object[0].position_mm;
        position[2] -= 100.0;
        device.place(0, position, rotation).unwrap();
        assert_eq!(center(&device.truth().unwrap()), before);
        assert_eq!(center(&device.frame_truth(3).unwrap()), before);
        let capture = device.scan("quick-4").unwrap();
        let moved = center(&device.truth().unwrap());
        assert!((before - moved - 100.0).abs() < 1.0, "{before} {moved}");
        let error = device.frame_truth(capture.images.len()).unwrap_err();
        assert!(error.to_string().contains("0 to 12"), "{error}");
        let error = device.scan("quick-5").unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("quick-4"), "{error}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn device_used_in_memory_is_served_from_its_time_and_scene_on() {
        use crate::{ScanOptions, Scanner};
        let mut device = device("plane");
        device.scan("quick-4").unwrap();
        let mut position = device.scene().object[0].position_mm;
        position[2] -= 100.0;
        device.place(0, position, [0.0; 3]).unwrap();
        // Let more device time pass than any timeout of a host.
        device.wait(Duration::from_secs(3600));
        let stop = device.stop();
        let serving = device.serve(&ServeOptions::default()).unwrap();
        // The handle that was taken before serving has no effect on the served device.
        stop.ask();
        let at = serving.endpoints();
        let options = ScanOptions {
            frame_timeout: Duration::from_secs(60),
            ..ScanOptions::default()
        };
        let mut scanner = Scanner::connect(&at.camera, &at.control, options).unwrap();
        let capture = scanner.scan().unwrap();
        assert!(capture.frames[0].exposure_start_ns > 3_600_000_000_000);
        let truth = scanner.truth().unwrap();
        let depth = f64::from(truth.depth_mm[60 * 160 + 80]);
        assert!((depth - position[2]).abs() < 1.0, "{depth}");
        scanner.finish().unwrap();
        serving.stop().unwrap();
    }
}
