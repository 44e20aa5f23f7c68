//! Materials of the reference renderer: each ray evaluates one texel, one interpolated vertex
//! colour and one value of the microfacet formula.

use super::super::material::texels;
use super::microfacets::Microfacets;
use super::primitive::Primitive;
use glam::{DVec2, DVec3};
use phasmid_core::error::Result;
use phasmid_geometry::{Board, Mesh};
use phasmid_profile::{Object, Shape};
use std::f64::consts::FRAC_PI_2;
use std::path::Path;

/// A surface material.
pub(super) struct Material {
    albedo: f64,
    specular: Option<Microfacets>,
    image: Option<ImageMap>,
    printed: Option<Printed>,
    /// Reflectances at the triangles' corners; empty unless the object uses vertex colours.
    colours: Vec<[f64; 3]>,
}

/// A printed calibration board.
struct Printed {
    board: Board,
    ink: f64,
    /// Scale of the object on which the board is printed.
    scale: f64,
}

struct ImageMap {
    columns: usize,
    texels: Vec<f64>,
    /// Width and height in millimetres if the texture is mapped onto the shape; `None` if texture
    /// coordinates place it.
    size_mm: Option<DVec2>,
    /// Texture coordinates of the triangles' corners, from the top left downwards; used if `size_mm`
    /// is `None`.
    corners: Vec<[DVec2; 3]>,
}

impl Material {
    /// # Errors
    /// Returns an error if a texture cannot be read.
    pub(super) fn new(object: &Object, folder: &Path) -> Result<Self> {
        let image = match &object.texture {
            None => None,
            Some(file) => {
                let (columns, _, texels) = texels(&folder.join(file))?;
                Some(ImageMap {
                    columns,
                    texels,
                    size_mm: object.texture_size_mm.map(DVec2::from),
                    corners: Vec::new(),
                })
            }
        };
        let printed = match object.shape {
            Shape::Board { board, ink } => Some(Printed {
                board,
                ink,
                scale: object.scale,
            }),
            _ => None,
        };
        Ok(Self {
            printed,
            albedo: object.albedo,
            specular: object.lobe().map(|s| Microfacets::new(s.f0, s.roughness)),
            image,
            colours: Vec::new(),
        })
    }

    /// Stores the data that the material needs from the object's mesh.
    pub(super) fn take(&mut self, object: &Object, mesh: &Mesh) {
        if object.vertex_colours {
            let of = |t: &[u32; 3]| t.map(|i| f64::from(mesh.colours[i as usize]));
            self.colours = mesh.triangles.iter().map(of).collect();
        }
        if let Some(image) = &mut self.image {
            let place = |[u, v]: [f32; 2]| DVec2::new(f64::from(u), 1.0 - f64::from(v));
            image.corners = mesh.uv.iter().map(|uv| uv.map(place)).collect();
        }
    }

    /// Returns the albedo at a point with a unit normal on the camera's side, both in the shape's
    /// own frame.
    pub(super) fn albedo(
        &self,
        surface: &Primitive,
        triangle: usize,
        point: DVec3,
        normal: DVec3,
    ) -> f64 {
        let weights = || match surface {
            Primitive::Triangles(triangles) => weights(triangles[triangle], point),
            _ => [1.0, 0.0, 0.0],
        };
        let mut albedo = self.albedo;
        if let Some(colours) = self.colours.get(triangle) {
            albedo *= colours
                .iter()
                .zip(weights())
                .map(|(c, w)| c * w)
                .sum::<f64>();
        }
        if let Some(image) = &self.image {
            let at = match (image.size_mm, image.corners.get(triangle)) {
                (Some(size), _) => laid(surface, point, normal) / size + 0.5,
                (None, Some(corners)) => corners.iter().zip(weights()).map(|(c, w)| *c * w).sum(),
                (None, None) => DVec2::ZERO,
            };
            albedo *= image.texel(at);
        }
        if let Some(printed) = &self.printed
            && normal.z < 0.0
            && printed.is_ink(point.truncate() / printed.scale)
        {
            albedo *= printed.ink;
        }
        albedo
    }

    /// Returns the light from one direction that is reflected to `view`, relative to a white
    /// Lambertian surface: pi times the BRDF.
    pub(super) fn reflectance(&self, albedo: f64, normal: DVec3, light: DVec3, view: DVec3) -> f64 {
        match &self.specular {
            Some(facets) => facets.reflectance(albedo, normal, light, view),
            None => albedo,
        }
    }

    /// Returns the reflected light, relative to a white Lambertian surface, under uniform light from
    /// all directions.
    pub(super) fn under_even_light(&self, albedo: f64, cos_view: f64) -> f64 {
        match &self.specular {
            Some(facets) => {
                let share = facets.share(cos_view);
                share + albedo * (1.0 - share)
            }
            None => albedo,
        }
    }
}

impl Printed {
    /// Returns whether there is ink at a position: tests every dot, or finds the square that
    /// contains the position.
    fn is_ink(&self, at: DVec2) -> bool {
        let board = &self.board;
        match *board {
            Board::Dots { .. } => board
                .indices()
                .any(|i| at.distance(board.point(i)) <= board.radius_mm(i)),
            Board::Chess {
                columns,
                rows,
                pitch_mm,
            } => {
                let square = at / pitch_mm + DVec2::new(columns.into(), rows.into()) / 2.0;
                let [column, row] = [square.x, square.y].map(|s| (s + 0.5).floor());
                (0.0..=columns.into()).contains(&column)
                    && (0.0..=rows.into()).contains(&row)
                    && (column + row) % 2.0 == 0.0
            }
        }
    }
}

impl ImageMap {
    /// Returns the texel at a position in the plane that is tiled with copies of the texture; the
    /// position is in units of the texture's size.
    fn texel(&self, at: DVec2) -> f64 {
        let rows = self.texels.len() / self.columns;
        let of = |at: f64, count: usize| (at.rem_euclid(1.0) * count as f64) as usize % count;
        self.texels[of(at.y, rows) * self.columns + of(at.x, self.columns)]
    }
}

/// Returns the texture coordinates in millimetres of a point of a shape. A sphere uses the longitude
/// from -z towards x and the latitude towards y, a cylinder the angle and y, any other shape two
/// axes.
fn laid(surface: &Primitive, p: DVec3, normal: DVec3) -> DVec2 {
    let longitude = |ring: f64| (p.x / ring).asin();
    // On the far side of the shape the arc sine decreases again.
    let around = |ring: f64| {
        if p.z <= 0.0 {
            longitude(ring)
        } else {
            (2.0 * FRAC_PI_2).copysign(p.x) - longitude(ring)
        }
    };
    let ring = p.x.hypot(p.z);
    match surface {
        Primitive::Sphere(radius) => {
            DVec2::new(around(ring), FRAC_PI_2 - (p.y / radius).acos()) * *radius
        }
        Primitive::Cylinder(..) if normal.y.abs() > 0.5 => DVec2::new(p.x, p.z),
        Primitive::Cylinder(radius, _) => DVec2::new(around(ring) * radius, p.y),
        _ => DVec2::new(p.x, p.y),
    }
}

/// Returns the barycentric weights of a point in a triangle, from the areas opposite the corners.
fn weights([a, b, c]: [DVec3; 3], p: DVec3) -> [f64; 3] {
    let area = |u: DVec3, v: DVec3, w: DVec3| (v - u).cross(w - u).length();
    let whole = area(a, b, c);
    [area(p, b, c), area(a, p, c), area(a, b, p)].map(|part| part / whole)
}
