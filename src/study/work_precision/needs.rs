//! Scenes that need a term: the paper's bench in front of its torso, with a typical parameter for the
//! term.

use image::{GrayImage, ImageFormat, Luma};
use phasmid_core::error::{Error, Result};
use phasmid_profile::{
    CameraResponse, Flicker, Focus, Glare, Light, Profile, Response, Scene, Specular,
};
use phasmid_render::Term;
use std::io::Cursor;

/// Name of the texture's file.
pub const CHECKS: &str = "checks.png";

/// Gives profile and scene a typical parameter of a term. A texture is [`checks`], stored as [`CHECKS`]
/// in the scene's folder.
pub fn need(term: Term, profile: &mut Profile, scene: &mut Scene) {
    let (camera, projector) = (&mut profile.camera, &mut profile.projector);
    let flicker = Some(Flicker {
        frequency_hz: 100,
        depth: 0.3,
        phase_deg: 0.0,
    });
    match term {
        Term::CameraDistortion => camera.distortion = [-0.1, 0.03, 5e-4, -3e-4, 0.0],
        Term::ProjectorDistortion => projector.distortion = [-0.05, 0.02, 3e-4, 4e-4, 0.0],
        Term::CameraVignetting => camera.vignetting.natural = true,
        Term::ProjectorVignetting => projector.vignetting.natural = true,
        Term::ProjectorDefocus => {
            projector.focus = Some(Focus {
                distance_mm: 1000.0,
                aperture_mm: 6.0,
            });
        }
        Term::DepthOfField => {
            camera.f_number = 4.0;
            camera.focus_mm = Some(1000.0);
        }
        Term::AlbedoMaps => {
            for object in &mut scene.object {
                object.texture = Some(CHECKS.into());
                object.texture_size_mm = Some([100.0, 100.0]);
            }
        }
        Term::Specular => {
            for object in &mut scene.object {
                object.specular = Some(Specular {
                    f0: 0.028,
                    roughness: 0.5,
                });
            }
        }
        Term::Lights => scene.light.push(Light::Point {
            position_mm: [-300.0, -500.0, 200.0],
            intensity_w_sr: 0.1,
            flicker: None,
        }),
        Term::Subsurface => {
            for object in &mut scene.object {
                object.skin = Some(toml::from_str("fitzpatrick = 2").expect("constant text"));
            }
        }
        Term::Interreflection => {
            let bounce = toml::from_str("samples = 64").expect("constant text");
            scene.interreflection = Some(bounce);
        }
        // The object moves by 10 mm, as in a breath; geometry is traced at four instants per frame.
        Term::Motion => {
            let motion = "period_s = 4\n[[keyframes]]\ntime_s = 0\n\
                          [[keyframes]]\ntime_s = 2\nposition_mm = [0, 0, -10]";
            scene.object[1].motion = Some(toml::from_str(motion).expect("constant text"));
        }
        Term::ProjectorResponse => projector.response = Some(Response::Gamma(2.2)),
        Term::ContrastRatio => projector.contrast_ratio = Some(800.0),
        Term::Flicker => scene.ambient.flicker = flicker,
        // Half of the rows also see the next pattern image.
        Term::RollingShutter => camera.line_time_us = 8.0,
        // Patterns last as long as their exposures, so the number of passes does not change.
        Term::PatternTiming => {
            let led = "rise_us = 5\ndroop = [{ time_constant_s = 60, fraction = 0.1 }]";
            projector.led = Some(toml::from_str(led).expect("constant text"));
        }
        Term::Glare => {
            camera.glare = Some(Glare {
                percent: 2.0,
                sigma_px: 40.0,
            });
        }
        Term::DarkCurrent => camera.sensor.dark_current_e_s = 20.0,
        Term::FixedPattern => {
            camera.sensor.prnu_percent = 0.5;
            camera.sensor.dsnu_e = 1.5;
        }
        Term::Blooming => camera.sensor.blooming_percent = 5.0,
        Term::CameraResponse => camera.sensor.response = CameraResponse::Gamma { gamma: 2.2 },
        // The bench already has these terms, or no parameter switches them on.
        _ => {}
    }
}

/// A texture of light and dark squares, as a PNG file.
///
/// # Errors
/// Returns no error, as long as images can be encoded in memory.
pub fn checks() -> Result<Vec<u8>> {
    let square = |u: u32, v: u32| {
        let light = (u / 32 + v / 32).is_multiple_of(2);
        Luma([if light { 255 } else { 90 }])
    };
    let mut file = Cursor::new(Vec::new());
    GrayImage::from_fn(512, 512, square)
        .write_to(&mut file, ImageFormat::Png)
        .map_err(|e| Error::device(format!("{CHECKS}: {e}")))?;
    Ok(file.into_inner())
}
