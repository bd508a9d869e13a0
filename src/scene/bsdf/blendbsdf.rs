//! Two materials mixed by a texture.

use std::sync::Arc;

use super::{Bsdf, BsdfSample, Delta, Eval, Lobe};
use crate::error::Result;
use crate::math::{Rgb, Vec2, Vec3};
use crate::scene::Surface;
use crate::scene::plugin::{Loader, Object, Plugin};
use crate::scene::texture::{Constant, Texture};

/// `blendbsdf`: `weight` is the share of the second material.
pub const PLUGIN: Plugin<Arc<dyn Bsdf>> = Plugin { name: "blendbsdf", parameters: "weight, two nested bsdfs", make };

/// `mixturebsdf`: weights of any number of materials. What is missing to a sum of one is absorbed.
pub const MIXTURE: Plugin<Arc<dyn Bsdf>> =
    Plugin { name: "mixturebsdf", parameters: "weights, as many nested bsdfs", make: make_mixture };

/// Blends of blends: the first material with the rest, the second with the rest of that, and so on.
fn make_mixture(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    let loc = object.loc_of("weights");
    let text = object.string("weights", "")?;
    let words = text.split([',', ';', ' ']).filter(|word| !word.is_empty());
    let weights = words.map(|word| word.parse().ok().filter(|&weight: &f32| weight >= 0.0 && weight.is_finite()));
    let weights = weights.collect::<Option<Vec<f32>>>();
    let weights = weights.ok_or_else(|| loc.invalid(format!("`weights` is `{text}`; it is a list as in 0.7, 0.3")))?;
    let nested = loader.nested_bsdfs(object)?;
    let sum: f32 = weights.iter().sum();
    if weights.len() != nested.len() || sum <= 0.0 {
        let what = format!(
            "{} weights of {} nested bsdfs: each needs one, and one a positive one",
            weights.len(),
            nested.len()
        );
        return Err(loc.invalid(what));
    }
    if sum > 1.0 + 1e-4 {
        loader.warn(&loc, &format!("`weights` add up to {sum}: they are divided by that"))?;
    }
    let (mut rest, mut rest_weight) = (super::diffuse::uniform(0.0), (1.0 - sum).max(0.0));
    for (bsdf, weight) in nested.into_iter().zip(weights).rev() {
        let total = rest_weight + weight;
        rest = match (rest_weight > 0.0, weight > 0.0) {
            (true, true) => {
                let weight = Arc::new(Constant(Rgb::splat(rest_weight / total)));
                Arc::new(Blend { weight, nested: [bsdf, rest] })
            }
            (false, _) => bsdf,
            (true, false) => rest,
        };
        rest_weight = total;
    }
    Ok(rest)
}

fn make(object: &Object, loader: &mut dyn Loader) -> Result<Arc<dyn Bsdf>> {
    if object.get("weight").is_none() {
        return Err(object.loc.invalid("`blendbsdf` needs a `weight`"));
    }
    let weight = loader.texture(object, "weight", Rgb::splat(0.5))?;
    match <[_; 2]>::try_from(loader.nested_bsdfs(object)?) {
        Ok(nested) => Ok(Arc::new(Blend { weight, nested })),
        Err(other) => Err(object.loc.invalid(format!("`blendbsdf` needs two nested bsdfs, not {}", other.len()))),
    }
}

struct Blend {
    weight: Arc<dyn Texture>,
    nested: [Arc<dyn Bsdf>; 2],
}

impl Blend {
    /// Both materials with their shares.
    fn parts(&self, surface: &Surface) -> [(&dyn Bsdf, f32); 2] {
        let second = self.weight.scalar(&surface.at).clamp(0.0, 1.0);
        [(&*self.nested[0], 1.0 - second), (&*self.nested[1], second)]
    }
}

impl Bsdf for Blend {
    fn sample(&self, surface: &Surface, wi: Vec3, lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let [first, second] = self.parts(surface);
        let ((bsdf, share), lobe) =
            if lobe < first.1 { (first, lobe / first.1) } else { (second, (lobe - first.1) / second.1) };
        let sample = bsdf.sample(surface, wi, lobe.min(1.0 - f32::EPSILON), u)?;
        if !sample.lobe.is_delta() {
            let Eval { value, pdf } = self.eval(surface, wi, sample.wo);
            return (pdf > 0.0).then(|| BsdfSample { weight: value / pdf, pdf, ..sample });
        }
        // Where both have the lobe it is theirs together.
        Some(match self.delta(surface, wi, sample.lobe) {
            Some(Delta { value, probability, .. }) => {
                BsdfSample { weight: value / probability, pdf: probability, ..sample }
            }
            None => BsdfSample { pdf: sample.pdf * share, ..sample },
        })
    }

    fn eval(&self, surface: &Surface, wi: Vec3, wo: Vec3) -> Eval {
        let mut sum = Eval::default();
        for (bsdf, share) in self.parts(surface) {
            if share > 0.0 {
                let Eval { value, pdf } = bsdf.eval(surface, wi, wo);
                sum = Eval { value: sum.value + value * share, pdf: sum.pdf + pdf * share };
            }
        }
        sum
    }

    /// `None` also if both materials have the lobe in different directions, since a path does not say which it has taken.
    fn delta(&self, surface: &Surface, wi: Vec3, lobe: Lobe) -> Option<Delta> {
        let [first, second] = self.parts(surface).map(|(bsdf, share)| {
            let delta = bsdf.delta(surface, wi, lobe).filter(|_| share > 0.0)?;
            Some(Delta { value: delta.value * share, probability: delta.probability * share, ..delta })
        });
        match (first, second) {
            (Some(a), Some(b)) if a.wo.distance_squared(b.wo) < 1e-8 => {
                Some(Delta { wo: a.wo, value: a.value + b.value, probability: a.probability + b.probability })
            }
            (Some(_), Some(_)) => None,
            (one, other) => one.or(other),
        }
    }

    fn roughness(&self, surface: &Surface) -> Option<f32> {
        let parts = self.parts(surface).into_iter().filter(|(_, share)| *share > 0.0);
        parts.filter_map(|(bsdf, _)| bsdf.roughness(surface)).reduce(f32::min)
    }

    fn albedo(&self, surface: &Surface) -> Rgb {
        self.parts(surface).into_iter().map(|(bsdf, share)| bsdf.albedo(surface) * share).sum()
    }

    fn transmits(&self) -> bool {
        self.nested.iter().any(|bsdf| bsdf.transmits())
    }

    /// Only where both agree: the direction of a path does not determine which one it was.
    fn refraction(&self) -> Option<f32> {
        let [first, second] = [0, 1].map(|i| self.nested[i].refraction());
        first.filter(|_| first == second)
    }

    fn needs_derivatives(&self) -> bool {
        self.nested.iter().any(|bsdf| bsdf.needs_derivatives())
    }
}
