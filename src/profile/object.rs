//! The objects of a scene: shapes, places, surfaces.

use super::motion::{self, Deform, Motion};
use super::placing::{POSITION_MM, ROTATION_DEG};
use super::surface::{self, Specular};
use glam::DVec3;
use phasmid_core::check::Check;
use phasmid_core::error::Result;
use phasmid_geometry::{Board, Pose, shapes};
use phasmid_phantom::tissue::{self as skin, Skin};
use phasmid_phantom::{self as phantom, Day, Patient};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A shape with its place and its surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Object {
    /// What it is, in its own frame.
    pub shape: Shape,
    /// Its origin in the scene's frame in millimetres.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub position_mm: [f64; 3],
    /// Rotation in degrees about the fixed x, then y, then z axis.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly")]
    pub rotation_deg: [f64; 3],
    /// Factor on its size, before rotation and position.
    #[serde(default = "one")]
    pub scale: f64,
    /// Diffuse reflectance of its Lambertian surface, 0 to 1; of skin a factor on the reflectance
    /// that follows from its coefficients.
    pub albedo: f64,
    /// Light travels under the surface: fringes lose contrast and oblique light emerges shifted. A
    /// surface that reflects where it is hit when absent.
    #[serde(default)]
    pub skin: Option<Skin>,
    /// Whether the albedo varies with the colours of the mesh's vertices: it is multiplied by
    /// their reflectance, interpolated, which is the luminance of sRGB at any wavelength.
    #[serde(default)]
    pub vertex_colours: bool,
    /// A picture (PNG, BMP, TIFF or JPEG, at most 4096 pixels a side, relative to the scene file)
    /// that the albedo is multiplied by: the luminance of its sRGB at any wavelength. Its pixels
    /// are held squares, and it repeats without end.
    #[serde(default)]
    pub texture: Option<PathBuf>,
    /// Width and height of the picture laid over the shape, in millimetres of its own frame after
    /// scaling: about a sphere by longitude and latitude, about a cylinder by its angle and y, over
    /// anything else along x and y. When absent, a mesh has it by its own texture coordinates.
    #[serde(default, deserialize_with = "phasmid_core::numbers::exactly_if_any")]
    pub texture_size_mm: Option<[f64; 2]>,
    /// A specular lobe above the diffuse body; none when absent.
    #[serde(default)]
    pub specular: Option<Specular>,
    /// How it moves as a rigid body; at rest when absent.
    #[serde(default)]
    pub motion: Option<Motion>,
    /// How its mesh deforms; stiff when absent.
    #[serde(default)]
    pub deform: Option<Deform>,
}

fn one() -> f64 {
    1.0
}

/// Shapes in their own frame, in millimetres. They stand on their z = 0 plane and rise towards
/// -z, which is towards a camera that looks along +z.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Shape {
    /// The plane z = 0, endless or a rectangle about the origin.
    Plane {
        /// Sides along x and y; endless when absent.
        #[serde(default, deserialize_with = "phasmid_core::numbers::exactly_if_any")]
        size_mm: Option<[f64; 2]>,
    },
    /// A calibration board: a sheet in the plane z = 0 with the grid's middle at the origin, x along
    /// the columns' numbers and y along the rows'. It is printed on the side towards -z.
    Board {
        /// What is printed on it. Its lengths are before scaling.
        board: Board,
        /// Factor on the albedo, which is the paper's, where there is ink: 0 to 1.
        #[serde(default = "ink")]
        ink: f64,
    },
    /// A sphere about the origin.
    Sphere {
        /// Radius.
        radius_mm: f64,
    },
    /// A closed cylinder about the origin, its axis along y.
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
    /// A human torso lying on its back, generated.
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
        /// About how many triangles.
        #[serde(default = "torso_triangles")]
        triangles: u32,
    },
    /// A treatment couch top, generated.
    Couch {},
    /// The head of a C-arm linear accelerator with its arm and drum, generated, in the fixed frame of
    /// IEC 61217 about the isocentre at a gantry angle of 0: head above the patient, drum towards +y.
    /// With `position_mm` of the isocentre a gantry angle is the `rotation_deg` about y.
    #[serde(rename = "linac-head")]
    LinacHead {},
    /// A generated patient that breathes, in the patient's frame: x to its left, y to its back, z to
    /// its head, the origin at the planning isocentre, which is the middle of its tumour. Its skin is what
    /// its own file says unless the object has one.
    Patient {
        /// A built-in patient, or a file relative to the scene file.
        patient: String,
        /// The day: as planned, or as treated, with the set-up, drift and depth of that day.
        #[serde(default = "treatment")]
        day: Day,
        /// Breath held at this phase of planning, in per cent of the cycle from the end of inhaling;
        /// breathing when absent.
        #[serde(default)]
        held_percent: Option<f64>,
        /// About how many triangles the skin has.
        #[serde(default = "patient_triangles")]
        triangles: u32,
    },
    /// A triangle mesh from a file.
    Mesh {
        /// STL, OBJ or PLY, relative to the scene file.
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
    /// The patient that it is, of files relative to a folder; `None` of any other shape.
    ///
    /// # Errors
    /// A name that is neither built in nor a file, and all that [`Patient::parse`] refuses.
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

    /// Whether it is a patient that breathes.
    pub fn breathes(&self) -> bool {
        let held = |held: &Option<f64>| held.is_some();
        matches!(self, Self::Patient { held_percent, .. } if !held(held_percent))
    }
}

impl Object {
    /// The skin of a patient that the object does not say otherwise of.
    ///
    /// # Errors
    /// As for [`Shape::patient`].
    pub(super) fn settle(&mut self, folder: &Path) -> Result<()> {
        if let Some(patient) = self.shape.patient(folder)?
            && self.skin.is_none()
        {
            self.skin = Some(patient.skin);
        }
        Ok(())
    }

    /// Its specular lobe; none of a surface that reflects nothing at right angles, whose refractive
    /// index is the air's.
    pub fn lobe(&self) -> Option<Specular> {
        self.specular.filter(|specular| specular.f0 > 0.0)
    }

    /// Takes the object's own coordinates, after scaling, to the scene's, where it rests.
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
        "true for a shape without them",
        "true for a mesh from a file whose vertices have colours, else false",
    )?;
    if let Some(sides) = &o.texture_size_mm {
        check.all_within(&field("texture_size_mm"), sides, 1e-6..=1e9)?;
    }
    match &o.texture {
        None => check.that(
            o.texture_size_mm.is_none(),
            &field("texture_size_mm"),
            "the size of no texture",
            "a texture beside it",
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
                "none: a board has its own ink",
            )?;
            check.that(
                is_mesh || o.texture_size_mm.is_some(),
                &field("texture"),
                "a texture of no size",
                "texture_size_mm beside it, width and height in millimetres",
            )?;
        }
    }
    if let Some(specular) = &o.specular {
        surface::check(specular, &field("specular"), check)?;
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
