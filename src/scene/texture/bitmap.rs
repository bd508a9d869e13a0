//! Image files as textures: nearest or bilinear, in linear colour. Eight-bit files stay in eight bits.

use std::sync::{Arc, OnceLock};

use super::{Point, Selection, Texels, Texture, UvTransform};
use crate::error::Result;
use crate::image::channels::Integers;
use crate::math::{Rgb, Vec2, luminance, vec2};
use crate::scene::plugin::{Loader, Object, Plugin};

/// `bitmap`. Without `channel`, an alpha channel is not used.
pub const PLUGIN: Plugin<Arc<dyn Texture>> = Plugin {
    name: "bitmap",
    parameters: "filename, filter_type = bilinear (nearest), wrap_mode = repeat (mirror, clamp, zero, one), \
        wrap_mode_u and wrap_mode_v = wrap_mode, raw = false or gamma, channel (r, g, b, a, x, y, z), to_uv, \
        format, accel (both ignored)",
    make,
};

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Texture>> {
    let nearest = object.choice("filter_type", &["bilinear", "nearest"], 0)? == 1;
    let both = Wrap::load(object, "wrap_mode", Wrap::Repeat)?;
    let wrap = [Wrap::load(object, "wrap_mode_u", both)?, Wrap::load(object, "wrap_mode_v", both)?];
    // Files keep their own precision.
    object.ignore(&["format", "accel"]);
    let channel = object.get("channel").map(|_| object.string("channel", "")).transpose()?;
    let selection = Selection { integers: integers(object)?, channel };
    let to_uv = UvTransform::load(object)?;
    let texels = loader.texels(object, selection)?;
    Ok(Arc::new(Bitmap { texels, nearest, wrap, to_uv, mean: OnceLock::new() }))
}

/// Decoding of integers, by `raw` or `gamma`.
pub fn integers(object: &Object) -> Result<Integers> {
    if object.boolean("raw", false)? {
        object.ignore(&["gamma"]);
        return Ok(Integers::Raw);
    }
    match object.get("gamma").is_some().then(|| object.float("gamma", 1.0)).transpose()? {
        None => Ok(Integers::Srgb),
        Some(1.0) => Ok(Integers::Raw),
        Some(gamma) if gamma > 0.0 => Ok(Integers::Gamma(gamma)),
        Some(gamma) => Err(object.loc_of("gamma").invalid(format!("a gamma of {gamma}; it must be positive"))),
    }
}

/// Continuation of an image beyond its border, along one axis.
#[derive(Clone, Copy)]
enum Wrap {
    Repeat,
    Mirror,
    Clamp,
    /// This grey.
    Border(f32),
}

impl Wrap {
    const NAMES: [&str; 7] = ["repeat", "mirror", "clamp", "zero", "black", "one", "white"];

    fn load(object: &Object, name: &str, default: Self) -> Result<Self> {
        const ALL: [Wrap; 7] = [
            Wrap::Repeat,
            Wrap::Mirror,
            Wrap::Clamp,
            Wrap::Border(0.0),
            Wrap::Border(0.0),
            Wrap::Border(1.0),
            Wrap::Border(1.0),
        ];
        if object.get(name).is_none() {
            return Ok(default);
        }
        Ok(ALL[object.choice(name, &Self::NAMES, 0)?])
    }

    #[inline]
    fn apply(self, index: i64, size: usize) -> usize {
        let n = size as i64;
        // Divisions are slow, and few points are outside.
        if (0..n).contains(&index) {
            return index as usize;
        }
        let wrapped = match self {
            Self::Repeat => index.rem_euclid(n),
            Self::Mirror => {
                let twice = index.rem_euclid(2 * n);
                twice.min(2 * n - 1 - twice)
            }
            Self::Clamp | Self::Border(_) => index.clamp(0, n - 1),
        };
        wrapped as usize
    }

    /// The grey of a texel that is outside of the image, if there is one.
    #[inline]
    fn border(self, index: i64, size: usize) -> Option<f32> {
        match self {
            Self::Border(value) if !(0..size as i64).contains(&index) => Some(value),
            _ => None,
        }
    }
}

struct Bitmap {
    texels: Arc<Texels>,
    nearest: bool,
    /// Along u and along v.
    wrap: [Wrap; 2],
    to_uv: UvTransform,
    /// Computed when it is first used: most textures never need it.
    mean: OnceLock<f32>,
}

/// The four texels around a point, and how far it is from the first to the others.
struct Footprint {
    texels: [Rgb; 4],
    fraction: Vec2,
}

impl Bitmap {
    fn fetch(&self, x: i64, y: i64) -> Rgb {
        let (width, height) = (self.texels.width, self.texels.height);
        if let Some(value) = self.wrap[0].border(x, width).or_else(|| self.wrap[1].border(y, height)) {
            return Rgb::splat(value);
        }
        self.texels.texel(self.wrap[0].apply(x, width), self.wrap[1].apply(y, height))
    }

    #[inline]
    fn size(&self) -> Vec2 {
        vec2(self.texels.width as f32, self.texels.height as f32)
    }

    /// Columns and rows of the four texels around a point, not yet wrapped, and how far it is from the first to the others.
    #[inline]
    fn cell(&self, point: &Point) -> ([i64; 2], [i64; 2], Vec2) {
        let at = self.to_uv.apply(point.uv) * self.size() - 0.5;
        let corner = at.floor();
        let (x, y) = (corner.x as i64, corner.y as i64);
        ([x, x.saturating_add(1)], [y, y.saturating_add(1)], at - corner)
    }

    fn footprint(&self, point: &Point) -> Footprint {
        let (columns, rows, fraction) = self.cell(point);
        let texels = match self.wrap {
            [Wrap::Border(_), _] | [_, Wrap::Border(_)] => {
                let at = |k: usize| self.fetch(columns[k % 2], rows[k / 2]);
                [at(0), at(1), at(2), at(3)]
            }
            [along_u, along_v] => {
                let (width, height) = (self.texels.width, self.texels.height);
                let columns = [along_u.apply(columns[0], width), along_u.apply(columns[1], width)];
                let rows = [along_v.apply(rows[0], height), along_v.apply(rows[1], height)];
                self.texels.square(columns, rows)
            }
        };
        Footprint { texels, fraction }
    }

    fn average(&self) -> f32 {
        let (width, height) = (self.texels.width, self.texels.height);
        let row = |y| (0..width).map(|x| f64::from(luminance(self.texels.texel(x, y)))).sum::<f64>();
        ((0..height).map(row).sum::<f64>() / (width * height) as f64) as f32
    }
}

impl Texture for Bitmap {
    fn color(&self, point: &Point) -> Rgb {
        if self.nearest {
            let at = (self.to_uv.apply(point.uv) * self.size()).floor();
            return self.fetch(at.x as i64, at.y as i64);
        }
        let Footprint { texels: [a, b, c, d], fraction: f } = self.footprint(point);
        a.lerp(b, f.x).lerp(c.lerp(d, f.x), f.y)
    }

    fn prefetch(&self, point: &Point) {
        let (columns, rows, _) = self.cell(point);
        let rows = rows.map(|row| self.wrap[1].apply(row, self.texels.height));
        self.texels.prefetch(self.wrap[0].apply(columns[0], self.texels.width), rows);
    }

    fn gradient(&self, point: &Point) -> Vec2 {
        if self.nearest {
            return Vec2::ZERO;
        }
        let Footprint { texels, fraction: f } = self.footprint(point);
        let [a, b, c, d] = texels.map(luminance);
        let (dx, dy) = ((1.0 - f.y) * (b - a) + f.y * (d - c), (1.0 - f.x) * (c - a) + f.x * (d - b));
        let per_texel = vec2(dx, dy);
        vec2(self.to_uv.u.dot(per_texel), self.to_uv.v.dot(per_texel)) * self.size()
    }

    fn resolution(&self) -> Option<Vec2> {
        Some(self.size())
    }

    fn largest(&self) -> Rgb {
        let (width, height) = (self.texels.width, self.texels.height);
        let texel = |i: usize| self.texels.texel(i % width, i / width);
        (0..width * height).map(texel).fold(Rgb::ZERO, Rgb::max)
    }

    fn mean(&self) -> f32 {
        *self.mean.get_or_init(|| self.average())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrapping_is_as_documented() {
        let row = |wrap: Wrap| (-4..6).map(|i| wrap.apply(i, 3)).collect::<Vec<_>>();
        assert_eq!(row(Wrap::Repeat), [2, 0, 1, 2, 0, 1, 2, 0, 1, 2]);
        assert_eq!(row(Wrap::Mirror), [2, 2, 1, 0, 0, 1, 2, 2, 1, 0]);
        assert_eq!(row(Wrap::Clamp), [0, 0, 0, 0, 0, 1, 2, 2, 2, 2]);
        let outside: Vec<_> = (-1..4).map(|i| Wrap::Border(1.0).border(i, 3)).collect();
        assert_eq!(outside, [Some(1.0), None, None, None, Some(1.0)]);
    }

    #[test]
    fn bilinear_passes_through_texel_centres_and_its_gradient_is_its_slope() {
        let texels = Arc::new(Texels::from_colors(4, (0..12).map(|i| Rgb::splat((i * i) as f32)).collect()));
        let to_uv = UvTransform { u: vec2(1.0, 0.0), v: vec2(0.0, 1.0), origin: Vec2::ZERO };
        let bitmap = Bitmap { texels, nearest: false, wrap: [Wrap::Repeat; 2], to_uv, mean: OnceLock::new() };
        let at = |uv| Point { uv, ..Point::default() };
        assert!((bitmap.color(&at(vec2(1.5 / 4.0, 2.5 / 3.0))).x - 81.0).abs() < 1e-4);
        let (uv, h) = (vec2(0.4, 0.55), 1e-3);
        let slope = |d: Vec2| (bitmap.scalar(&at(uv + d)) - bitmap.scalar(&at(uv - d))) / (2.0 * h);
        let expected = vec2(slope(vec2(h, 0.0)), slope(vec2(0.0, h)));
        assert!((bitmap.gradient(&at(uv)) - expected).length() < 1e-2 * expected.length());
    }
}
