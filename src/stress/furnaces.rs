//! Every material in even light: none may shine, and those that lose nothing must vanish.

use super::probe::{Probe, camera, sky};
use super::{Case, Checks};
use crate::error::Result;

pub const CASES: &[Case] = &[
    Case { name: "furnace/lossless", summary: "materials that lose nothing, in light of one", run: lossless },
    Case { name: "furnace/rough", summary: "rough materials of reflectance one, at every roughness", run: rough },
    Case { name: "furnace/index", summary: "glass of index 1, 1.0001, 1.5 and 4, smooth and rough", run: index },
];

/// A ball of a material that fills the view.
fn ball(material: &str) -> Result<Probe> {
    let ball = format!(r#"<shape type="sphere"><float name="radius" value="1"/>{material}</shape>"#);
    Probe::new(&[camera("0,0,4", "0,0,0", 20.0), sky(1.0), ball], 1000, 64)
}

const WHITE: &str = r#"<rgb name="reflectance" value="1"/>"#;

fn lossless(checks: &mut Checks) -> Result<()> {
    let diffuse = format!(r#"<bsdf type="diffuse">{WHITE}</bsdf>"#);
    for (name, material) in [
        ("diffuse", diffuse.clone()),
        ("conductor", r#"<bsdf type="conductor"><string name="material" value="none"/></bsdf>"#.into()),
        ("dielectric", r#"<bsdf type="dielectric"/>"#.into()),
        ("thindielectric", r#"<bsdf type="thindielectric"/>"#.into()),
        ("null", r#"<bsdf type="null"/>"#.into()),
        ("twosided", format!(r#"<bsdf type="twosided">{diffuse}</bsdf>"#)),
        (
            "mask",
            format!(
                r#"<bsdf type="mask"><float name="opacity" value="0.5"/><bsdf type="twosided">{diffuse}</bsdf></bsdf>"#
            ),
        ),
        (
            "blendbsdf",
            format!(
                r#"<bsdf type="twosided"><bsdf type="blendbsdf"><float name="weight" value="0.5"/>{diffuse}<bsdf type="conductor"><string name="material" value="none"/></bsdf></bsdf></bsdf>"#
            ),
        ),
    ] {
        ball(&material)?.check(checks, name, 1.0, 0.01)?;
    }
    Ok(())
}

fn rough(checks: &mut Checks) -> Result<()> {
    const WHITE_METAL: &str = r#"<string name="material" value="none"/>"#;
    for alpha in ["0", "1e-4", "1e-3", "0.01", "0.1", "0.5", "1"] {
        for (name, material) in [
            (
                "roughconductor ggx",
                format!(
                    r#"<bsdf type="roughconductor"><string name="distribution" value="ggx"/><float name="alpha" value="{alpha}"/>{WHITE_METAL}</bsdf>"#
                ),
            ),
            (
                "roughconductor beckmann",
                format!(r#"<bsdf type="roughconductor"><float name="alpha" value="{alpha}"/>{WHITE_METAL}</bsdf>"#),
            ),
            (
                "roughdielectric",
                format!(
                    r#"<bsdf type="roughdielectric"><string name="distribution" value="ggx"/><float name="alpha" value="{alpha}"/></bsdf>"#
                ),
            ),
            (
                "roughplastic",
                format!(
                    r#"<bsdf type="roughplastic"><float name="alpha" value="{alpha}"/><rgb name="diffuse_reflectance" value="1"/></bsdf>"#
                ),
            ),
            (
                "principled",
                format!(
                    r#"<bsdf type="principled"><rgb name="base_color" value="1"/><float name="roughness" value="{alpha}"/><float name="metallic" value="0.5"/></bsdf>"#
                ),
            ),
            (
                "principledthin",
                format!(
                    r#"<bsdf type="principledthin"><rgb name="base_color" value="1"/><float name="roughness" value="{alpha}"/><float name="spec_trans" value="0.5"/></bsdf>"#
                ),
            ),
        ] {
            // What scatters more than once between the facets is lost: a lot where they are steep.
            let loss = alpha.parse::<f64>().unwrap_or(1.0) * 0.6;
            let means = ball(&material)?.means();
            let mean = means.iter().sum::<f64>() / means.len() as f64;
            checks.add(format!("{name} {alpha}"), "energy made", mean - 1.0, 0.02);
            checks.add(format!("{name} {alpha}"), "energy lost, less 0.6 of the roughness", 1.0 - mean - loss, 0.15);
        }
    }
    Ok(())
}

fn index(checks: &mut Checks) -> Result<()> {
    for index in ["1", "1.0001", "1.5", "4"] {
        let inside = format!(r#"<float name="int_ior" value="{index}"/><float name="ext_ior" value="1"/>"#);
        let smooth = format!(r#"<bsdf type="dielectric">{inside}</bsdf>"#);
        ball(&smooth)?.check(checks, &format!("dielectric {index}"), 1.0, 0.01)?;
        let rough = format!(r#"<bsdf type="roughdielectric"><float name="alpha" value="0.05"/>{inside}</bsdf>"#);
        match ball(&rough) {
            // Nothing is refracted at such a boundary, which no roughness can be given.
            Err(error) if index == "1" => {
                let silent = u8::from(!error.to_string().contains("equal indices"));
                checks.add("roughdielectric 1", "not refused with the reason", f64::from(silent), 0.0);
            }
            probe => probe?.check(checks, &format!("roughdielectric {index}"), 1.0, 0.06)?,
        }
    }
    Ok(())
}
