//! Integrators of scene files. All of them are path traced, with their path depths.

use super::Loader;
use super::props::Object;
use crate::error::Result;
use crate::scene::Integrator;

/// Plugins and their parameters.
pub const PLUGINS: &[(&str, &str)] = &[
    ("path", "max_depth = -1, rr_depth = 5, hide_emitters = false"),
    ("volpath", "as path; scenes have no media"),
    ("volpathmis", "as path; scenes have no media"),
    ("direct", "as path with max_depth 2; emitter_samples, bsdf_samples, shading_samples (ignored)"),
    ("moment", "one nested integrator"),
    ("aov", "aovs (ignored: layers hold them), one nested integrator"),
    ("any other", "as path, with a warning"),
];

/// Integrators that trace paths under other names.
const PATH_TRACERS: &[&str] =
    &["path", "volpath", "volpathmis", "volpath_simple", "prb", "prb_basic", "prbvolpath", "prb_projective"];

/// Properties that say how samples are scheduled, not what they are worth.
const SCHEDULING: &[&str] =
    &["samples_per_pass", "timeout", "block_size", "emitter_samples", "bsdf_samples", "shading_samples", "aovs"];

/// Path depths from an integrator.
pub fn load(object: &Object, loader: &mut Loader) -> Result<Integrator> {
    let plugin = object.plugin.as_str();
    object.ignore(SCHEDULING);
    if ["moment", "aov"].contains(&plugin) {
        let integrator = nested(object, loader)?;
        object.all_used("aovs, one nested integrator")?;
        return Ok(integrator);
    }
    let integrator = path(object)?;
    if plugin == "direct" {
        loader.warn_unused(object)?;
        return Ok(Integrator { max_depth: 2, ..integrator });
    }
    if PATH_TRACERS.contains(&plugin) {
        if object.boolean("strict_normals", false)? {
            let what = "`strict_normals` is ignored: light passes where shading normals and surface disagree";
            loader.warn(&object.loc_of("strict_normals"), what)?;
        }
        loader.warn_unused(object)?;
    } else {
        // What integrators such as `adaptive` are wrapped around says how deep paths go.
        let integrator = wrapped(object, loader)?.unwrap_or(integrator);
        let depth = if integrator.max_depth == u32::MAX { "-1".into() } else { integrator.max_depth.to_string() };
        let what = format!("integrator `{plugin}` is not known here: the scene is path traced with max_depth {depth}");
        loader.warn(&object.loc, what)?;
        return Ok(integrator);
    }
    Ok(integrator)
}

/// The depths of the first integrator nested in another one.
fn wrapped(object: &Object, loader: &mut Loader) -> Result<Option<Integrator>> {
    for property in object.nested() {
        let nested = loader.resolve(property)?;
        if nested.class == "integrator" {
            return loader.guarded(object, |loader| load(&nested, loader)).map(Some);
        }
    }
    Ok(None)
}

fn nested(object: &Object, loader: &mut Loader) -> Result<Integrator> {
    let mut found = None;
    for property in object.nested() {
        property.take();
        let nested = loader.resolve(property)?;
        if found.is_some() || nested.class != "integrator" || ["moment", "aov"].contains(&nested.plugin.as_str()) {
            return Err(nested.loc.unsupported(format!("`{}` takes one path integrator", object.plugin)));
        }
        found = Some(load(&nested, loader)?);
    }
    Ok(found.unwrap_or_default())
}

fn path(object: &Object) -> Result<Integrator> {
    let defaults = Integrator::default();
    let depth = object.integer("max_depth", -1)?;
    let max_depth = if depth < 0 { u32::MAX } else { u32::try_from(depth).unwrap_or(u32::MAX) };
    let rr_depth = object.integer("rr_depth", i64::from(defaults.rr_depth))?;
    let rr_depth = u32::try_from(rr_depth).ok().filter(|&depth| depth > 0);
    let rr_depth = rr_depth.ok_or_else(|| object.loc_of("rr_depth").invalid("`rr_depth` must be at least 1"))?;
    Ok(Integrator { max_depth, rr_depth, hide_emitters: object.boolean("hide_emitters", false)? })
}
