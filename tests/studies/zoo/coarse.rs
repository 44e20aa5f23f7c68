//! Gray code whose finest bits the camera does not resolve: the bits that can be read are used.

use crate::zoo::measure::Scan;
use phasmid::emulator::Truth;
use std::fmt::Write;

/// Distance of the scene in mm.
const DISTANCE: f64 = 500.0;

/// Where the blur comes from.
#[derive(Clone, Copy, Debug)]
enum Blur {
    Camera,
    Projector,
}

/// A Gray code.
#[derive(Clone, Copy, Debug)]
struct Code {
    cell_px: u32,
    /// Each bit is followed by its complement; otherwise white and black follow the code.
    pairs: bool,
    /// Fringes of 16 px precede the code.
    fringes: bool,
}

/// A device whose camera or projector is focused far in front of the scene. The disc of blur has a
/// diameter of `disc_px` projector pixels at the scene's distance.
fn device(blur: Blur, disc_px: f64, code: Code) -> String {
    let (wide, focal_px) = (1024.0, 1.4 * 1024.0);
    // A camera pixel spans 1.2 projector pixels.
    let camera_focal_px = focal_px / 1.2;
    let sensor_mm = 8.0 * 640.0 / camera_focal_px;
    // See phasmid::profile::Focus: both are focused at half the distance.
    let aperture_mm = disc_px * DISTANCE / focal_px;
    let f_number = match blur {
        Blur::Camera => 8.0 / aperture_mm,
        Blur::Projector => 8.0,
    };
    // Half of the range at the scene's distance.
    let intensity = 0.0075 * f_number.powi(2);
    let mut text = format!(
        "name = \"coarse\"\ndescription = \"Gray code that is too fine\"\n[identity]\n\
         manufacturer = \"Zoo\"\nmodel = \"coarse\"\nserial = \"1\"\nfirmware = \"1\"\n\
         [camera]\nwidth_px = 640\nheight_px = 480\nfocal_length_mm = 8.0\n\
         sensor_width_mm = {sensor_mm:.5}\nf_number = {f_number:.4}\nformat = \"GREY\"\n\
         exposure_us = 8000.0\nexposure_range_us = [20.0, 1000000.0]\nmax_gain_db = 12.0\n\
         frame_interval_us = 20000.0\n"
    );
    if let Blur::Camera = blur {
        writeln!(text, "focus_mm = {:?}", DISTANCE / 2.0).unwrap();
    }
    write!(
        text,
        "[camera.sensor]\nquantum_efficiency = 0.6\nfull_well_e = 10000.0\nread_noise_e = 5.0\n\
         gain_dn_per_e = 0.025\nblack_level_dn = 4.0\nbits = 8\n\
         [projector]\nwidth_px = {wide}\nheight_px = 768\nthrow_ratio = 1.4\n\
         position_mm = [120.0, 0.0, 0.0]\nlens_shift_px = [{:.3}, 0.0]\nbits = 8\n\
         radiant_intensity_w_sr = {intensity:.6}\nwavelength_nm = 530.0\n",
        focal_px * 120.0 / DISTANCE
    )
    .unwrap();
    if let Blur::Projector = blur {
        writeln!(
            text,
            "focus = {{ distance_mm = {:?}, aperture_mm = {aperture_mm:.4} }}",
            DISTANCE / 2.0
        )
        .unwrap();
    }
    text += "[[sequence]]\nname = \"coarse\"\nperiod_us = 20000.0\n";
    let mut frame = |pattern: String| {
        writeln!(text, "[[sequence.frame]]\npattern = {{ {pattern} }}").unwrap();
    };
    for step in 0..if code.fringes { 4 } else { 0 } {
        let phase = std::f64::consts::FRAC_PI_2 * f64::from(step);
        frame(format!(
            "kind = \"fringe\", axis = \"x\", period_px = 16.0, phase_rad = {phase:.12}"
        ));
    }
    let (cell, bits) = (code.cell_px, (1024 / code.cell_px).ilog2());
    for bit in (0..bits).rev() {
        for inverted in [false, true].into_iter().take(1 + usize::from(code.pairs)) {
            frame(format!(
                "kind = \"gray\", axis = \"x\", cell_px = {cell}.0, bits = {bits}, bit = {bit}, \
                 inverted = {inverted}"
            ));
        }
    }
    if !code.pairs {
        frame("kind = \"white\"".to_owned());
        frame("kind = \"black\"".to_owned());
    }
    text
}

/// A tilted plane with a sphere in front of it.
fn scene() -> String {
    format!(
        "name = \"coarse\"\ndescription = \"A plane and a sphere\"\n\
         [[object]]\nshape = {{ kind = \"plane\" }}\nposition_mm = [0.0, 0.0, {DISTANCE:?}]\n\
         rotation_deg = [4.0, 12.0, 0.0]\nalbedo = 0.6\n\
         [[object]]\nshape = {{ kind = \"sphere\", radius_mm = 40.0 }}\n\
         position_mm = [20.0, 10.0, {:?}]\nalbedo = 0.6\n",
        DISTANCE - 20.0
    )
}

/// Results of a scan: fraction of the lit pixels with a coordinate, RMS of error / sigma over errors
/// within five sigma, fraction of errors beyond, and the median sigma in projector pixels.
struct Found {
    coverage: f64,
    ratio: f64,
    beyond: f64,
    sigma: f32,
    notes: String,
}

fn scan(profile: &str) -> Found {
    let scan = Scan::new(profile, &scene(), 1);
    let map = scan.decoded.x.as_ref().unwrap();
    let wanted = Truth::SEEN | Truth::LIT | Truth::SQUARE;
    let not = Truth::CREASE | Truth::SATURATED;
    let lit = (0..map.sigma.len()).filter(|&i| scan.truth.flags[i] & (wanted | not) == wanted);
    let (mut all, mut errors, mut sigmas) = (0, Vec::new(), Vec::new());
    for i in lit {
        all += 1;
        if !map.coordinate[i].is_nan() {
            let error = f64::from(map.coordinate[i] - scan.truth.projector_x[i]);
            errors.push(error.abs() / f64::from(map.uncertainty(i)));
            sigmas.push(map.sigma[i]);
        }
    }
    assert!(all > 200_000, "{all} lit pixels");
    let points = errors.len() as f64;
    let within: Vec<_> = errors.iter().filter(|error| **error <= 5.0).collect();
    let squares: f64 = within.iter().map(|error| *error * *error).sum();
    let middle = sigmas.len() / 2;
    sigmas.sort_by(f32::total_cmp);
    Found {
        coverage: points / f64::from(all),
        ratio: (squares / within.len() as f64).sqrt(),
        beyond: 1.0 - within.len() as f64 / points,
        sigma: sigmas[middle],
        notes: scan.decoded.notes.join("; "),
    }
}

#[test]
fn gray_bits_that_the_camera_does_not_resolve_are_left_out() {
    let code = |cell_px, pairs, fringes| Code {
        cell_px,
        pairs,
        fringes,
    };
    let codes = [
        code(1, false, false),
        code(1, true, false),
        code(1, false, true),
        code(1, true, true),
        code(2, false, true),
    ];
    for blur in [Blur::Camera, Blur::Projector] {
        for (disc, most_resolved) in [(1.0, 1), (4.0, 2), (10.0, 8)] {
            for code in codes {
                let found = scan(&device(blur, disc, code));
                let place = format!(
                    "{blur:?} disc {disc} px {code:?}: coverage {:.4} error / sigma {:.3} beyond \
                     {:.5} sigma {:.3} px {}",
                    found.coverage, found.ratio, found.beyond, found.sigma, found.notes
                );
                println!("{place}");
                assert!(found.coverage >= 0.97, "{place}");
                assert!(found.beyond <= 0.001, "{place}");
                let left_out = found.notes.contains("left out (contrast of the finest");
                assert_eq!(left_out, code.cell_px < most_resolved, "{place}");
                if code.fringes {
                    assert!((0.9..=1.15).contains(&found.ratio), "{place}");
                } else {
                    // Half a cell is the largest error, but blur shows more of the place of an edge.
                    assert!(found.ratio <= 1.0, "{place}");
                    let cells = f64::from(found.sigma) * 12f64.sqrt();
                    assert!(cells < 1.01 * f64::from(most_resolved), "{place}");
                }
            }
        }
    }
}
