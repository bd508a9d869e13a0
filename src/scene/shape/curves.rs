//! Round curves without caps, of which only the outside is there: cubic B-splines and chains of straight pieces, with a radius at
//! every control point. They do not emit.

use std::f32::consts::{PI, TAU};
use std::path::Path;
use std::sync::Arc;

use super::finite::finite;
use super::{Bounds, Geometry};
use crate::error::{Error, Result, SourceLoc};
use crate::ffi::embree::{CurveData, CurveKind, Hit};
use crate::math::{Frame, Mat4, Vec3, Vec4, vec2};
use crate::scene::plugin::{Loader, Object, Plugin, values};
use crate::scene::{Ray, Surface, texture};

/// `bsplinecurve`: uniform cubic B-splines, each of four control points or more.
pub const BSPLINE: Plugin<Geometry> = Plugin { name: "bsplinecurve", parameters: "filename, to_world", make };
/// `linearcurve`: straight pieces between control points, each curve of two or more.
pub const LINEAR: Plugin<Geometry> = Plugin { name: "linearcurve", parameters: "filename, to_world", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Geometry> {
    let kind = if object.plugin == "bsplinecurve" { CurveKind::FLUXION_BSPLINE } else { CurveKind::FLUXION_LINEAR };
    let (to_world, path) = (loader.to_world(object)?, loader.file(object)?);
    let text = std::fs::read_to_string(&path).map_err(|error| Error::io(&path, error))?;
    finite(object, Geometry::Curves(Curves::new(read(kind, &text, &path)?, to_world)))
}

/// Curves from a text: a line of x, y, z and the radius for every control point, with empty lines between curves.
fn read(kind: CurveKind, text: &str, path: &Path) -> Result<CurveData> {
    let mut data = CurveData { kind, points: Vec::new(), starts: Vec::new(), ends: Vec::new() };
    let mut first = 0;
    for (number, line) in (1..).zip(text.lines()) {
        let loc = SourceLoc::line(path, number);
        match values::numbers(line, &loc)?.as_slice() {
            [] => end_curve(&mut data, &mut first, &loc)?,
            &[x, y, z, radius] if radius >= 0.0 => data.points.push([x, y, z, radius].map(|value| value as f32)),
            [_, _, _, radius] => return Err(loc.invalid(format!("a radius of {radius}; it cannot be negative"))),
            other => {
                let what = format!("a control point has x, y, z and a radius, not {} numbers", other.len());
                return Err(loc.invalid(what));
            }
        }
    }
    end_curve(&mut data, &mut first, &SourceLoc::file(path))?;
    Ok(data)
}

/// Makes segments of the points since `first`.
fn end_curve(data: &mut CurveData, first: &mut usize, loc: &SourceLoc) -> Result<()> {
    let (count, length) = (data.points.len() - *first, data.segment_length());
    if count > 0 && count < length {
        return Err(loc.invalid(format!("a curve of {count} control points; it needs {length} or more")));
    }
    let segments = (count + 1).saturating_sub(length);
    data.starts.extend((0..segments).map(|i| (*first + i) as u32));
    data.ends.extend((0..segments).map(|i| u8::from(i == 0) | u8::from(i + 1 == segments) << 1));
    *first = data.points.len();
    Ok(())
}

/// Curves in world space.
pub struct Curves {
    data: Arc<CurveData>,
    bounds: Bounds,
    area: f32,
}

impl Curves {
    /// Places curves in the world. Radii stay what they are, as in Mitsuba.
    fn new(mut data: CurveData, to_world: Mat4) -> Self {
        for point in &mut data.points {
            let [x, y, z, radius] = *point;
            *point = to_world.transform_point3(Vec3::new(x, y, z)).extend(radius).to_array();
        }
        let spheres = data.points.iter().map(|&[x, y, z, radius]| (Vec3::new(x, y, z), radius));
        let bounds = spheres.fold(Bounds::EMPTY, |all, (center, radius)| {
            all.union(Bounds { lower: center - radius, upper: center + radius })
        });
        let mut curves = Self { data: Arc::new(data), bounds, area: 0.0 };
        curves.area = (0..curves.data.starts.len()).map(|segment| curves.area_of(segment)).sum();
        curves
    }

    /// For Embree.
    pub fn data(&self) -> &Arc<CurveData> {
        &self.data
    }

    /// Position and radius at `u` in [0, 1] of a segment, and their derivatives.
    fn at(&self, segment: usize, u: f32) -> (Vec4, Vec4) {
        let start = self.data.starts[segment] as usize;
        let point = |i: usize| Vec4::from_array(self.data.points[start + i]);
        if self.data.kind == CurveKind::FLUXION_LINEAR {
            return (point(0).lerp(point(1), u), point(1) - point(0));
        }
        let v = 1.0 - u;
        let weights = [v * v * v, 4.0 - 3.0 * u * u * (2.0 - u), 4.0 - 3.0 * v * v * (2.0 - v), u * u * u];
        let slopes = [-v * v, u * (3.0 * u - 4.0), -v * (3.0 * v - 4.0), u * u];
        let sum = |weights: [f32; 4], scale: f32| (0..4).map(|i| point(i) * (weights[i] * scale)).sum::<Vec4>();
        (sum(weights, 1.0 / 6.0), sum(slopes, 0.5))
    }

    /// Area of a segment taken for a cone.
    fn area_of(&self, segment: usize) -> f32 {
        let ((a, _), (b, _)) = (self.at(segment, 0.0), self.at(segment, 1.0));
        PI * (a.w + b.w) * a.truncate().distance(b.truncate())
    }

    /// The surface at the point that a ray has hit.
    pub fn surface(&self, hit: &Hit, ray: Ray, derivatives: bool) -> Surface {
        let (center, slope) = self.at(hit.primitive as usize, hit.u);
        let (p, length) = (ray.origin + ray.direction * hit.t, slope.truncate().length());
        let along = slope.truncate().normalize_or(Vec3::Z);
        let from_axis = p - center.truncate();
        let axes = Frame::around(along);
        let outward = (from_axis - along * from_axis.dot(along)).normalize_or(axes.s);
        let n = (outward - along * (slope.w / length.max(f32::MIN_POSITIVE))).normalize_or(outward);
        let segments = self.data.starts.len() as f32;
        let angle = outward.dot(axes.t).atan2(outward.dot(axes.s)) / TAU + 0.5;
        let uv = vec2(angle, (hit.primitive as f32 + hit.u) / segments);
        let dp_du = along.cross(outward) * (TAU * center.w);
        let frame = if derivatives { Frame::along(n, dp_du) } else { Frame::around(n) };
        Surface {
            p,
            n,
            frame,
            at: texture::Point { uv, ..texture::Point::default() },
            instance: u32::MAX,
            dp_du,
            dp_dv: slope.truncate() * segments,
            epsilon: 0.0,
            curvature: 0.0,
            wi: frame.to_local(-ray.direction),
        }
    }

    /// Total area, in which bends do not count.
    pub fn area(&self) -> f32 {
        self.area
    }

    /// Box around all.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }
}
