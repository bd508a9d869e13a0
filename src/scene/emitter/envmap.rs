//! A latitude-longitude image around the scene. Row 0 is +y; column 0 is -z, and +x is a quarter to its right.

use std::f32::consts::{FRAC_1_PI, PI, TAU};
use std::sync::Arc;

use super::{Emitter, LightPoint, Position};
use crate::error::Result;
use crate::math::lanes::{Lanes, Lanes3, Mask};
use crate::math::partition::Partition;
use crate::math::{Mat4, Rgb, Vec2, Vec3, Vec4, luminance, vec2, vec3};
use crate::scene::Bounds;
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::{self, Selection, Texels, bitmap};

/// `envmap`.
pub const PLUGIN: Plugin<Box<dyn Emitter>> =
    Plugin { name: "envmap", parameters: "filename, scale = 1, to_world, gamma, mis_compensation = true", make };

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Box<dyn Emitter>> {
    let scale = object.float("scale", 1.0)?;
    let to_world = object.transform("to_world")?;
    let compensated = object.boolean("mis_compensation", true)?;
    let texels = enlarged(loader.texels(object, Selection { integers: bitmap::integers(object)?, channel: None })?);
    Ok(Box::new(EnvMap::new(texels, (scale, to_world), compensated)))
}

/// An image with enough texels to be interpolated around the sphere: a tiny one gets those between and beside its own.
fn enlarged(texels: Arc<Texels>) -> Arc<Texels> {
    let (width, height) = (texels.width, texels.height);
    if width >= 2 && height >= 3 {
        return texels;
    }
    let (columns, rows) = (width.max(2), height.max(3));
    let texel = |i: usize| {
        let (x, y) = (i % columns % width, (i / columns * (height - 1)) as f32 / (rows - 1) as f32);
        let (above, below) = (y as usize, (y as usize + 1).min(height - 1));
        texels.texel(x, above).lerp(texels.texel(x, below), y.fract())
    };
    Arc::new(Texels::from_colors(columns, (0..columns * rows).map(texel).collect()))
}

/// Share of the mean that is taken off the weights of all directions, since materials sample them anyway (Karlik et al. 2019), and
/// share of a weight that is kept: what no material samples well has to be found, too.
const COMPENSATED: f32 = 0.85;
const KEPT: f32 = 0.15;

/// The image with its sampling density.
pub struct EnvMap {
    texels: Arc<Texels>,
    scale: f32,
    to_world: Mat4,
    to_local: Mat4,
    /// Density over the unit square; `None` for a black image.
    partition: Option<Partition>,
    /// Mean luminance over directions.
    mean: f32,
    area: f32,
}

/// Sixteen directions sampled from an environment image.
pub struct EnvmapSample {
    /// Unit directions towards them.
    pub direction: Lanes3,
    /// Densities per solid angle.
    pub pdf: Lanes,
    /// Radiance they send.
    pub radiance: Lanes3,
}

/// Sixteen rays that end on an environment image.
pub struct EnvmapHits {
    /// The emitter's index.
    pub emitter: u32,
    /// Texture coordinates.
    pub uv: [Lanes; 2],
    /// Densities per solid angle of [`Emitter::sample`].
    pub pdf: Lanes,
    /// Radiance they receive.
    pub radiance: Lanes3,
}

impl EnvmapHits {
    /// The end of one ray.
    pub fn point(&self, direction: Vec3, lane: usize) -> LightPoint {
        let uv = vec2(self.uv[0].0[lane], self.uv[1].0[lane]);
        LightPoint { emitter: self.emitter, ..far(direction, uv) }
    }
}

impl EnvMap {
    /// The image along the directions of the active lanes, as [`Emitter::environment_point`]. The scene sets the
    /// emitter index and the chance of choosing it.
    #[inline(always)]
    pub fn hits(&self, directions: Lanes3, active: Mask) -> EnvmapHits {
        let uv = self.uv(directions);
        let (mut pdf, mut radiance) = (Lanes::ZERO, Lanes3::ZERO);
        active.lanes().for_each(|lane| self.prefetch(vec2(uv[0].0[lane], uv[1].0[lane])));
        for lane in active.lanes() {
            let at = vec2(uv[0].0[lane], uv[1].0[lane]);
            pdf.0[lane] = self.partition.as_ref().map_or(0.0, |partition| partition.pdf(at));
            radiance.set(lane, self.look_up(at));
        }
        EnvmapHits { emitter: 0, uv, pdf: per_solid_angle(pdf, uv[1]), radiance }
    }

    /// [`Emitter::sample`] with density and radiance, for the active ones.
    #[inline(always)]
    pub fn sample_packet(&self, [u, v]: [Lanes; 2], active: Mask) -> EnvmapSample {
        let mut sample = EnvmapSample { direction: Lanes3::ZERO, pdf: Lanes::ZERO, radiance: Lanes3::ZERO };
        let Some(partition) = &self.partition else { return sample };
        let (mut x, mut y, mut cell_pdf) = (Lanes::ZERO, Lanes::ZERO, Lanes::ZERO);
        let points = partition.sample_packet(u.0, v.0, active);
        for lane in active.lanes() {
            let (uv, pdf) = points[lane];
            (x.0[lane], y.0[lane], cell_pdf.0[lane]) = (uv.x, uv.y, pdf);
            self.prefetch(uv);
        }
        active.lanes().for_each(|lane| sample.radiance.set(lane, self.look_up(vec2(x.0[lane], y.0[lane]))));
        let (cos_phi, sin_phi) = x.cos_sin_turns();
        let (cos, sin) = (y * Lanes::splat(0.5)).cos_sin_turns();
        let local = Lanes3 { x: sin_phi * sin, y: cos, z: -cos_phi * sin };
        let [right, up, back] = axes(self.to_world);
        sample.direction = (right * local.x + up * local.y + back * local.z).normalize_or(Lanes3::ZERO);
        sample.pdf = per_solid_angle(cell_pdf, y);
        sample
    }

    /// `compensated`: directions that are no brighter than the mean are left to sampling by materials.
    fn new(texels: Arc<Texels>, (scale, to_world): (f32, Mat4), compensated: bool) -> Self {
        let (width, height) = (texels.width, texels.height);
        let sines: Vec<f32> = (0..height).map(|y| (PI * (y as f32 + 0.5) / height as f32).sin()).collect();
        // A cell is lit through interpolation by its neighbours, too: in its row, and in those above and below.
        let mut rows = Vec::with_capacity(width * height);
        for y in 0..height {
            let values: Vec<f32> = (0..width).map(|x| luminance(texels.texel(x, y)).max(0.0)).collect();
            let at = |x: usize| values[x % width];
            rows.extend((0..width).map(|x| at(x + width - 1) + 2.0 * at(x) + at(x + 1)));
        }
        let mut weights = Vec::with_capacity(width * height);
        for (y, sine) in sines.iter().enumerate() {
            let row = |y: usize| &rows[y * width..][..width];
            let (above, below) = (row(y.saturating_sub(1)), row((y + 1).min(height - 1)));
            let around = above.iter().zip(row(y)).zip(below);
            weights.extend(around.map(|((above, here), below)| (above + 2.0 * here + below) * (sine / 16.0)));
        }
        let total: f64 = weights.iter().map(|&w| f64::from(w)).sum();
        let mean = (total / (f64::from(sines.iter().sum::<f32>()) * width as f64)) as f32;
        if compensated {
            for (row, sine) in weights.chunks_exact_mut(width).zip(&sines) {
                row.iter_mut().for_each(|weight| *weight = (*weight - COMPENSATED * mean * sine).max(KEPT * *weight));
            }
        }
        let to_local = to_world.inverse();
        Self {
            texels,
            scale,
            to_world,
            to_local,
            partition: Partition::new(&weights, width),
            mean: mean * scale,
            area: 1.0,
        }
    }

    /// Texture coordinates of directions.
    #[inline(always)]
    fn uv<const N: usize>(&self, directions: Lanes3<N>) -> [Lanes<N>; 2] {
        let [right, up, back] = axes(self.to_local);
        let d = right * directions.x + up * directions.y + back * directions.z;
        let turns = Lanes::atan2(d.x, -d.z) * Lanes::splat(1.0 / TAU);
        let u = turns.less(Lanes::ZERO).select(turns + Lanes::ONE, turns);
        let v = Lanes::atan2((d.x * d.x + d.z * d.z).sqrt(), d.y) * Lanes::splat(FRAC_1_PI);
        [u.min(Lanes::splat(ALMOST_ONE)), v]
    }

    /// Columns and rows of the texels around a point, and how far it is from the first to the others. Columns have their centres at half numbers
    /// and wrap around; the first and last row are the poles.
    #[inline(always)]
    fn cell(&self, uv: Vec2) -> ([usize; 2], [usize; 2], Vec2) {
        let (width, height) = (self.texels.width, self.texels.height);
        let at = vec2(uv.x * width as f32 - 0.5, uv.y * (height - 1) as f32);
        let y = (at.y as usize).min(height - 2);
        // Half a column before the first one is the last one.
        let (right, x) = ((at.x + 1.0) as usize, ((at.x + 1.0) as usize) as f32 - 1.0);
        let (left, right) =
            (if right == 0 { width - 1 } else { (right - 1).min(width - 1) }, if right >= width { 0 } else { right });
        ([left, right], [y, y + 1], vec2(at.x - x, at.y - y as f32))
    }

    /// Has the texels around a point brought into the cache.
    #[inline]
    fn prefetch(&self, uv: Vec2) {
        let ([left, _], rows, _) = self.cell(uv);
        self.texels.prefetch(left, rows);
    }

    /// Radiance at a point, interpolated between texels.
    #[inline]
    fn look_up(&self, uv: Vec2) -> Rgb {
        let (columns, rows, fraction) = self.cell(uv);
        let [a, b, c, d] = self.texels.square(columns, rows);
        a.lerp(b, fraction.x).lerp(c.lerp(d, fraction.x), fraction.y) * self.scale
    }
}

/// The largest number below one.
const ALMOST_ONE: f32 = 1.0 - 0.5 * f32::EPSILON;

/// Columns of the part of a transform that acts on directions.
#[inline(always)]
fn axes<const N: usize>(transform: Mat4) -> [Lanes3<N>; 3] {
    let axis = |column: Vec4| Lanes3::splat(column.truncate());
    [axis(transform.x_axis), axis(transform.y_axis), axis(transform.z_axis)]
}

/// Densities over the unit square, per solid angle at the given rows.
#[inline(always)]
fn per_solid_angle<const N: usize>(pdf: Lanes<N>, v: Lanes<N>) -> Lanes<N> {
    let (_, sine) = (v * Lanes::splat(0.5)).cos_sin_turns();
    pdf / (Lanes::splat(2.0 * PI * PI) * sine.max(Lanes::splat(1e-6)))
}

/// A point of the environment keeps its texel, since it is looked up more than once.
fn far(direction: Vec3, uv: Vec2) -> LightPoint {
    let at = texture::Point { uv, ..texture::Point::default() };
    LightPoint { at, ..LightPoint::at_infinity(direction, 0) }
}

impl Emitter for EnvMap {
    fn sample(&self, _from: Vec3, u: Vec2) -> Option<LightPoint> {
        let (uv, _) = self.partition.as_ref()?.sample(u);
        let (sin_phi, cos_phi) = (TAU * uv.x).sin_cos();
        let (sin, cos) = (PI * uv.y).sin_cos();
        let direction = self.to_world.transform_vector3(vec3(sin_phi * sin, cos, -cos_phi * sin));
        Some(far(direction.normalize(), uv))
    }

    fn environment_point(&self, direction: Vec3) -> LightPoint {
        let [u, v] = self.uv::<1>(Lanes3::splat(direction));
        far(direction, vec2(u.0[0], v.0[0]))
    }

    fn pdf(&self, _from: Vec3, point: &LightPoint) -> f32 {
        let (Position::Infinity { .. }, Some(partition)) = (point.position, &self.partition) else { return 0.0 };
        let uv = point.at.uv;
        per_solid_angle::<1>(Lanes([partition.pdf(uv)]), Lanes([uv.y])).0[0]
    }

    fn radiance(&self, point: &LightPoint, _direction: Vec3) -> Rgb {
        match point.position {
            Position::Infinity { .. } => self.look_up(point.at.uv),
            Position::Surface { .. } | Position::Point { .. } => Rgb::ZERO,
        }
    }

    fn power(&self) -> f32 {
        4.0 * PI * self.area * self.mean.max(0.0)
    }

    fn enclose(&mut self, scene: Bounds) {
        self.area = scene.cross_section();
    }

    fn is_environment(&self) -> bool {
        true
    }

    fn envmap(&self) -> Option<&EnvMap> {
        Some(self)
    }

    fn name(&self) -> &'static str {
        "envmap"
    }
}
