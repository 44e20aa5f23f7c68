//! Saturation: the truth marks saturated pixels, and the host's mask marks the same pixels.

use phasmid::decode::{Decoded, Decoder, Options, Verdict};
use phasmid::emulator::{Device, MemorySink, Renderer, Shot, Truth};
use phasmid::pattern::{Image, Pattern, finest_fringe};
use phasmid::profile::{Profile, Scene};

/// Returns a profile for a wide range of light: a steep ball, far too bright at its centre, in front
/// of a dark plane.
fn profile(gain_dn_per_e: f64) -> Profile {
    let mut profile = Profile::load("pmp-bench").unwrap();
    profile.camera.data_line = false;
    profile.camera.sensor.noiseless = true;
    profile.camera.sensor.gain_dn_per_e = gain_dn_per_e;
    profile
}

/// Replies and frames of a device, and a host's decoding of them.
struct Seen {
    sequence: Vec<(Pattern, Shot)>,
    truth: Truth,
    decoded: Decoded,
    renderer: Renderer,
}

fn see(profile: &Profile, commands: &str) -> Seen {
    let scene = Scene::load("sphere").unwrap();
    let device = Device::builder(profile, &scene).seed(1).build().unwrap();
    let mut bench = device.bench(MemorySink::default());
    let line = format!("TRIG:SOUR BUS;:{commands};:INIT;*TRG\nSYST:ERR?\n");
    assert_eq!(bench.control(line.as_bytes()), b"0,\"No error\"\n");
    let sequence = bench.firmware().selected_sequence();
    // An IEEE 488.2 block: #, the number of digits of the length, the length, the text.
    let block = String::from_utf8(bench.control(b"CAL:DATA?\n")).unwrap();
    let digits: usize = block[1..2].parse().unwrap();
    let calibration = &block[2 + digits..];
    let rig = phasmid::geometry::Rig::from_toml(calibration, "CAL:DATA?").unwrap();
    let manifest = profile.manifest(&profile.sequence[0]);
    let frames = &bench.sink.frames;
    let (w, h) = (frames[0].width as usize, frames[0].height as usize);
    let images: Vec<_> = frames
        .iter()
        .map(|f| Image::new(w, h, f.data.clone()).unwrap())
        .collect();
    let decoder = Decoder::new(&manifest, w, h, Some(&rig), Options::default()).unwrap();
    let mut renderer = bench.into_device().renderer;
    Seen {
        truth: renderer.truth(&sequence),
        decoded: decoder.decode(&images).unwrap(),
        sequence,
        renderer,
    }
}

impl Seen {
    /// Checks that the host's mask and the truth mark the same pixels, and returns their number.
    fn agreed(&self) -> usize {
        let verdict = &self.decoded.x.as_ref().unwrap().verdict;
        for (i, flags) in self.truth.flags.iter().enumerate() {
            let told = flags & Truth::SATURATED != 0;
            assert_eq!(
                told,
                verdict[i] == Verdict::Saturated,
                "{i}: {:?}",
                verdict[i]
            );
        }
        let flags = self.truth.flags.iter();
        flags.filter(|f| **f & Truth::SATURATED != 0).count()
    }
}

/// Truth and mask mark the pixels that the linearity of light predicts: a sixteenth of the exposure
/// saturates no pixel, and sixteen times its signal shows which pixels would saturate. Tested with
/// the limit at the full well, at the converter, and at both.
#[test]
fn truth_and_mask_name_the_pixels_that_would_be_beyond_full() {
    for (gain, last) in [(0.0239, 254.0), (0.05, 255.0), (0.01805, 193.0)] {
        let profile = profile(gain);
        let mut seen = see(&profile, "SEQ:PER 40ms;:CAM:EXP 16ms");
        let count = seen.agreed();
        assert!((2000..200_000).contains(&count), "{gain}: {count}");
        let finest = finest_fringe(seen.sequence.iter().map(|(pattern, _)| pattern));
        let mut brightest = vec![0.0f64; seen.truth.flags.len()];
        for (pattern, shot) in &seen.sequence {
            let fine = matches!(*pattern, Pattern::Fringe { axis, period_px, .. }
                if finest == Some((axis, period_px)));
            if !fine {
                continue;
            }
            let short = seen.renderer.expected_dn(&Shot {
                exposure_ns: shot.exposure_ns / 16,
                ..shot.clone()
            });
            for (most, dn) in brightest.iter_mut().zip(short) {
                *most = most.max(4.0 + 16.0 * (f64::from(dn) - 4.0));
            }
        }
        let mut near = 0;
        for (i, most) in brightest.iter().enumerate() {
            if (most - (last - 0.5)).abs() < 1e-2 {
                near += 1;
                continue;
            }
            let told = seen.truth.flags[i] & Truth::SATURATED != 0;
            assert_eq!(told, *most >= last - 0.5, "{gain}, {i}: {most}");
        }
        assert!(near < 100, "{near}");
    }
}

#[test]
fn no_pixel_saturates_in_darkness_and_all_do_in_excess_light() {
    let profile = profile(0.0239);
    let dark = see(&profile, "PROJ:POW OFF");
    assert_eq!(dark.agreed(), 0);
    assert_eq!(
        (0..dark.truth.flags.len())
            .filter(|&i| dark.decoded.is_valid(i))
            .count(),
        0
    );
    let bright = see(&profile, "SEQ:PER 2;:CAM:EXP 1");
    let lit = Truth::LIT | Truth::SEEN;
    let flags = &bright.truth.flags;
    bright.agreed();
    for (i, flags) in flags.iter().enumerate().filter(|(_, f)| **f & lit == lit) {
        assert!(flags & Truth::SATURATED != 0, "{i}");
        assert!(!bright.decoded.is_valid(i), "{i}");
    }
}
