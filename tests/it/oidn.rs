//! Open Image Denoise, if it is installed where Fluxion looks for it, and what is said if it is not.

use fluxion::film::{Frame, Layer};
use fluxion::image::Image;
use fluxion::internals::math::{Rgb, rng, vec3};
use fluxion::internals::synthetic::{Distribution, Noise, noisy};
use fluxion::metrics;
use fluxion::reconstruct::{Context, parse, solve};

fn image(pixel: impl Fn(usize, usize) -> Rgb) -> Image {
    Image::from_rgb(96, 64, pixel)
}

fn albedo(x: usize, y: usize) -> Rgb {
    if (x / 24 + y / 16).is_multiple_of(2) { vec3(0.8, 0.7, 0.6) } else { vec3(0.2, 0.3, 0.5) }
}

/// Whether it can be used here.
fn is_installed() -> bool {
    parse("oidn").is_ok()
}

#[test]
fn the_error_says_how_to_install_it() {
    let folder = tempfile::tempdir().unwrap();
    let image = folder.path().join("o.exr");
    for method in ["oidn", "frgr:denoiser=oidn", "blend:oidn=on"] {
        let mut command = assert_cmd::Command::cargo_bin("fluxion").unwrap();
        command.args([
            "render",
            "scenes/unit/diffuse/scene.xml",
            "--size",
            "8x8",
            "--spp",
            "1",
            "-q",
            "--method",
            method,
        ]);
        command.arg("-o").arg(&image);
        // Where the loader finds it, there is nothing to say.
        let output = command.env_remove("OIDN_DIR").env_remove("VIRTUAL_ENV").output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success() || message.contains("pip install pyoidn"), "{message}");
        assert_eq!(message.lines().count(), usize::from(!output.status.success()), "{message}");
    }
}

#[test]
fn frgr_is_pulled_to_its_image_and_stays_consistent() {
    if !is_installed() {
        return;
    }
    let truth = Image::from_rgb(64, 48, |x, y| albedo(x, y) * (0.5 + 0.01 * (x + y) as f32));
    let noise = Noise { color: 0.2, edge: 0.05, distribution: Distribution::Normal };
    let frame = noisy(&truth, noise, 5);
    let mse = metrics::find("mse").unwrap();
    let error = |text: &str| {
        let solution = solve(parse(text).unwrap().as_ref(), &frame, &Context::QUIET).unwrap();
        mse.measure(&solution.image, &truth).unwrap().mean
    };
    let (with, own, colours) = (error("frgr:denoiser=oidn"), error("frgr"), error("primal"));
    assert!(with < 0.2 * colours && with != own, "{with:.2e} and {own:.2e}, colours {colours:.2e}");
}

#[test]
fn noise_goes_whatever_the_options_and_lamps_stay() {
    if !is_installed() {
        return;
    }
    let truth = image(|x, y| albedo(x, y) * (0.5 + 0.005 * (x + y) as f32));
    let mut direct = image(|_, _| Rgb::ZERO);
    (20..30).for_each(|x| direct.pixel_mut(x, 30).fill(50.0));
    let mut frame = Frame::new(96, 64);
    let noise = |x, y, c| rng::unit(rng::combine(c, (y * 96 + x) as u64)) - 0.5;
    let noisy = image(|x, y| truth.rgb(x, y) * (Rgb::ONE + vec3(noise(x, y, 1), noise(x, y, 2), noise(x, y, 3))));
    frame.set(Layer::Color, noisy.clone());
    frame.set(Layer::Direct, direct.clone());
    frame.set(Layer::Albedo, image(albedo));
    frame.set(Layer::Normal, image(|_, _| vec3(0.0, 0.0, 1.0)));
    let mse = metrics::find("mse").unwrap();
    let before = mse.measure(&noisy, &truth).unwrap().mean;
    for method in [
        "oidn",
        "oidn:direct=off",
        "oidn:prefilter=none",
        "oidn:prefilter=none,direct=off",
        "oidn:prefilter=balanced",
        "oidn:quality=balanced",
        "oidn:quality=fast",
    ] {
        let context = Context::QUIET;
        let mut result = solve(parse(method).unwrap().as_ref(), &frame, &context).unwrap().image;
        // The network dims a lamp of a single row; added afterwards it is as it was.
        let (lamp, slack) = (result.pixel(25, 30)[1], if method.contains("direct=off") { 1.0 } else { 20.0 });
        assert!((lamp - 50.0).abs() < slack, "{method}: {lamp}");
        for x in 15..35 {
            (25..36).for_each(|y| result.pixel_mut(x, y).copy_from_slice(&truth.rgb(x, y).to_array()));
        }
        let after = mse.measure(&result, &truth).unwrap().mean;
        assert!(after < 0.1 * before, "{method}: {:.3} of the noise", after / before);
    }
    assert!(parse("oidn:prefilter=fast").err().unwrap().to_string().contains("accurate or balanced or none"));
}

#[test]
fn colour_alone_is_denoised_with_a_warning() {
    let Ok(method) = parse("oidn") else { return };
    let truth = image(|x, _| if x < 48 { Rgb::splat(0.4) } else { Rgb::splat(0.8) });
    let noisy = image(|x, y| truth.rgb(x, y) * (0.5 + rng::unit(rng::mix((y * 96 + x) as u64))));
    let mut frame = Frame::new(96, 64);
    frame.set(Layer::Color, noisy.clone());
    let mse = metrics::find("mse").unwrap();
    let error = |image: &Image| mse.measure(image, &truth).unwrap().mean;
    let alone = solve(method.as_ref(), &frame, &Context::QUIET).unwrap().image;
    assert!(error(&alone) < 0.1 * error(&noisy), "{} of {}", error(&alone), error(&noisy));
    assert!(method.warnings(&frame)[0].contains("the frame lacks albedo, normal"));
    frame.set(Layer::Albedo, truth.clone());
    assert!(method.warnings(&frame)[0].contains("the frame lacks normal:"));
    solve(method.as_ref(), &frame, &Context::QUIET).unwrap();
}
