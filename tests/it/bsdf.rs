//! The contract of every BSDF of the table: what `sample` gives is what `eval` says, densities integrate to what is
//! sampled, no energy is made, reflection is reciprocal, albedo is a colour.

use std::f32::consts::{PI, TAU};

use fluxion::internals::math::lanes::{LANES, Lanes, Lanes3, Mask};
use fluxion::internals::math::{Rgb, Vec2, Vec3, rng, vec2, vec3};
use fluxion::scene::bsdf::{Bsdf, Lobe, PLUGINS};
use fluxion::scene::closure::Scatters;
use fluxion::scene::packet::{Materials, Surfaces};
use fluxion::scene::{Ray, Scene, Surface};

/// Name of the plugin that a case is of, and its XML.
const CASES: &[(&str, &str)] = &[
    ("diffuse", r#"<bsdf type="diffuse"><rgb name="reflectance" value="0.9,0.5,0.1"/></bsdf>"#),
    ("conductor", r#"<bsdf type="conductor"><string name="material" value="Au"/></bsdf>"#),
    ("roughconductor", r#"<bsdf type="roughconductor"><float name="alpha" value="0.3"/></bsdf>"#),
    (
        "roughconductor",
        r#"<bsdf type="roughconductor"><string name="distribution" value="ggx"/><float name="alpha" value="0.15"/></bsdf>"#,
    ),
    ("dielectric", r#"<bsdf type="dielectric"/>"#),
    ("roughdielectric", r#"<bsdf type="roughdielectric"><float name="alpha" value="0.3"/></bsdf>"#),
    (
        "roughdielectric",
        r#"<bsdf type="roughdielectric"><string name="distribution" value="ggx"/><float name="alpha_u" value="0.4"/><float name="alpha_v" value="0.2"/></bsdf>"#,
    ),
    (
        "roughconductor",
        r#"<bsdf type="roughconductor"><string name="material" value="a-C"/><float name="alpha_u" value="0.2"/><float name="alpha_v" value="0.5"/></bsdf>"#,
    ),
    (
        "principled",
        r#"<bsdf type="principled"><rgb name="base_color" value="0.6,0.3,0.1"/><float name="roughness" value="0.5"/><float name="metallic" value="0.3"/><float name="spec_tint" value="0.5"/><float name="anisotropic" value="0.6"/><float name="clearcoat" value="0.8"/><float name="sheen" value="0.1"/><float name="sheen_tint" value="0.5"/></bsdf>"#,
    ),
    (
        "principled",
        r#"<bsdf type="principled"><rgb name="base_color" value="0.6,0.3,0.1"/><float name="roughness" value="0.6"/><float name="spec_trans" value="0.7"/><float name="flatness" value="0.4"/></bsdf>"#,
    ),
    (
        "principledthin",
        r#"<bsdf type="principledthin"><rgb name="base_color" value="0.6,0.3,0.1"/><float name="roughness" value="0.6"/><float name="spec_trans" value="0.4"/><float name="diff_trans" value="0.8"/><float name="flatness" value="0.4"/></bsdf>"#,
    ),
    (
        "blendbsdf",
        r#"<bsdf type="blendbsdf"><float name="weight" value="0.3"/><bsdf type="diffuse"/><bsdf type="plastic"/></bsdf>"#,
    ),
    (
        "blendbsdf",
        r#"<bsdf type="blendbsdf"><float name="weight" value="0.4"/><bsdf type="dielectric"/><bsdf type="plastic"/></bsdf>"#,
    ),
    ("null", r#"<bsdf type="null"/>"#),
    (
        "mask",
        r#"<bsdf type="mask"><float name="opacity" value="0.6"/><bsdf type="blendbsdf"><float name="weight" value="0.4"/><bsdf type="thindielectric"/><bsdf type="null"/></bsdf></bsdf>"#,
    ),
    (
        "normalmap",
        r#"<bsdf type="normalmap"><texture type="rawconstant" name="normalmap"><vector name="value" value="0.6,0.55,0.95"/></texture><bsdf type="roughplastic"><float name="alpha" value="0.3"/></bsdf></bsdf>"#,
    ),
    ("thindielectric", r#"<bsdf type="thindielectric"/>"#),
    (
        "roughdiffuse",
        r#"<bsdf type="roughdiffuse"><float name="alpha" value="0.5"/><float name="reflectance" value="1"/></bsdf>"#,
    ),
    (
        "roughdiffuse",
        r#"<bsdf type="roughdiffuse"><rgb name="reflectance" value="0.9,0.5,0.1"/><boolean name="use_fast_approx" value="true"/></bsdf>"#,
    ),
    ("phong", r#"<bsdf type="phong"><float name="exponent" value="12"/></bsdf>"#),
    (
        "phong",
        r#"<bsdf type="phong"><float name="exponent" value="60"/><rgb name="specular_reflectance" value="0.9,0.5,0.2"/><rgb name="diffuse_reflectance" value="0.3,0.5,0.6"/></bsdf>"#,
    ),
    ("ward", r#"<bsdf type="ward"><float name="alpha" value="0.3"/></bsdf>"#),
    (
        "ward",
        r#"<bsdf type="ward"><string name="variant" value="ward"/><float name="alpha_u" value="0.4"/><float name="alpha_v" value="0.2"/><rgb name="specular_reflectance" value="0.8"/><rgb name="diffuse_reflectance" value="0.1"/></bsdf>"#,
    ),
    ("ward", r#"<bsdf type="ward"><string name="variant" value="ward-duer"/><float name="alpha" value="0.4"/></bsdf>"#),
    ("pplastic", r#"<bsdf type="pplastic"><float name="alpha" value="0.25"/></bsdf>"#),
    (
        "mixturebsdf",
        r#"<bsdf type="mixturebsdf"><string name="weights" value="0.2, 0.5, 0.1"/><bsdf type="diffuse"/><bsdf type="plastic"/><bsdf type="roughconductor"><float name="alpha" value="0.3"/></bsdf></bsdf>"#,
    ),
    (
        "coating",
        r#"<bsdf type="coating"><rgb name="sigma_a" value="0.1,0.3,0.9"/><float name="thickness" value="0.5"/><bsdf type="diffuse"/></bsdf>"#,
    ),
    ("coating", r#"<bsdf type="coating"><bsdf type="roughconductor"><float name="alpha" value="0.3"/></bsdf></bsdf>"#),
    ("coating", r#"<bsdf type="coating"><bsdf type="conductor"><string name="material" value="Au"/></bsdf></bsdf>"#),
    (
        "twosided",
        r#"<bsdf type="twosided"><bsdf type="coating"><float name="int_ior" value="1.7"/><bsdf type="plastic"/></bsdf></bsdf>"#,
    ),
    (
        "roughcoating",
        r#"<bsdf type="roughcoating"><float name="alpha" value="0.25"/><rgb name="sigma_a" value="0.1,0.3,0.9"/><bsdf type="diffuse"/></bsdf>"#,
    ),
    (
        "roughcoating",
        r#"<bsdf type="roughcoating"><float name="alpha" value="0.3"/><string name="distribution" value="ggx"/><bsdf type="mask"><float name="opacity" value="0.6"/><bsdf type="roughplastic"><float name="alpha" value="0.3"/></bsdf></bsdf></bsdf>"#,
    ),
    ("polarizer", r#"<bsdf type="polarizer"><rgb name="transmittance" value="0.9,0.5,0.1"/></bsdf>"#),
    ("circular", r#"<bsdf type="circular"/>"#),
    ("retarder", r#"<bsdf type="retarder"><float name="transmittance" value="0.7"/></bsdf>"#),
    ("plastic", r#"<bsdf type="plastic"><boolean name="nonlinear" value="true"/></bsdf>"#),
    ("roughplastic", r#"<bsdf type="roughplastic"><float name="alpha" value="0.2"/></bsdf>"#),
    (
        "twosided",
        r#"<bsdf type="twosided"><bsdf type="roughplastic"><string name="distribution" value="ggx"/><float name="alpha" value="0.4"/></bsdf></bsdf>"#,
    ),
    ("mask", r#"<bsdf type="mask"><float name="opacity" value="0.6"/><bsdf type="diffuse"/></bsdf>"#),
    (
        "bumpmap",
        r#"<bsdf type="bumpmap"><texture type="bitmap"><string name="filename" value="SCENES/assets/bumps.png"/><boolean name="raw" value="true"/></texture><float name="scale" value="0.4"/><bsdf type="diffuse"/></bsdf>"#,
    ),
];

/// A rectangle of the material, and the surface seen along `wi` (local).
fn surface(xml: &str, wi: Vec3) -> (Scene, Surface) {
    let scenes = crate::common::root().join("scenes");
    let body = xml.replace("SCENES", &scenes.display().to_string());
    let scene = crate::common::scene(&format!(
        r#"<shape type="rectangle">{body}</shape>{}"#,
        crate::common::sensor("0,0,4", 4, 4)
    ));
    let target = vec3(0.13, 0.31, 0.0);
    let surface = scene.intersect(Ray::new(target + wi * 3.0, -wi)).expect("the rectangle is there");
    (scene, surface)
}

/// From the front and, the last one, from behind.
fn directions() -> [Vec3; 4] {
    let oblique = [vec3(0.5, 0.2, 0.7), vec3(-0.1, 0.93, 0.25), vec3(0.4, -0.3, -0.6)].map(Vec3::normalize);
    [vec3(0.0, 0.0, 1.0), oblique[0], oblique[1], oblique[2]]
}

fn uniform(i: u64, k: u64) -> f32 {
    rng::unit(rng::combine(rng::mix(i), k))
}

/// Every case with every direction.
fn each(mut check: impl FnMut(&str, &dyn Bsdf, &Surface)) {
    for (name, xml) in CASES {
        for wi in directions() {
            let (scene, surface) = surface(xml, wi);
            check(name, scene.bsdf(&surface), &surface);
        }
    }
}

#[test]
fn every_bsdf_has_a_case() {
    for plugin in PLUGINS {
        assert!(CASES.iter().any(|(name, _)| *name == plugin.name), "{} has no case", plugin.name);
    }
}

#[test]
fn sampled_weights_are_value_over_density() {
    each(|name, bsdf, surface| {
        for i in 0..2000 {
            let u = vec2(uniform(i, 1), uniform(i, 2));
            let Some(sample) = bsdf.sample(surface, surface.wi, uniform(i, 0), u) else { continue };
            assert!(sample.pdf > 0.0 && sample.weight.is_finite() && (sample.wo.length() - 1.0).abs() < 1e-4, "{name}");
            let (value, pdf) = if sample.lobe == Lobe::Smooth {
                let eval = bsdf.eval(surface, surface.wi, sample.wo);
                (eval.value, eval.pdf)
            } else {
                let delta = bsdf.delta(surface, surface.wi, sample.lobe).expect("a sampled lobe is there");
                assert!(delta.wo.distance(sample.wo) < 1e-4, "{name}");
                (delta.value, delta.probability)
            };
            assert!((pdf / sample.pdf - 1.0).abs() < 1e-2, "{name}: {pdf} {}", sample.pdf);
            assert!(
                (value / pdf).distance(sample.weight) < 1e-2 * (1.0 + sample.weight.length()),
                "{name}: {sample:?}"
            );
        }
    });
}

/// Pearson's test of sampled directions against the integrated density, over cells of the sphere.
#[test]
fn sampled_directions_follow_the_density() {
    const ROWS: usize = 12;
    const COLUMNS: usize = 18;
    const SAMPLES: u64 = 60_000;
    each(|name, bsdf, surface| {
        let mut counts = vec![0.0f64; ROWS * COLUMNS];
        for i in 0..SAMPLES {
            let u = vec2(uniform(i, 4), uniform(i, 5));
            let Some(sample) = bsdf.sample(surface, surface.wi, uniform(i, 3), u) else { continue };
            if sample.lobe != Lobe::Smooth {
                continue;
            }
            let row = (sample.wo.z.clamp(-1.0, 1.0).acos() / PI * ROWS as f32) as usize;
            let column = (sample.wo.y.atan2(sample.wo.x).rem_euclid(TAU) / TAU * COLUMNS as f32) as usize;
            counts[row.min(ROWS - 1) * COLUMNS + column.min(COLUMNS - 1)] += 1.0;
        }
        // Midpoints in every cell, even in both angles: transmitted light is narrow around the pole.
        let fine = 48;
        let mut statistic = 0.0;
        let (mut cells, mut rest, mut rest_count) = (0, 0.0, 0.0);
        for (cell, &count) in counts.iter().enumerate() {
            let corner = vec2((cell / COLUMNS) as f32 / ROWS as f32, (cell % COLUMNS) as f32 / COLUMNS as f32);
            let mut mean = 0.0f64;
            for k in 0..fine * fine {
                let inside = vec2((k % fine) as f32 + 0.5, (k / fine) as f32 + 0.5) / fine as f32;
                let at: Vec2 = corner + inside / vec2(ROWS as f32, COLUMNS as f32);
                let ((r, z), phi) = ((PI * at.x).sin_cos(), TAU * at.y);
                let eval = bsdf.eval(surface, surface.wi, vec3(r * phi.cos(), r * phi.sin(), z));
                mean += f64::from(eval.pdf * r) / (fine * fine) as f64;
            }
            let expected = mean * f64::from(PI * TAU) / (ROWS * COLUMNS) as f64 * SAMPLES as f64;
            if expected < 8.0 {
                (rest, rest_count) = (rest + expected, rest_count + count);
                continue;
            }
            // The midpoint rule is allowed to be one percent off.
            let excess = ((count - expected).abs() - 0.01 * expected).max(0.0);
            (statistic, cells) = (statistic + excess * excess / expected, cells + 1);
        }
        assert!((rest_count - rest).abs() < 6.0 * rest.sqrt() + 10.0, "{name}: {rest_count} for {rest} in the tail");
        let limit = f64::from(cells) + 5.0 * (2.0 * f64::from(cells)).sqrt();
        assert!(
            statistic < limit.max(10.0),
            "{name} from {}: chi-squared {statistic:.1} over {cells} cells",
            surface.wi
        );
    });
}

#[test]
fn no_energy_is_made() {
    each(|name, bsdf, surface| {
        let n = 20_000;
        let mut sum = Rgb::ZERO;
        for i in 0..n {
            if let Some(sample) = bsdf.sample(surface, surface.wi, uniform(i, 6), vec2(uniform(i, 7), uniform(i, 8))) {
                // Radiance that is refracted into a narrower cone is denser, not more.
                let squeeze = sample.eta * sample.eta;
                sum += sample.weight * squeeze / n as f32;
            }
        }
        assert!(sum.max_element() <= 1.01, "{name}: {sum}");
    });
}

#[test]
fn reflection_is_reciprocal() {
    each(|name, bsdf, surface| {
        // Bent normals break reciprocity in every renderer that has them.
        if ["bumpmap", "normalmap"].contains(&name) {
            return;
        }
        for i in 0..500 {
            let (z, phi) = (uniform(i, 9).max(0.02), TAU * uniform(i, 10));
            let r = (1.0 - z * z).sqrt();
            let wo = vec3(r * phi.cos(), r * phi.sin(), z * surface.wi.z.signum());
            let forward = bsdf.eval(surface, surface.wi, wo).value / wo.z;
            let back = bsdf.eval(surface, wo, surface.wi).value / surface.wi.z;
            assert!(forward.distance(back) <= 1e-3 * (forward.length() + 1e-3), "{name}: {forward} {back}");
        }
    });
}

/// Any direction.
fn direction(i: u64, k: u64) -> Vec3 {
    let (z, phi) = (2.0 * uniform(i, k) - 1.0, TAU * uniform(i, k + 1));
    vec3((1.0 - z * z).sqrt() * phi.cos(), (1.0 - z * z).sqrt() * phi.sin(), z)
}

/// Materials in packets, sixteen different directions at a time, to the bit what they are one by one: so all that is tested
/// here holds for both.
#[test]
fn packets_scatter_as_single_surfaces_do() {
    // Kept from case to case, as packets are from wave to wave: nothing of another material may show.
    let (mut surfaces, mut materials, mut scatters) = (Surfaces::default(), Materials::default(), Scatters::default());
    for (name, xml) in CASES {
        let (scene, surface) = surface(xml, Vec3::Z);
        let bsdf = scene.bsdf(&surface);
        for packet in 0..200u64 {
            let number = |lane: usize| packet * LANES as u64 + lane as u64;
            let single: Vec<_> = (0..LANES).map(|i| Surface { wi: direction(number(i), 11), ..surface }).collect();
            single.iter().enumerate().for_each(|(lane, surface)| surfaces.set(lane, surface));
            let numbers = |k: u64| Lanes(std::array::from_fn(|lane| uniform(number(lane), k)));
            let wo: Vec<_> = (0..LANES).map(|lane| direction(number(lane), 13)).collect();
            let mut many = Lanes3::ZERO;
            wo.iter().enumerate().for_each(|(lane, wo)| many.set(lane, *wo));
            let active = !Mask(std::array::from_fn(|lane| if (number(lane) % 7) == 0 { !0 } else { 0 }));
            materials.evaluate(&scene, &surfaces, active);
            let evals = materials.eval(&scene, &surfaces, (surfaces.wi, many), active);
            let (lobe, u) = (numbers(15), [numbers(16), numbers(17)]);
            let found = materials.sample(&scene, &surfaces, (lobe, u), active, &mut scatters);
            for lane in active.lanes() {
                let (surface, eval) = (&single[lane], evals.get(lane));
                let expected = bsdf.eval(surface, surface.wi, wo[lane]);
                assert_eq!((eval.value, eval.pdf), (expected.value, expected.pdf), "{name} {}", surface.wi);
                let sample = bsdf.sample(surface, surface.wi, lobe.0[lane], vec2(u[0].0[lane], u[1].0[lane]));
                let of_packet = found.get(lane).then(|| scatters.get(lane));
                assert_eq!(format!("{of_packet:?}"), format!("{sample:?}"), "{name} {}", surface.wi);
            }
        }
    }
}

#[test]
fn albedo_is_a_colour() {
    each(|name, bsdf, surface| {
        let albedo = bsdf.albedo(surface);
        assert!(albedo.cmpge(Rgb::ZERO).all() && albedo.cmple(Rgb::ONE).all(), "{name}: {albedo}");
    });
}
