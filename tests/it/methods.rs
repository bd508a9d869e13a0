//! The contract of every reconstruction of the table, networks too, on frames made by hand. Only closed answers are asked of some.

use std::sync::LazyLock;

use fluxion::error::Error;
use fluxion::film::{Frame, Layer};
use fluxion::image::Image;
use fluxion::internals::math::{rng, vec3};
use fluxion::internals::synthetic::{self, Distribution, Noise, exact, expose, picture};
use fluxion::reconstruct::{self, Context, Method, parse, solve};

/// All methods that are there: Open Image Denoise may not be.
static METHODS: LazyLock<Vec<&Method>> =
    LazyLock::new(|| reconstruct::METHODS.iter().filter(|method| parse(method.id).is_ok()).collect());

/// Whether methods with closed answers are meant, which trained networks have not.
fn is_exact(method: &&&Method) -> bool {
    method.traits.exact
}

const SIZES: [(usize, usize); 6] = [(1, 1), (1, 9), (7, 1), (2, 2), (13, 17), (61, 40)];

fn noisy(width: usize, height: usize, exposure: f32) -> Frame {
    let noise = Noise { color: 0.3, edge: 0.3, distribution: Distribution::Uniform };
    let mut frame = synthetic::noisy(&picture((width, height)), noise, 1);
    expose(&mut frame, exposure);
    frame
}

fn run(method: &Method, frame: &Frame) -> Result<Image, Error> {
    let method = parse(method.id)?;
    solve(method.as_ref(), frame, &Context::QUIET).map(|solution| solution.image)
}

fn assert_close(method: &Method, a: &Image, b: &Image, tolerance: f32) {
    for (a, b) in a.data.iter().zip(&b.data) {
        assert!((a - b).abs() <= tolerance * b.abs().max(1e-3), "{}: {a} instead of {b}", method.id);
    }
}

#[test]
fn a_noise_free_frame_is_a_fixed_point_at_every_size() {
    for &method in METHODS.iter().filter(is_exact) {
        for (width, height) in SIZES {
            let image = picture((width, height));
            assert_close(method, &run(method, &exact(&image)).unwrap(), &image, 1e-4);
            let flat = Image::from_rgb(width, height, |_, _| vec3(0.25, 3.0, 0.0));
            assert_close(method, &run(method, &exact(&flat)).unwrap(), &flat, 1e-5);
        }
    }
}

#[test]
fn frames_of_one_pixel_and_of_one_row_have_finite_images() {
    for &method in METHODS.iter() {
        for (width, height) in SIZES {
            let image = run(method, &noisy(width, height, 1.0)).unwrap();
            assert!(image.shape() == (width, height, 3) && image.not_finite().is_none(), "{}", method.id);
        }
    }
}

/// A frame whose columns are in reverse order or, if `turned`, are its rows.
fn moved(frame: &Frame, turned: bool) -> Frame {
    let (w, h) = (frame.width, frame.height);
    let size = if turned { (h, w) } else { (w, h) };
    let mut made = Frame::new(size.0, size.1);
    for (layer, image) in frame.present() {
        let partner = match layer {
            Layer::Dx => Layer::Dy,
            Layer::Dy => Layer::Dx,
            Layer::DxVariance => Layer::DyVariance,
            Layer::DyVariance => Layer::DxVariance,
            Layer::BinDx(k) => Layer::BinDy(k),
            Layer::BinDy(k) => Layer::BinDx(k),
            Layer::BinAmbientDx(k) => Layer::BinAmbientDy(k),
            Layer::BinAmbientDy(k) => Layer::BinAmbientDx(k),
            other => other,
        };
        // A difference to the right belongs to the left one of two pixels, and has the other sign if that is the right one.
        let to_the_right = matches!(layer, Layer::Dx | Layer::DxVariance | Layer::BinDx(_) | Layer::BinAmbientDx(_));
        let sign = if matches!(layer, Layer::Dx | Layer::BinDx(_) | Layer::BinAmbientDx(_)) { -1.0 } else { 1.0 };
        let from = |x: usize, y: usize| match (turned, to_the_right) {
            (true, _) => Some((y, x)),
            (false, true) => (x + 1 < w).then(|| (w - 2 - x, y)),
            (false, false) => Some((w - 1 - x, y)),
        };
        let value = |c: usize, x: usize, y: usize| {
            let value = from(x, y).map_or(0.0, |(x, y)| image.pixel(x, y)[c]);
            if turned { value } else { sign * value }
        };
        let pixels = (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y)));
        let data = pixels.flat_map(|(x, y)| (0..image.channels).map(move |c| (c, x, y)));
        let data = data.map(|(c, x, y)| value(c, x, y)).collect();
        made.set(if turned { partner } else { layer }, Image { data, ..Image::new(size.0, size.1, image.channels) });
    }
    made
}

#[test]
fn turned_and_mirrored_frames_have_images_that_are_as_good() {
    let truth = picture((61, 40));
    let error = |image: &Image, truth: &Image| -> f64 {
        let square = |(a, b): (&f32, &f32)| f64::from(a - b).powi(2);
        image.data.iter().zip(&truth.data).map(square).sum::<f64>() / truth.data.len() as f64
    };
    for &method in METHODS.iter() {
        let frame = noisy(61, 40, 1.0);
        let plain = error(&run(method, &frame).unwrap(), &truth);
        for turned in [false, true] {
            let mut with_truth = frame.clone();
            with_truth.set(Layer::Color, truth.clone());
            let truth = moved(&with_truth, turned).get(Layer::Color).unwrap().clone();
            let other = error(&run(method, &moved(&frame, turned)).unwrap(), &truth);
            let ratio = other / plain;
            assert!((0.7..1.43).contains(&ratio), "{}, turned {turned}: {other:.2e} instead of {plain:.2e}", method.id);
        }
    }
}

#[test]
fn exposure_does_not_matter() {
    for &method in METHODS.iter() {
        let normal = run(method, &noisy(23, 14, 1.0)).unwrap();
        for scale in [1e-6, 1e6] {
            let mut scaled = run(method, &noisy(23, 14, scale)).unwrap();
            scaled.data.iter_mut().for_each(|value| *value /= scale);
            assert_close(method, &scaled, &normal, method.traits.exposure_tolerance);
        }
    }
}

#[test]
fn directly_seen_emitters_are_added_after_reconstruction() {
    for &method in METHODS.iter().filter(|method| method.traits.direct_apart) {
        let mut frame = exact(&picture((9, 9)));
        let without = run(method, &frame).unwrap();
        let mut direct = Image::new(9, 9, 3);
        direct.pixel_mut(4, 4).copy_from_slice(&[100.0, 50.0, 25.0]);
        frame.set(Layer::Direct, direct.clone());
        let mut expected = without;
        expected.add(&direct);
        assert_close(method, &run(method, &frame).unwrap(), &expected, 1e-6);
    }
}

#[test]
fn threads_do_not_matter() {
    for &method in METHODS.iter() {
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| run(method, &noisy(40, 33, 1.0)).unwrap())
        };
        assert!(on(1) == on(2), "{}", method.id);
    }
}

#[test]
fn the_bound_on_memory_changes_no_bit_or_is_refused() {
    for &method in METHODS.iter() {
        let made = parse(method.id).unwrap();
        let frame = noisy(70, 150, 1.0);
        let free = run(method, &frame).unwrap();
        let mut taken = 0;
        for megabytes in (1..12).chain([1000]) {
            let context = Context { memory: Some(megabytes << 20), ..Context::QUIET };
            match solve(made.as_ref(), &frame, &context) {
                Ok(solution) => {
                    taken += 1;
                    assert!(solution.image == free, "{} within {megabytes} MB", method.id);
                }
                Err(error) => {
                    assert!(error.to_string().contains("--max-memory"), "{error}");
                    assert_eq!(taken, 0, "{}: {megabytes} MB are not enough, but less was", method.id);
                }
            }
        }
        assert!(taken > 0, "{}", method.id);
    }
}

#[test]
fn the_memory_that_an_error_names_is_enough() {
    for method in reconstruct::METHODS {
        // Open Image Denoise may not be there.
        let Ok(made) = parse(method.id) else { continue };
        for (width, height) in [(16, 16), (70, 150)] {
            let frame = noisy(width, height, 1.0);
            let solved = |memory| solve(made.as_ref(), &frame, &Context { memory: Some(memory), ..Context::QUIET });
            let Err(error) = solved(0) else { continue };
            let named = error.to_string().rsplit(' ').next().and_then(|word| word.parse::<u64>().ok()).unwrap();
            if let Err(error) = solved(named << 20) {
                panic!("{} of {width}x{height} with the {named} MB that it asks for: {error}", method.id);
            }
        }
    }
}

#[test]
fn finite_layers_make_finite_images() {
    // Every magnitude next to every other, black pixels, negative ones, and variances that do not fit the values.
    let extreme = |seed: u64, i: usize| {
        let random = |k: u64| rng::unit(rng::combine(rng::combine(seed, k), i as u64));
        match (random(1) * 6.0) as u32 {
            0 => 0.0,
            1 => 1e-18 * random(2),
            2 => 1e9 * random(2),
            3 => -random(2),
            _ => 10f32.powf(12.0 * random(2) - 6.0),
        }
    };
    for &method in METHODS.iter() {
        for seed in 0..6 {
            let mut frame = exact(&picture((37, 29)));
            for (k, layer) in Layer::all().enumerate() {
                let mut image = frame.get(layer).unwrap().clone();
                let variance = layer.name().ends_with("variance");
                let kept = seed == 0 || layer.info().unit == "count";
                for (i, value) in image.data.iter_mut().enumerate().filter(|_| !kept) {
                    let new = extreme(100 * seed + k as u64, i);
                    *value = if variance { new.abs() } else { new };
                }
                frame.set(layer, image);
            }
            let solution = solve(parse(method.id).unwrap().as_ref(), &frame, &Context::QUIET).unwrap();
            let error = solution.error.unwrap_or_default();
            let all = solution.image.data.iter().chain(&error.data);
            assert!(all.into_iter().all(|value| value.is_finite()), "{}, seed {seed}", method.id);
        }
    }
}

#[test]
fn notes_are_made_on_request_only() {
    for &method in METHODS.iter() {
        let made = parse(method.id).unwrap();
        let frame = noisy(20, 30, 1.0);
        assert!(solve(made.as_ref(), &frame, &Context::QUIET).unwrap().notes.is_empty());
        let solution = solve(made.as_ref(), &frame, &Context { notes: true, ..Context::QUIET }).unwrap();
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
        for note in &solution.notes {
            assert!(note.name.chars().all(plain) && note.image.data.iter().all(|value| value.is_finite()));
        }
        assert_eq!(solution.image, run(method, &frame).unwrap());
    }
}

#[test]
fn a_missing_layer_is_named_with_the_way_to_get_it() {
    for &method in METHODS.iter() {
        let needs = parse(method.id).unwrap().needs();
        let mut frame = Frame::new(3, 3);
        assert!(run(method, &frame).unwrap_err().to_string().contains("`R, G, B`"));
        frame.set(Layer::Color, Image::new(3, 3, 3));
        frame.set(Layer::ColorVariance, Image::new(3, 3, 3));
        frame.set(Layer::Samples, Image { data: vec![1.0; 9], ..Image::new(3, 3, 1) });
        if needs.edges.is_on() {
            let message = run(method, &frame).unwrap_err().to_string();
            assert!(message.contains("dx.R") && message.contains("--method"), "{message}");
        }
    }
}

#[test]
fn any_layer_may_be_missing() {
    let frame = noisy(13, 9, 1.0);
    for &method in METHODS.iter() {
        for (removed, _) in frame.present() {
            let mut rest = Frame::new(frame.width, frame.height);
            frame
                .present()
                .filter(|(layer, _)| *layer != removed)
                .for_each(|(layer, image)| rest.set(layer, image.clone()));
            // Either it is done without, or the error names it.
            match run(method, &rest) {
                Ok(image) => assert!(image.not_finite().is_none(), "{} without {removed:?}", method.id),
                Err(Error::Missing { layer, .. }) => {
                    assert_eq!(layer, removed.channel_names().join(", "), "{}", method.id)
                }
                Err(error) => panic!("{} without {removed:?}: {error}", method.id),
            }
        }
    }
}

#[test]
fn values_that_are_not_finite_are_errors_that_name_the_pixel() {
    for &method in METHODS.iter() {
        for poison in [f32::NAN, f32::INFINITY] {
            let mut frame = noisy(5, 4, 1.0);
            let mut color = frame.get(Layer::Color).unwrap().clone();
            color.pixel_mut(3, 2)[1] = poison;
            frame.set(Layer::Color, color);
            let message = run(method, &frame).unwrap_err().to_string();
            assert!(message.contains("channel G") && message.contains("3,2"), "{message}");
        }
    }
}

#[test]
fn parameters_are_checked() {
    for (text, expected) in [
        ("nosuch", "there are primal, l2, l1"),
        ("l1:iterations=0", "from 1 to 64"),
        ("l1:epsilon=2", "[1e-6, 1]"),
        ("control_variate:weights=nosuch", "uniform or variance or given"),
        ("control_variate:iterations=0", "from 1 to 10000"),
        ("least_trimmed:norm=l3", "l1 or l2"),
        ("nlm:window=13", "from 1 to 12"),
        ("rdfc:choice=0", "from 1 to 12"),
        ("nfor:k=0", "[0.01, 100]"),
        ("frgr:levels=0", "from 1 to 8"),
        ("frgr:form=nosuch", "paper, code or best"),
        ("frgr:albedo=maybe", "on or off"),
        ("frgr:radius=11", "from 1 to 10"),
        ("feature:rounds=1", "from 2 to 100"),
        ("feature:variances=both", "samples or draws"),
        ("apr:features=normal+colour", "some of normal+albedo"),
        ("apr:order=2-1", "from 0 to 3"),
        ("apr:order=4", "from 0 to 3"),
        ("apr:windows=8", "from 12 to 60"),
        ("apr:outliers=0", "off or a number"),
        ("l2:beta=1", "it has alpha"),
        ("l2:alpha", "not like name=value"),
        ("l2:alpha=0", "must be a number"),
        ("l2:alpha=nan", "must be a number"),
        ("primal:x=1", "it has none"),
    ] {
        let message = parse(text).err().unwrap_or_else(|| panic!("{text} is taken")).to_string();
        assert!(message.contains(expected), "{text}: {message}");
    }
    for text in ["apr:features=none", "apr:order=1", "apr:windows=20+44,outliers=off", "feature:prefilter=nlm"] {
        assert!(parse(text).is_ok(), "{text}");
    }
    for text in ["l2:alpha=0.5", "control_variate:cross=on,iterations=3", "least_trimmed:norm=l2", "nlm:features=off"] {
        assert!(parse(text).is_ok(), "{text}");
    }
}
