//! Objects of a scene: shapes, poses, surfaces.

use super::motion::{self, Deform, Motion};
use glam::DVec3;
use phasmid_core::check::Check;
use phasmid_core::error::Result;
use phasmid_geometry::{Board, Pose, shapes};
use phasmid_phantom::tissue::{self as skin, Skin};
use phasmid_phantom::{self as phantom, Day, Patient};
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// Allowed coordinates of an object's origin in millimetres.
pub(super) const POSITION_MM: RangeInclusive<f64> = -1e9..=1e9;
/// Allowed rotations of an object in degrees.
pub(super) const ROTATION_DEG: RangeInclusive<f64> = -360.0..=360.0;

/// A shape with its pose and surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Object {
    /// Shape in the object's own frame.
    pub shape: Shape,
    /// Position of the origin in the scene's frame in millimetres.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub position_mm: [f64; 3],
    /// Rotation in degrees about the fixed x, then y, then z axis.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub rotation_deg: [f64; 3],
    /// Scale factor, applied before rotation and position.
    #[serde(default = "one")]
    pub scale: f64,
    /// Diffuse (Lambertian) reflectance, 0 to 1; for skin, a factor on the reflectance that follows
    /// from its coefficients.
    #[serde(default = "albedo")]
    pub albedo: f64,
    /// Subsurface scattering: fringes lose contrast and oblique light emerges shifted. When absent,
    /// light is reflected where it hits.
    #[serde(default)]
    pub skin: Option<Skin>,
    /// Whether the albedo is multiplied by the interpolated reflectance of the mesh's vertex
    /// colours: their sRGB luminance, at any wavelength.
    #[serde(default)]
    pub vertex_colours: bool,
    /// Texture image (PNG, BMP, TIFF or JPEG, at most 4096 pixels a side, relative to the scene
    /// file) by which the albedo is multiplied: its sRGB luminance, at any wavelength.
    /// Nearest-neighbour sampling; the texture repeats.
    #[serde(default)]
    pub texture: Option<PathBuf>,
    /// Width and height of the texture on the shape, in millimetres of the object's frame after
    /// scaling. It is mapped by longitude and latitude on a sphere, by angle and y on a cylinder,
    /// and along x and y on any other shape. When absent, a mesh uses its own texture coordinates.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly_if_any")]
    pub texture_size_mm: Option<[f64; 2]>,
    /// Specular lobe on top of the diffuse reflection; none when absent.
    #[serde(default)]
    pub specular: Option<Specular>,
    /// Rigid motion; at rest when absent.
    #[serde(default)]
    pub motion: Option<Motion>,
    /// Mesh deformation; rigid when absent.
    #[serde(default)]
    pub deform: Option<Deform>,
}

impl Object {
    /// Returns whether the object moves or deforms.
    pub fn moves(&self) -> bool {
        self.motion.as_ref().is_some_and(Motion::goes_anywhere)
            || self.deform.is_some()
            || self.shape.breathes()
    }
}

fn one() -> f64 {
    1.0
}
/// Albedo of white paint and of many plastics.
fn albedo() -> f64 {
    0.8
}

/// Shapes in their own frame, in millimetres. Solids rest on the plane z = 0 and extend towards -z,
/// that is, towards a camera looking along +z.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Shape {
    /// The plane z = 0, infinite or a rectangle centred on the origin.
    Plane {
        /// Sides along x and y; infinite when absent.
        #[serde(default, deserialize_with = "phasmid_core::numbers::exactly_if_any")]
        size_mm: Option<[f64; 2]>,
    },
    /// A calibration board: a sheet in the plane z = 0, centred on its grid, x along increasing
    /// columns and y along increasing rows. The side facing -z is printed.
    Board {
        /// Printed pattern, with its lengths before the object's scale is applied.
        board: Board,
        /// Reflectance of ink relative to the paper, whose reflectance is the albedo: 0 to 1.
        #[serde(default = "ink")]
        ink: f64,
    },
    /// A sphere centred on the origin.
    Sphere {
        /// Radius.
        radius_mm: f64,
    },
    /// A closed cylinder centred on the origin, its axis along y.
    Cylinder {
        /// Radius.
        radius_mm: f64,
        /// Length along y.
        length_mm: f64,
    },
    /// A square frustum, its base at z = 0 and its top at z = -height.
    Frustum {
        /// Side of the base.
        base_mm: f64,
        /// Side of the top.
        top_mm: f64,
        /// Height.
        height_mm: f64,
    },
    /// A generated human torso lying on its back.
    Torso {
        /// Variation of the body.
        #[serde(default)]
        seed: u64,
        /// Size along y.
        #[serde(default = "torso_length")]
        length_mm: f64,
        /// Size along x.
        #[serde(default = "torso_width")]
        width_mm: f64,
        /// Size along z.
        #[serde(default = "torso_depth")]
        depth_mm: f64,
        /// Approximate number of triangles.
        #[serde(default = "torso_triangles")]
        triangles: u32,
    },
    /// A generated treatment couch top.
    Couch {},
    /// A generated head of a C-arm linear accelerator with its arm and drum, in the IEC 61217 fixed
    /// frame about the isocentre at gantry angle 0: head above the patient, drum towards +y. With
    /// `position_mm` at the isocentre, the `rotation_deg` about y is the gantry angle.
    #[serde(rename = "linac-head")]
    LinacHead {},
    /// A generated breathing patient, in the patient's frame: x to the patient's left, y to the
    /// back, z to the head, origin at the planning isocentre, which is the centre of the tumour.
    /// The skin comes from the patient's file unless the object sets its own.
    Patient {
        /// A built-in patient, or a file relative to the scene file.
        patient: String,
        /// Day: as planned, or as treated with that day's set-up error, drift and breathing depth.
        #[serde(default = "treatment")]
        day: Day,
        /// Breath held at this planning phase, in per cent of the cycle from end-inhale; free
        /// breathing when absent.
        #[serde(default)]
        held_percent: Option<f64>,
        /// Approximate number of triangles of the skin.
        #[serde(default = "patient_triangles")]
        triangles: u32,
    },
    /// A triangle mesh from a file.
    Mesh {
        /// STL, OBJ or PLY file, relative to the scene file.
        file: PathBuf,
    },
}

fn treatment() -> Day {
    Day::Treatment
}
fn patient_triangles() -> u32 {
    phantom::SKIN_TRIANGLES
}
fn ink() -> f64 {
    0.06
}
fn torso_length() -> f64 {
    500.0
}
fn torso_width() -> f64 {
    380.0
}
fn torso_depth() -> f64 {
    220.0
}
fn torso_triangles() -> u32 {
    65_000
}

impl Shape {
    /// Loads the patient, with file paths relative to `folder`; `None` for any other shape.
    ///
    /// # Errors
    /// Returns an error if the name is neither built in nor a file, or if [`Patient::parse`] fails.
    pub fn patient(&self, folder: &Path) -> Result<Option<Patient>> {
        let Self::Patient { patient, .. } = self else {
            return Ok(None);
        };
        let built_in = phantom::patient_names().any(|name| name == patient);
        let path = folder.join(patient);
        let name = match built_in {
            true => patient.clone(),
            false => path.display().to_string(),
        };
        Patient::load(&name).map(Some)
    }

    /// Returns whether the shape is a freely breathing patient.
    pub fn breathes(&self) -> bool {
        let held = |held: &Option<f64>| held.is_some();
        matches!(self, Self::Patient { held_percent, .. } if !held(held_percent))
    }
}

impl Object {
    /// If the shape is a patient, sets the object's skin from the patient's file, unless the object
    /// has its own skin.
    ///
    /// # Errors
    /// Returns an error if [`Shape::patient`] fails.
    pub(super) fn settle(&mut self, folder: &Path) -> Result<()> {
        if let Some(patient) = self.shape.patient(folder)?
            && self.skin.is_none()
        {
            self.skin = Some(patient.skin);
        }
        Ok(())
    }

    /// Returns the specular lobe; `None` if `f0` is 0, that is, if the refractive index equals that
    /// of air.
    pub fn lobe(&self) -> Option<Specular> {
        self.specular.filter(|specular| specular.f0 > 0.0)
    }

    /// Returns the rest pose, which maps the object's coordinates, after scaling, to the scene's.
    pub fn scene_from_object(&self) -> Pose {
        Pose::from_xyz_deg(
            DVec3::from_array(self.position_mm),
            DVec3::from_array(self.rotation_deg),
        )
    }
}

pub(super) fn check(o: &Object, at: &str, check: &Check<'_>) -> Result<()> {
    let field = |name: &str| format!("{at}.{name}");
    check.all_within(&field("position_mm"), &o.position_mm, POSITION_MM)?;
    check.all_within(&field("rotation_deg"), &o.rotation_deg, ROTATION_DEG)?;
    check.within(&field("scale"), o.scale, 1e-6..=1e6)?;
    check.within(&field("albedo"), o.albedo, 0.0..=1.0)?;
    let is_mesh = matches!(o.shape, Shape::Mesh { .. });
    check.that(
        is_mesh || !o.vertex_colours,
        &field("vertex_colours"),
        "true for a shape without vertex colours",
        "true for a mesh from a file whose vertices have colours, else false",
    )?;
    if let Some(sides) = &o.texture_size_mm {
        check.all_within(&field("texture_size_mm"), sides, 1e-6..=1e9)?;
    }
    match &o.texture {
        None => check.that(
            o.texture_size_mm.is_none(),
            &field("texture_size_mm"),
            "a size without a texture",
            "a texture as well",
        )?,
        Some(file) => {
            check.that(
                !file.as_os_str().is_empty(),
                &field("texture"),
                "an empty path",
                "the path of a PNG, BMP, TIFF or JPEG file",
            )?;
            check.that(
                !matches!(o.shape, Shape::Board { .. }),
                &field("texture"),
                "a texture on a board",
                "no texture: a board has its own ink",
            )?;
            check.that(
                is_mesh || o.texture_size_mm.is_some(),
                &field("texture"),
                "a texture without a size",
                "texture_size_mm as well, width and height in millimetres",
            )?;
        }
    }
    if let Some(specular) = &o.specular {
        check_specular(specular, &field("specular"), check)?;
    }
    if let Some(path) = &o.motion {
        motion::check(path, &field("motion"), check)?;
    }
    if let Some(deform) = &o.deform {
        let meshes = matches!(
            o.shape,
            Shape::Torso { .. } | Shape::Couch {} | Shape::Mesh { .. }
        );
        check.that(
            meshes,
            &field("deform"),
            "a shape without triangles",
            "a torso, a couch or a mesh",
        )?;
        motion::check_deform(deform, &field("deform"), check)?;
    }
    if let Some(skin) = &o.skin {
        skin::check(skin, &field("skin"), check)?;
    }
    let size = 1e-6..=1e9;
    let shape = |name: &str| format!("{at}.shape.{name}");
    match &o.shape {
        Shape::Plane { size_mm } => match size_mm {
            Some(sides) => check.all_within(&shape("size_mm"), sides, size),
            None => Ok(()),
        },
        Shape::Board { board, ink } => {
            check.within(&shape("ink"), *ink, 0.0..=1.0)?;
            board.check().map_err(|(name, found, allowed)| {
                let field = shape(&format!("board.{name}"));
                check.source.violation(&field, found, allowed)
            })
        }
        Shape::Sphere { radius_mm } => check.within(&shape("radius_mm"), *radius_mm, size),
        Shape::Cylinder {
            radius_mm,
            length_mm,
        } => {
            check.within(&shape("radius_mm"), *radius_mm, size.clone())?;
            check.within(&shape("length_mm"), *length_mm, size)
        }
        Shape::Frustum {
            base_mm,
            top_mm,
            height_mm,
        } => {
            check.within(&shape("base_mm"), *base_mm, size.clone())?;
            check.within(&shape("top_mm"), *top_mm, 0.0..=1e9)?;
            check.within(&shape("height_mm"), *height_mm, size)
        }
        Shape::Torso {
            seed,
            length_mm,
            width_mm,
            depth_mm,
            triangles,
        } => shapes::Torso {
            seed: *seed,
            length_mm: *length_mm,
            width_mm: *width_mm,
            depth_mm: *depth_mm,
            triangles: *triangles,
        }
        .check()
        .map_err(|(name, found, allowed)| check.source.violation(&shape(name), found, allowed)),
        Shape::Couch {} | Shape::LinacHead {} => Ok(()),
        Shape::Patient {
            patient,
            held_percent,
            triangles,
            ..
        } => {
            check.that(
                !patient.is_empty(),
                &shape("patient"),
                "an empty name",
                "a built-in patient, or the path of a TOML file",
            )?;
            check.within(
                &shape("held_percent"),
                held_percent.unwrap_or(0.0),
                0.0..=100.0,
            )?;
            let (least, most) = phantom::TRIANGLES.into_inner();
            check.that(
                phantom::TRIANGLES.contains(triangles),
                &shape("triangles"),
                triangles,
                format!("{least} to {most}"),
            )
        }
        Shape::Mesh { file } => check.that(
            !file.as_os_str().is_empty(),
            &shape("file"),
            "an empty path",
            "the path of an STL, OBJ or PLY file",
        ),
    }
}

/// A GGX microfacet lobe on top of the diffuse reflection. The diffuse part reflects `albedo` of
/// the light the lobe transmits. A highlight narrower than a pixel is sampled at the pixel's
/// centre.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Specular {
    /// Reflectance at normal incidence, 0 to 1: ((n - 1)/(n + 1))^2 of a dielectric, so 0.04 for
    /// plastics and glass (n = 1.5) and 0.028 for skin (n = 1.4).
    pub f0: f64,
    /// Perceptual roughness, 0.05 to 1; GGX's alpha is its square (Burley, "Physically Based
    /// Shading at Disney", SIGGRAPH 2012).
    pub roughness: f64,
}

fn check_specular(specular: &Specular, at: &str, check: &Check<'_>) -> Result<()> {
    check.within(&format!("{at}.f0"), specular.f0, 0.0..=1.0)?;
    check.within(&format!("{at}.roughness"), specular.roughness, 0.05..=1.0)
}
