//! `phasmid profile`: lists and prints the built-in profiles and checks profile files.

use super::options::SetArgs;
use phasmid_core::error::Result;
use phasmid_core::source::TomlSource;
use phasmid_decode::Plan;
use phasmid_geometry::{Lens, Rig};
use phasmid_profile::{
    Configuration, Control, Parity, Profile, Scene, Settings, Station, profile_names, station_names,
};
use phasmid_protocol::dialect::Dialect;
use phasmid_study::sampling::{Sampling, TILT_DEG};
use std::path::Path;

/// Range of depths in which a point that lies in both fields of view is searched.
const FIELDS_MM: [f64; 2] = [10.0, 1e6];
/// Number of camera rays per row and per column of a grid over the image; points in both fields of
/// view are searched along these rays.
const FIELD_RAYS: u32 = 17;
/// Ratio of successive depths that are tried along a ray.
const FIELD_STEP: f64 = 1.02;

/// List, print or check device profiles.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// List the built-in profiles and stations.
    #[command(after_help = "Example:\n  phasmid profile list")]
    List,
    /// Print a profile or station, as a starting point for your own.
    #[command(after_help = "Example:\n  phasmid profile show webcam-grey > mine.toml")]
    Show {
        /// Built-in name, or path of a TOML file.
        name: String,
        /// Merge the documents that it extends, and print the result without comments; implied by
        /// --set.
        #[arg(long)]
        full: bool,
        #[command(flatten)]
        set: SetArgs,
    },
    /// Check a profile, station or dialect and summarise it.
    #[command(after_help = "Example:\n  phasmid profile check mine.toml")]
    Check {
        /// Path of a TOML file, or a built-in name.
        file: String,
        #[command(flatten)]
        set: SetArgs,
    },
}

pub(super) fn run(args: &Args) -> Result<()> {
    match &args.action {
        Action::List => {
            for name in profile_names().chain(station_names()) {
                let description = match Configuration::load(name)? {
                    Configuration::Device(profile) => profile.description,
                    Configuration::Station(station) => station.description,
                };
                println!("{name:<16}{description}");
            }
        }
        Action::Show { name, full, set } => {
            let settings = set.of_profile()?;
            if set.is_some()
                && let Configuration::Station(_) = Configuration::load(name)?
            {
                set.refuse(&format!("{name} is a station: its devices have profiles"))?;
            }
            match *full || set.is_some() {
                true => print!("{}", Configuration::full_text(name, &settings)?),
                false => print!("{}", Configuration::text(name)?),
            }
        }
        Action::Check { file, set } if names_dialect(file)? => {
            set.refuse(&format!("{file} is a dialect"))?;
            super::dialect::check(file, Dialect::load(file)?)?;
        }
        Action::Check { file, set } => match Configuration::load_with(file, &set.settings()?)? {
            Configuration::Device(profile) => {
                set.of_profile()?;
                super::dialect::port(&profile)?;
                println!("{file}: ok");
                describe(&profile);
                describe_factory(&profile);
                warn_of_fields(file, &profile);
                match Sampling::of(&profile) {
                    Ok(found) => describe_sampling(&found),
                    // This is not an error of the profile: its pattern images may be missing on
                    // this machine.
                    Err(why) => println!("  precision   not measured: {why}"),
                }
            }
            Configuration::Station(station) => {
                if station.scene().is_none() {
                    set.of_profile()?;
                }
                check_station(file, &station, &set.settings()?)?;
            }
        },
    }
    Ok(())
}

/// Checks a station's devices and scene, and prints a summary.
fn check_station(file: &str, station: &Station, settings: &Settings) -> Result<()> {
    let profiles: Vec<Profile> = station
        .device
        .iter()
        .map(|device| {
            let profile = super::dialect::profile_of(station, device, settings)?;
            super::dialect::port(&profile).map(|_| profile)
        })
        .collect::<Result<_>>()?;
    let scene = station.scene();
    if let Some(scene) = &scene {
        Scene::load_with(scene, settings)?;
    }
    println!("{file}: ok");
    println!("  name        {}", station.name);
    println!(
        "  scene       {}",
        scene.as_deref().unwrap_or("given on the command line")
    );
    for (device, profile) in station.device.iter().zip(&profiles) {
        let place = match device.rig() {
            Some(rig) => format!(
                "at {:?} mm, turned {:?} degrees",
                rig.position_mm, rig.rotation_deg
            ),
            None => "at the pose of the scene's rig".to_owned(),
        };
        println!(
            "  device      {}: {}, {place}, {}",
            device.name,
            profile.name,
            line(&profile.control)
        );
        warn_of_fields(&device.name, profile);
    }
    Ok(())
}

/// Warns if the camera sees nothing that the projector lights.
fn warn_of_fields(place: &str, profile: &Profile) {
    let [near_mm, far_mm] = FIELDS_MM;
    if !fields_meet(&profile.nominal_rig()) {
        eprintln!(
            "phasmid: {place}: the fields of view of camera and projector do not meet from {near_mm} mm to \
             {} m: no point can be measured; check projector.position_mm and projector.rotation_deg",
            far_mm / 1000.0
        );
    }
}

/// Returns whether any point within [`FIELDS_MM`] is in both fields of view.
fn fields_meet(rig: &Rig) -> bool {
    let Rig {
        camera, projector, ..
    } = rig;
    let [near_mm, far_mm] = FIELDS_MM;
    let part = |step: u32| f64::from(step) / f64::from(FIELD_RAYS - 1);
    let mut pixels = (0..FIELD_RAYS.pow(2)).map(|ray| {
        let [across, down] = [ray % FIELD_RAYS, ray / FIELD_RAYS].map(part);
        [
            across * f64::from(camera.lens.width_px - 1),
            down * f64::from(camera.lens.height_px - 1),
        ]
    });
    let depths_mm = std::iter::successors(Some(near_mm), |depth| Some(depth * FIELD_STEP));
    let depths_mm: Vec<f64> = depths_mm.take_while(|depth| *depth <= far_mm).collect();
    pixels.any(|px| {
        let (from, ray) = (camera.center_mm(), camera.ray(px));
        depths_mm.iter().any(|depth| {
            let lit = projector.project([0, 1, 2].map(|axis| from[axis] + depth * ray[axis]));
            lit.is_some_and(|px| projector.lens.contains(px))
        })
    })
}

/// Formats a lens's focal length in pixels: one number for square pixels, fx and fy for others.
fn focal_length(lens: &Lens) -> String {
    let [fx, fy] = lens.focal_px.to_array();
    if fx == fy {
        format!("{fx:.2} px")
    } else {
        format!("{fx:.2} px (fx), {fy:.2} px (fy)")
    }
}

/// Prints what the device reports as its calibration.
fn describe_factory(profile: &Profile) {
    match profile.factory_rig() {
        Ok(Rig {
            covariance: Some(_),
            ..
        }) => println!(
            "  factory     calibrated with corners of {} px",
            profile.factory_calibration.corner_px
        ),
        Ok(_) => println!("  factory     the exact calibration"),
        // This is not an error of the profile: the device works, and its user can calibrate it.
        Err(why) => println!("  factory     no calibration: {why}"),
    }
}

fn describe(profile: &Profile) {
    let Profile {
        camera, projector, ..
    } = profile;
    println!("  name        {}", profile.name);
    println!(
        "  camera      {} x {}, focal length {}, {}",
        camera.width_px,
        camera.height_px,
        focal_length(&camera.view().lens),
        camera.format.name(),
    );
    println!(
        "  projector   {} x {}, focal length {}, baseline {:.1} mm",
        projector.width_px,
        projector.height_px,
        focal_length(&projector.view().lens),
        projector.view().center().length(),
    );
    println!("  control     {}", line(&profile.control));
    if let Some(readout_us) = camera.readout_us {
        println!("  readout     {readout_us} us of a frame");
    }
    if let Some(interval_us) = camera.shortest_interval_us {
        println!("  frames      no closer than {interval_us} us");
    }
    if let Some(timing) = &projector.timing {
        println!(
            "  timing      steps of {} us, exposures from {} us ({} bits), as long as the period or at least {} us shorter",
            timing.resolution_us,
            timing.min_exposure_us[projector.bits as usize - 1],
            projector.bits,
            timing.margin_us,
        );
    }
    if let Some(led) = &projector.led {
        let droop: f64 = led.droop.iter().map(|droop| droop.fraction).sum();
        println!(
            "  light       rises in {} us, loses {:.0} % as it warms",
            led.rise_us,
            100.0 * droop
        );
    }
    for sequence in &profile.sequence {
        println!(
            "  sequence    {}: {} frames, one every {} us",
            sequence.name,
            sequence.frame.len(),
            sequence.period_us
        );
        // This is not an error, because a sequence need not be meant for decoding.
        if let Err(why) = Plan::new(&profile.manifest(sequence)) {
            println!("              cannot be decoded: {why}");
        }
    }
}

/// Prints noise and held projector pixels of a trial scan, with the decoder's notes.
fn describe_sampling(found: &Option<Sampling>) {
    let Some(found) = found else { return };
    let Sampling {
        distance_mm,
        sigma_px,
        sampling_px,
        notes,
    } = found;
    let px = |value: &Option<f32>| value.map_or("-".to_owned(), |px| format!("{px:.4} px"));
    println!(
        "  precision   grey plane at {distance_mm:.0} mm, turned {TILT_DEG} degrees: sigma {}, held pixels {}",
        px(sigma_px),
        px(sampling_px),
    );
    for note in notes {
        println!("  note        {note}");
    }
}

/// Describes the dialect and the serial settings of a control port.
fn line(control: &Control) -> String {
    match control.baud {
        Some(baud) => {
            let parity = match control.parity {
                Parity::None => 'N',
                Parity::Odd => 'O',
                Parity::Even => 'E',
                Parity::Mark => 'M',
                Parity::Space => 'S',
            };
            let (bits, stops) = (control.data_bits, control.stop_bits);
            format!("{} at {baud} baud, {bits}{parity}{stops}", control.dialect)
        }
        None => format!("{} on a line without delay", control.dialect),
    }
}

/// Returns whether a name or a path denotes a dialect rather than a profile or station. A file is a
/// dialect if it has the key `framing`.
pub(super) fn names_dialect(file: &str) -> Result<bool> {
    if profile_names().any(|name| name == file) {
        return Ok(false);
    }
    let shipped = Dialect::names().any(|name| name == file);
    let path = Path::new(file);
    Ok(shipped || path.is_file() && TomlSource::read(path)?.has("framing"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_the_built_in_profiles_meet() {
        for name in profile_names() {
            let mut profile = Profile::load(name).unwrap();
            assert!(fields_meet(&profile.nominal_rig()), "{name}");
            profile.projector.rotation_deg[1] += 180.0;
            assert!(!fields_meet(&profile.nominal_rig()), "{name}, turned away");
        }
    }
}
