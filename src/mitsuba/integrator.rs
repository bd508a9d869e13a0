//! Integrators of scene files. All of them are path traced, with their path depths.

use std::rc::Rc;

use super::loader::FileLoader;
use crate::error::Result;
use crate::scene::Integrator;
use crate::scene::plugin::{Loader, Object};

/// Plugins and their parameters.
pub const PLUGINS: &[(&str, &str)] = &[
    ("path", "max_depth = -1, rr_depth = 5, hide_emitters = false"),
    ("volpath", "as path; scenes have no media"),
    ("volpathmis", "as path; scenes have no media"),
    ("direct", "as path with max_depth 2; emitter_samples, bsdf_samples, shading_samples (ignored)"),
    ("moment", "nested integrators, of which the first counts"),
    ("aov", "aovs (ignored: layers hold them), nested integrators, of which the first counts"),
    ("any other", "as path, with a warning"),
];

/// Integrators that trace paths under other names.
const PATH_TRACERS: &[&str] =
    &["path", "volpath", "volpathmis", "volpath_simple", "prb", "prb_basic", "prbvolpath", "prb_projective"];

/// Properties that say how samples are scheduled, not what they are worth.
const SCHEDULING: &[&str] =
    &["samples_per_pass", "timeout", "block_size", "emitter_samples", "bsdf_samples", "shading_samples", "aovs"];

/// Path depths of a scene: of its one integrator that no other one refers to.
pub fn choose(integrators: &[&Rc<Object>], loader: &mut FileLoader) -> Result<Integrator> {
    let mut inner: Vec<*const Object> = Vec::new();
    for property in integrators.iter().flat_map(|integrator| integrator.nested()) {
        inner.push(Rc::as_ptr(&loader.resolve(property)?));
    }
    let mut outer = integrators.iter().filter(|integrator| !inner.contains(&Rc::as_ptr(integrator)));
    match (outer.next(), outer.next()) {
        (_, Some(second)) => Err(second.loc.invalid("a second integrator; a scene has one")),
        (Some(only), None) => load(only, loader),
        // Two that refer to each other, or none.
        (None, None) => integrators.first().map_or(Ok(Integrator::default()), |first| load(first, loader)),
    }
}

/// Path depths from an integrator.
pub fn load(object: &Object, loader: &mut FileLoader) -> Result<Integrator> {
    let plugin = object.plugin.as_str();
    object.ignore(SCHEDULING);
    let wrapped = wrapped(object, loader)?;
    if ["moment", "aov"].contains(&plugin) {
        object.ignore(&["keep_emitters"]);
        loader.warn_unused(object)?;
        return Ok(wrapped.unwrap_or_default());
    }
    let own = path(object)?;
    if object.boolean("strict_normals", false)? {
        let what = "`strict_normals` is ignored: light passes where shading normals and surface disagree";
        loader.warn(&object.loc_of("strict_normals"), what)?;
    }
    if plugin == "direct" {
        loader.warn_unused(object)?;
        return Ok(Integrator { max_depth: 2, ..own });
    }
    if PATH_TRACERS.contains(&plugin) {
        loader.warn_unused(object)?;
        return Ok(own);
    }
    // What integrators such as `adaptive` are wrapped around says how deep paths go.
    let integrator = wrapped.unwrap_or(own);
    let depth = if integrator.max_depth == u32::MAX { "-1".into() } else { integrator.max_depth.to_string() };
    let what = format!("integrator `{plugin}` is not known here: the scene is path traced with max_depth {depth}");
    loader.warn(&object.loc, &what)?;
    Ok(integrator)
}

/// The depths of the first of the integrators nested in another one.
fn wrapped(object: &Object, loader: &mut FileLoader) -> Result<Option<Integrator>> {
    let mut first = None;
    for property in object.nested() {
        let nested = loader.resolve(property)?;
        if nested.class != "integrator" {
            continue;
        }
        property.take();
        if first.is_none() {
            first = Some(loader.guarded(object, |loader| load(&nested, loader))?);
        }
    }
    Ok(first)
}

fn path(object: &Object) -> Result<Integrator> {
    let defaults = Integrator::default();
    let depth = object.integer("max_depth", -1)?;
    if depth < -1 {
        return Err(object.loc_of("max_depth").invalid("`max_depth` is a number of edges, or -1 for any"));
    }
    let max_depth = if depth < 0 { u32::MAX } else { u32::try_from(depth).unwrap_or(u32::MAX) };
    let rr_depth = object.integer("rr_depth", i64::from(defaults.rr_depth))?;
    let rr_depth = u32::try_from(rr_depth).ok().filter(|&depth| depth > 0);
    let hide_emitters = object.boolean("hide_emitters", false)?;
    // In files of version 0.6 hidden emitters are still in the way.
    let pass_emitters = !object.boolean("keep_emitters", false)? && hide_emitters;
    let rr_depth = rr_depth.ok_or_else(|| object.loc_of("rr_depth").invalid("`rr_depth` must be at least 1"))?;
    Ok(Integrator { max_depth, rr_depth, hide_emitters, pass_emitters })
}
