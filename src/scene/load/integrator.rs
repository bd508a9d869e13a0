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
];

/// Path depths from an integrator.
pub fn load(object: &Object, loader: &Loader) -> Result<Integrator> {
    let Some((_, parameters)) = PLUGINS.iter().find(|(name, _)| *name == object.plugin) else {
        let names: Vec<_> = PLUGINS.iter().map(|(name, _)| *name).collect();
        let what = format!("integrator `{}`; there are {}", object.plugin, names.join(", "));
        return Err(object.loc.unsupported(what));
    };
    let integrator = match object.plugin.as_str() {
        "moment" | "aov" => {
            object.ignore(&["aovs"]);
            nested(object, loader)?
        }
        "direct" => {
            object.ignore(&["emitter_samples", "bsdf_samples", "shading_samples"]);
            Integrator { max_depth: 2, hide_emitters: hide_emitters(object)?, ..Integrator::default() }
        }
        _ => path(object)?,
    };
    object.all_used(parameters)?;
    Ok(integrator)
}

fn nested(object: &Object, loader: &Loader) -> Result<Integrator> {
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

fn hide_emitters(object: &Object) -> Result<bool> {
    object.boolean("hide_emitters", false)
}

fn path(object: &Object) -> Result<Integrator> {
    let defaults = Integrator::default();
    let depth = object.integer("max_depth", -1)?;
    let max_depth = if depth < 0 { u32::MAX } else { u32::try_from(depth).unwrap_or(u32::MAX) };
    let rr_depth = object.integer("rr_depth", i64::from(defaults.rr_depth))?;
    let rr_depth = u32::try_from(rr_depth).ok().filter(|&depth| depth > 0);
    let rr_depth = rr_depth.ok_or_else(|| object.loc_of("rr_depth").invalid("`rr_depth` must be at least 1"))?;
    // Older files may ask for a check of normals that version 3 no longer has.
    object.ignore(&["strict_normals"]);
    Ok(Integrator { max_depth, rr_depth, hide_emitters: hide_emitters(object)? })
}
