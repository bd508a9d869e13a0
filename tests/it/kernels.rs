//! Differences to chosen neighbours: those of the cross to the bit, unbiased whatever the neighbours, the same however a render is
//! interrupted.

use std::sync::Mutex;
use std::time::Duration;

use assert_cmd::Command;
use fluxion::checkpoint::{self, Origin, Run};
use fluxion::film::{EdgeNeed, EdgeParts, Edges, Film, Kernel, Layer, Needs, Recorded};
use fluxion::image::Image;
use fluxion::mitsuba::{self, Options};
use fluxion::neighbours::Selector;
use fluxion::reconstruct::{self, Context};
use fluxion::render::{Budget, Control, RenderOutcome, RenderSettings, Shift, render, resume};
use fluxion::scene::Scene;

use crate::common::{bundled, check_zero, film, root};

const ALL: EdgeParts = EdgeParts { variance: true, bins: true, ambient: true };

fn settings(kernel: &str, spp: u32, seed: u64, needs: Needs) -> RenderSettings {
    let kernel = Selector::parse(kernel, Some(3)).unwrap();
    RenderSettings { seed, kernel, ..RenderSettings::new(Budget::Spp(spp), needs) }
}

fn kernel_film(scene: &Scene, settings: RenderSettings) -> Film {
    render(scene, settings, &Control::QUIET).film
}

/// The values of edges, in an order that depends on their ends only.
fn values(edges: &Edges) -> Vec<(usize, usize, String)> {
    let parts = |edge: usize| {
        format!(
            "{:?} {:?} {:?} {:?} {}",
            edges.mean[edge], edges.variance[edge], edges.bins[edge], edges.ambient[edge], edges.counts[edge]
        )
    };
    (0..edges.len()).map(|edge| (edges.ends(edge)[0], edges.ends(edge)[1], parts(edge))).collect()
}

#[test]
fn the_four_nearest_neighbours_are_the_cross_to_the_bit() {
    for (name, shift) in [("glossy-metal", "reconnect"), ("unit/lens", "reconnect"), ("cornell-box", "replay")] {
        let scene = bundled(name, (37, 21));
        let shift = Shift::named(shift).unwrap();
        let of = |kernel| {
            let settings = RenderSettings { shift, ..settings(kernel, 9, 5, Needs::ALL) };
            kernel_film(&scene, settings).develop()
        };
        let (chosen, cross) = (of("nearest:k=4"), of("cross"));
        assert!(chosen.own_edges().is_some() && chosen.get(Layer::Dx).is_none());
        for layer in [Layer::Color, Layer::Albedo, Layer::Direct] {
            assert_eq!(chosen.get(layer), cross.get(layer), "{name}");
        }
        if shift == Shift::default() {
            assert_eq!(values(&chosen.edges(ALL).unwrap()), values(&cross.edges(ALL).unwrap()), "{name}");
        } else {
            // Directed edges average both ends by their counts, which are equal here.
            let apart = |a: &Edges, b: &Edges| {
                (0..a.len()).map(|e| (a.mean[e] - b.mean[e]).abs().max_element()).fold(0.0, f32::max)
            };
            let (a, b) = (chosen.edges(ALL).unwrap(), cross.edges(ALL).unwrap());
            assert!(a.len() == b.len() && apart(&a, &b) < 1e-5, "{name}: {}", apart(&a, &b));
        }
    }
}

/// Independent pairs of a render with differences and a path-traced one.
const RUNS: u64 = 16;

/// Differences across every edge of a kernel minus those of independent images have mean zero.
fn check_unbiased(name: &str, kernel: &str, shift: &str, max_depth: Option<u32>) {
    let options = Options { size: Some((20, 16)), max_depth, ..Options::default() };
    let scene = mitsuba::load(&root().join("scenes").join(name).join("scene.xml"), &options).unwrap();
    let shift = Shift::named(shift).unwrap();
    // Neighbours of the first run, for all: runs with neighbours of their own could not be compared edge by edge.
    let first = kernel_film(&scene, RenderSettings { shift, ..settings(kernel, 4, 99, NEEDS) });
    let Kernel::Chosen(neighbours) = first.kernel() else { panic!("no neighbours were chosen") };
    let mut offsets = 0;
    let runs: Vec<Vec<f64>> = (0..RUNS)
        .map(|run| {
            let settings = RenderSettings { shift, ..settings(kernel, 64, 2 * run, NEEDS) };
            let mut outcome = RenderOutcome::new(&scene, NEEDS);
            outcome.film.choose((**neighbours).clone());
            let frame = resume(&scene, settings, &Control::QUIET, outcome).film.develop();
            let image = film(&scene, 128, 2 * run + 1, Needs::default()).develop();
            let (edges, color) = (frame.edges(EdgeParts::default()).unwrap(), image.get(Layer::Color).unwrap());
            offsets = edges.offsets().len();
            let at = |pixel: usize| color.rgb(pixel % 20, pixel / 20);
            let error = |edge: usize| edges.mean[edge] - (at(edges.ends(edge)[1]) - at(edges.ends(edge)[0]));
            (0..edges.len()).flat_map(|edge| error(edge).to_array().map(f64::from)).collect()
        })
        .collect();
    assert!(offsets >= if kernel.starts_with("nearest") { 4 } else { 8 }, "{name}: {offsets} offsets");
    check_zero(&format!("{name}, {kernel}"), &runs);
}

const NEEDS: Needs = Needs::EDGES.with(Recorded::Features);

macro_rules! unbiased {
    ($($test:ident: $scene:literal, $kernel:literal, $shift:literal;)*) => {
        $(#[test] fn $test() { check_unbiased($scene, $kernel, $shift, None); })*
    };
}

unbiased! {
    unbiased_to_random_neighbours: "unit/occluder", "random", "reconnect";
    unbiased_to_random_neighbours_on_metals: "glossy-metal", "random:k=6", "reconnect";
    unbiased_to_random_neighbours_through_glass: "unit/dielectric", "random:k=3", "reconnect";
    unbiased_to_random_neighbours_through_a_lens: "unit/lens", "random", "reconnect";
    unbiased_to_similar_neighbours: "cornell-box", "structure", "reconnect";
    unbiased_to_similar_neighbours_on_plastic: "unit/plastic", "structure:k=5", "reconnect";
    unbiased_to_random_neighbours_from_one_end: "unit/occluder", "random", "replay";
    unbiased_to_similar_neighbours_from_one_end: "unit/dielectric", "structure", "replay";
    unbiased_to_the_window: "unit/environment", "nearest:k=24", "reconnect";
}

#[test]
fn direct_light_is_unbiased_by_either_shift() {
    for shift in ["reconnect", "replay"] {
        check_unbiased("unit/occluder", "random", shift, Some(2));
    }
}

#[test]
fn a_pilot_counts_as_colour_but_not_as_differences() {
    let scene = bundled("cornell-box", (24, 20));
    let frame = kernel_film(&scene, settings("structure", 9, 5, NEEDS)).develop();
    let plain = film(&scene, 9, 5, Needs::default()).develop();
    assert_eq!(frame.get(Layer::Color), plain.get(Layer::Color));
    assert!(frame.get(Layer::EdgeSamples).unwrap().data.iter().all(|&count| count == 6.0));
    assert!(frame.own_edges().unwrap().counts.iter().all(|&count| count == 6));
    // Before its end there are no differences, and methods do without them.
    let early = kernel_film(&scene, settings("structure", 2, 5, NEEDS)).develop();
    assert!(early.own_edges().unwrap().is_empty());
    let solve = |method| {
        fluxion::reconstruct::solve(
            &*fluxion::reconstruct::parse(method).unwrap(),
            &early,
            &fluxion::reconstruct::Context::QUIET,
        )
    };
    let [reconstructed, plain] = ["control_variate", "primal"].map(|method| solve(method).unwrap().image);
    let close = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-6 * b.abs();
    assert!(reconstructed.data.iter().zip(&plain.data).all(close));
}

#[test]
fn renders_that_were_interrupted_choose_the_same_neighbours() {
    // Neighbours by what the film holds, and by samples that it does not.
    for kernel in ["structure", "learned", "learned:neighbours=cross"] {
        check_interrupted(kernel);
    }
}

fn check_interrupted(kernel: &str) {
    let scene = bundled("glossy-metal", (37, 21));
    let needs = Needs { edges: EdgeNeed::Thinned, ..NEEDS };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ckpt");
    let settings = |spp| settings(kernel, spp, 3, needs);
    let origin = Origin {
        version: "1".into(),
        epoch: fluxion::render::EPOCH,
        scene: "scene.xml".into(),
        content: checkpoint::content(&scene).unwrap(),
        fingerprint: "0".into(),
        method: "l2".into(),
        plan: String::new(),
        size: (37, 21),
        needs,
        shift: Shift::default(),
        kernel: settings(1).kernel,
        lights: Vec::new(),
        runs: vec![Run { seed: 3, first: 0, samples: 0 }],
    };
    let straight = kernel_film(&scene, settings(11));
    // In the pilot, at its end, and later.
    for spp in [2, 3, 7] {
        let outcome = render(&scene, settings(spp), &Control::QUIET);
        checkpoint::save(&path, &origin, &outcome, None).unwrap();
        let loaded = checkpoint::load(&path).unwrap();
        assert!(loaded.outcome.film == outcome.film && loaded.origin.kernel == origin.kernel, "{kernel} {spp}");
        let start = loaded.resume(&Mutex::default()).render;
        let resumed = resume(&scene, settings(11), &Control::QUIET, start);
        assert!(resumed.film == straight, "{kernel} {spp}");
    }
    let two = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    assert!(two.install(|| kernel_film(&scene, settings(11))) == straight);
    // A film with other neighbours cannot be added.
    let other_path = folder.path().join("b.ckpt");
    let other = RenderSettings { seed: 4, ..settings(7) };
    let mut outcome = render(&scene, other, &Control::QUIET);
    outcome.elapsed = Duration::from_secs(1);
    let origin = Origin { runs: vec![Run { seed: 4, first: 0, samples: 0 }], ..origin };
    checkpoint::save(&other_path, &origin, &outcome, None).unwrap();
    let refused = checkpoint::merge(&[path, other_path], &folder.path().join("c.ckpt")).unwrap_err().to_string();
    assert!(refused.contains("other neighbours"), "{refused}");
}

#[test]
fn learned_kernels_come_with_weights() {
    let scene = bundled("cornell-box", (40, 30));
    for (kernel, chosen) in [("learned", 4), ("learned:k=8", 8), ("learned:neighbours=cross", 4)] {
        let film = kernel_film(&scene, settings(kernel, 8, 1, NEEDS));
        let Kernel::Chosen(neighbours) = film.kernel() else { panic!("no neighbours were chosen") };
        let mut inner = (0..40 * 30).filter(|pixel| pixel % 40 > 1 && pixel % 40 < 38 && (80..1120).contains(pixel));
        // Every pixel has those that it chose, and those that chose it: at most twice as many in the mean.
        assert!(inner.all(|pixel| neighbours.degree(pixel) >= chosen), "{kernel}");
        assert!(neighbours.mean_degree() <= 2.0 * chosen as f64, "{kernel}: {}", neighbours.mean_degree());
        let frame = film.develop();
        let edges = frame.edges(EdgeParts { variance: true, ..EdgeParts::default() }).unwrap();
        assert!(edges.weights.len() == edges.len() && edges.weights.iter().flatten().all(|weight| *weight > 0.0));
        // Both reconstructions are about as bright as the samples.
        let mean = |image: &Image| image.data.iter().sum::<f32>() / image.data.len() as f32;
        let expected = mean(frame.get(Layer::Color).unwrap());
        for weights in ["given", "product"] {
            let method = reconstruct::parse(&format!("control_variate:weights={weights}")).unwrap();
            let found = mean(&method.reconstruct(&frame, &Context::QUIET).unwrap().image);
            assert!((found / expected - 1.0).abs() < 0.25, "{kernel} {weights}: {found} for {expected}");
        }
    }
}

#[test]
fn the_command_line_says_which_methods_take_which_neighbours() {
    let folder = tempfile::tempdir().unwrap();
    let scene = root().join("scenes/unit/diffuse/scene.xml");
    let run = |extra: &[&str]| {
        let mut command = Command::cargo_bin("fluxion").unwrap();
        command.current_dir(folder.path()).arg("render").arg(&scene);
        let output = command.args(["-o", "a.exr", "-q", "--size", "20x16"]).args(extra).output().unwrap();
        (output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    for (extra, expected) in [
        (&["--kernel", "structure"][..], "take --method l2, l1, control_variate"),
        (&["--kernel", "star", "--method", "l2"], "there are cross, nearest, structure, learned, random"),
        (&["--kernel", "structure:k=0", "--method", "l2"], "k, a number from 1 to 24"),
        (&["--kernel", "structure", "--method", "l2", "--spp", "4"], "give a smaller --pilot"),
        (&["--kernel", "learned:neighbours=cross", "--method", "l2", "--spp", "7"], "give a smaller --pilot"),
        (&["--max-depth", "x"], "a number of edges, or -1"),
    ] {
        let (done, message) = run(extra);
        assert!(!done && message.contains(expected), "{extra:?}: {message}");
    }
    let (done, message) = run(&["--kernel", "structure", "--method", "primal", "--spp", "1"]);
    assert!(done && message.contains("--kernel changes nothing"), "{message}");
    for method in ["l2", "l1", "least_trimmed", "feature", "apr"] {
        let kernel = [
            "--kernel",
            "structure:k=3",
            "--pilot",
            "2",
            "--spp",
            "8",
            "--method",
            method,
            "--layers",
            "l.exr",
            "--bins",
        ];
        let (done, message) = run(&kernel);
        assert!(done, "{method}: {message}");
        let mut again = Command::cargo_bin("fluxion").unwrap();
        let again =
            again.current_dir(folder.path()).args(["reconstruct", "l.exr", "-o", "b.exr", "-q", "--method", method]);
        again.assert().success();
        let image = |name: &str| fluxion::exr::load(&folder.path().join(name)).unwrap();
        assert_eq!(image("a.exr").get(Layer::Color), image("b.exr").get(Layer::Color), "{method}");
        assert_eq!(image("l.exr").provenance.kernel, "structure:k=3,threshold=0.3");
    }
    let adaptive = ["--kernel", "structure", "--method", "feature", "--spp", "24", "--adaptive"];
    let (done, message) = run(&adaptive);
    assert!(done, "{message}");
}

#[test]
fn a_depth_given_is_that_of_the_scene() {
    let with_depth = |depth: Option<u32>| {
        let path = root().join("scenes/cornell-box/scene.xml");
        let options = Options { size: Some((16, 16)), max_depth: depth, ..Options::default() };
        mitsuba::load(&path, &options).unwrap()
    };
    let brightness = |depth| {
        let frame = film(&with_depth(depth), 32, 1, Needs::default()).develop();
        frame.get(Layer::Color).unwrap().data.iter().sum::<f32>()
    };
    let (own, direct, none) = (brightness(None), brightness(Some(2)), brightness(Some(1)));
    assert!(none == 0.0 && direct > 0.0 && direct < 0.95 * own, "{none} {direct} {own}");
    assert_ne!(with_depth(Some(2)).fingerprint(), with_depth(None).fingerprint());
}
