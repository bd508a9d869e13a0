"""Fluxion beside Mitsuba 3: radiance, gradients, correlation and speed, as the tables of docs/results.md.

    python tools/against_mitsuba.py radiance SCENES REFERENCES [SPP=512] [NAME] [mitsuba]
    python tools/against_mitsuba.py gradients [SPP=128]
    python tools/against_mitsuba.py correlation SCENES REFERENCES [SPP=64]
    python tools/against_mitsuba.py speed SCENES [SPP=8]
    python tools/against_mitsuba.py efficiency SCENES REFERENCES [SPP=32]
    python tools/against_mitsuba.py bundled [SPP=1024]
    python tools/against_mitsuba.py loading SCENES [NAME ...]

SCENES is a folder with NAME/scene.xml; REFERENCES one with NAME.exr (mean) and NAME_var.exr (variance of the mean),
box filtered. Run from the repository's top folder after `cargo build --release`. Needs PyPI openimageio and numpy, and
mitsuba for `speed`, `efficiency`, `bundled` and `loading` (with DRJIT_LIBLLVM_PATH naming libLLVM for the LLVM variant).
"""
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ET

import numpy as np

import exr

FLUXION = "target/release/fluxion"
SIZES = {"cornell-box": (256, 256), "veach-mis": (320, 180), "veach-ajar": (320, 180), "kitchen": (320, 180),
         "living-room": (320, 180)}
UNIT = ["diffuse", "rough-conductor", "dielectric", "environment", "occluder", "plastic", "rough-plastic", "mask", "bump",
        "thin-pane", "sphere-light", "mirror-rooms", "lens", "rough-glass", "instances", "principled", "normal-map"]


def rgb(channels, prefix=""):
    return np.stack([channels[prefix + c] for c in "RGB"], -1)


def fluxion(scene, size, spp, method, seed=1, extra=()):
    """Image, layers and statistics of a render."""
    with tempfile.TemporaryDirectory() as folder:
        at = lambda name: os.path.join(folder, name)
        subprocess.run([FLUXION, "render", scene, "-o", at("o.exr"), "--layers", at("l.exr"), "--json", at("s.json"), "-q",
                        "--size", "%dx%d" % size, "--spp", str(spp), "--seed", str(seed), "--method", method, *extra],
                       check=True)
        with open(at("s.json")) as file:
            return rgb(exr.everything(at("o.exr"))), exr.everything(at("l.exr")), json.load(file)


def z_row(name, mean, variance, reference, reference_variance, rest=""):
    """Mean ratio with its standard error, and what the differences are in standard errors."""
    total = variance + reference_variance
    z = np.where(np.abs(mean - reference) <= 1e-5 * reference, 0.0, (mean - reference) / np.sqrt(total + 1e-12))
    ratio = mean.sum((0, 1)) / reference.sum((0, 1))
    error = np.sqrt(total.sum((0, 1))) / reference.sum((0, 1))
    print("| %s | %s | %s | %.3f | %.2f %% |%s" % (
        name, " ".join("%.4f" % r for r in ratio), " ".join("%.4f" % e for e in error), np.sqrt((z * z).mean()),
        100 * (np.abs(z) > 4).mean(), rest), flush=True)


def public_scenes(scenes, references):
    """Name, scene file, mean, variance of the mean, and whether the variance is that of one sample."""
    for name in sorted(n[:-8] for n in os.listdir(references) if n.endswith("_var.exr")):
        reference = os.path.join(references, name)
        yield name, os.path.join(scenes, name, "scene.xml"), reference + ".exr", reference + "_var.exr", False
    for folder, _, files in sorted(os.walk(os.path.join(scenes, "mitsuba-tests"))):
        for file in sorted(f for f in files if f.endswith("_ref_rgb.exr")):
            stem = file[:-len("_ref_rgb.exr")]
            for scene in (f for f in os.listdir(os.path.dirname(folder)) if f.startswith(stem + "_") and f.endswith(".xml")):
                if scene[len(stem) + 1:-4] in ("path", "direct"):
                    path = os.path.join(folder, file)
                    name = stem.removeprefix("test_") if stem != "scene" else os.path.basename(os.path.dirname(folder))
                    yield name, os.path.join(os.path.dirname(folder), scene), path, path[:-4] + "_var.exr", True


def fresh(path, size, spp=512, runs=8):
    """Mean and variance of the mean of Mitsuba's own renders."""
    import mitsuba as mi
    mi.set_variant("llvm_ad_rgb")
    scene = mitsuba_scene(mi, path, size)
    images = [np.array(mi.render(scene, spp=spp, seed=10 + s), dtype=np.float64)[..., :3] for s in range(runs)]
    return np.mean(images, 0), np.var(images, 0, ddof=1) / runs


def radiance(scenes, references, spp="512", only="", program="fluxion"):
    """Every scene against its reference, by Fluxion or, to tell what is the reference's own, by `mitsuba`. Variances of a single sample are divided by our samples; those of test
    references were taken with many more samples than we have, so that they count as exact."""
    print("| scene | mean ratio R G B | standard error | z rms | beyond 4 | load s | render s | MB |")
    print("|---|---|---|---|---|---|---|---|")
    for name, scene, reference, variance, of_sample in public_scenes(scenes, references):
        if only not in name:
            continue
        expected, theirs = rgb(exr.everything(reference)), rgb(exr.everything(variance))
        samples = 4 * int(spp) if of_sample else int(spp)
        if name == "texture_interp":
            # Its reference was filtered with a Gaussian: a new one is rendered.
            expected, theirs = fresh(scene, expected.shape[1::-1])
            of_sample = False
        rest = ""
        if program == "mitsuba":
            mean, ours = fresh(scene, expected.shape[1::-1], samples // 8)
        else:
            _, layers, stats = fluxion(scene, expected.shape[1::-1], samples, "primal")
            mean = rgb(layers) + rgb(layers, "direct.")
            ours = rgb(layers, "variance.") + rgb(layers, "direct_variance.")
            rest = " %.2f | %.1f | %.0f |" % (
                stats["seconds"]["load"], stats["seconds"]["render"], stats["peak_bytes"] / 1e6)
        if of_sample:
            # Pixels that all of one program's samples missed have no variance there; the floor is for rounding.
            ours, theirs = np.maximum(np.maximum(ours, theirs / samples), 1e-4 / samples), 0
        z_row(name, mean, ours, expected, theirs, rest)


def gradients(spp="128", runs=16):
    """Sampled edges minus those of independent path-traced images: Student's t over RUNS pairs of renders."""
    print("| scene | values | mean t | spread (1.07) | beyond 4 (0.12 %) | variance of an edge over two colours |")
    print("|---|---|---|---|---|---|")
    for name in UNIT:
        scene = "scenes/unit/%s/scene.xml" % name
        errors, ratio = {"dx": [], "dy": []}, []
        for run in range(runs):
            _, layers, _ = fluxion(scene, (48, 36), int(spp), "l2", seed=2 * run)
            _, other, _ = fluxion(scene, (48, 36), 2 * int(spp), "primal", seed=2 * run + 1)
            for edge, axis in (("dx", 1), ("dy", 0)):
                inside = (slice(None), slice(0, -1)) if axis == 1 else (slice(0, -1),)
                both = lambda v: (v[:, 1:] + v[:, :-1]) if axis == 1 else (v[1:] + v[:-1])
                errors[edge].append((rgb(layers, edge + ".")[inside] - np.diff(rgb(other), axis=axis)).ravel())
                ratio.append((rgb(layers, edge + "_variance.").sum(), both(rgb(layers, "variance.")).sum()))
        t = []
        for values in errors.values():
            values = np.array(values)
            deviation = values.std(0, ddof=1) / np.sqrt(runs)
            t.append(values.mean(0)[deviation > 0] / deviation[deviation > 0])
        t, ratio = np.concatenate(t), np.array(ratio).sum(0)
        print("| %s | %d | %+.3f | %.3f | %.2f %% | %.3f |" % (name, t.size, t.mean(), np.sqrt((t * t).mean()),
              100 * (np.abs(t) > 4).mean(), ratio[0] / ratio[1]), flush=True)


def correlation(scenes, references, spp="64"):
    print("| scene | relMSE of primal | relMSE of l2 | l2 / primal | floor of the reference |\n|---|---|---|---|---|")
    for name, size in SIZES.items():
        reference = rgb(exr.everything(os.path.join(references, name + ".exr")))
        weight = 1 / (reference * reference + 0.01)
        floor = (rgb(exr.everything(os.path.join(references, name + "_var.exr"))) * weight).mean()
        image, layers, _ = fluxion(os.path.join(scenes, name, "scene.xml"), size, int(spp), "l2")
        primal = rgb(layers) + rgb(layers, "direct.")
        # The reference's own noise is in both figures: it is taken off.
        error = [((one - reference) ** 2 * weight).mean() - floor for one in (primal, image)]
        print("| %s | %.4g | %.4g | %.3f | %.2g |" % (name, *error, error[1] / error[0], floor), flush=True)


def mitsuba_scene(mi, path, size, sampler=None):
    """The scene with a box filter at another size, and with another sampler where one is named."""
    tree = ET.parse(path)
    for element in tree.getroot().iter("sampler") if sampler else ():
        element.set("type", sampler)
    for film in tree.getroot().iter("film"):
        for old in film.findall("rfilter"):
            film.remove(old)
        ET.SubElement(film, "rfilter", type="box")
        # A cropped film keeps the size of its window.
        cropped = [e for e in film.findall("integer") if e.get("name").startswith("crop_")]
        for key, value in [] if cropped else zip(("width", "height"), size):
            for old in [e for e in film.findall("integer") if e.get("name") == key]:
                old.set("value", str(value))
    with tempfile.NamedTemporaryFile("wb", suffix=".xml", dir=".", delete=False) as file:
        tree.write(file)
    try:
        # Names in the file are relative to its folder.
        mi.file_resolver().prepend(os.path.dirname(os.path.abspath(path)))
        return mi.load_file(file.name)
    finally:
        os.unlink(file.name)


def speed(scenes, spp="8"):
    """Millions of samples a second; the programs take turns, the median of five counts."""
    import mitsuba as mi
    print("| scene | path | gradient | cost of a gradient sample | scalar_rgb | llvm_ad_rgb | path / scalar | path / llvm |")
    print("|---|---|---|---|---|---|---|---|")
    for name in ("cornell-box", "kitchen", "veach-ajar", "living-room", "classroom"):
        path = os.path.join(scenes, name, "scene.xml")
        size = (512, 512) if name == "cornell-box" else (640, 360)
        rates = {"path": [], "gradient": [], "scalar_rgb": [], "llvm_ad_rgb": []}
        loaded = {}
        for variant in ("scalar_rgb", "llvm_ad_rgb"):
            mi.set_variant(variant)
            loaded[variant] = mitsuba_scene(mi, path, size)
            np.array(mi.render(loaded[variant], spp=1, seed=0))
        for seed in range(5):
            for kind, method in (("path", "primal"), ("gradient", "l2")):
                with tempfile.TemporaryDirectory() as folder:
                    stats = os.path.join(folder, "s.json")
                    subprocess.run([FLUXION, "render", path, "-o", os.path.join(folder, "o.exr"), "--json", stats, "-q",
                                    "--size", "%dx%d" % size, "--spp", str(spp), "--seed", str(seed), "--method", method,
                                    "--threads", "2"], check=True)
                    with open(stats) as file:
                        record = json.load(file)
                rates[kind].append(record["samples"] / record["seconds"]["render"] / 1e6)
            for variant in loaded:
                mi.set_variant(variant)
                start = time.time()
                np.array(mi.render(loaded[variant], spp=int(spp), seed=seed))
                rates[variant].append(size[0] * size[1] * int(spp) / (time.time() - start) / 1e6)
        m = {key: statistics.median(values) for key, values in rates.items()}
        print("| %s | %.3f | %.3f | %.2f | %.3f | %.3f | %.2f | %.2f |" % (
            name, m["path"], m["gradient"], m["path"] / m["gradient"], m["scalar_rgb"], m["llvm_ad_rgb"],
            m["path"] / m["scalar_rgb"], m["path"] / m["llvm_ad_rgb"]), flush=True)


def efficiency(scenes, references, spp="32"):
    """Error of path tracing for the time: relMSE without the references' noise, times seconds; means of three seeds."""
    import mitsuba as mi
    mi.set_variant("llvm_ad_rgb")
    samplers = ("independent", "multijitter", "ldsampler")
    print("| scene | Fluxion | %s | Fluxion / best |" % " | ".join(samplers))
    print("|---" * (len(samplers) + 3) + "|")
    for name in ("cornell-box", "kitchen", "veach-ajar", "living-room", "classroom"):
        path, reference = (os.path.join(folder, name) for folder in (scenes, references))
        path = os.path.join(path, "scene.xml")
        expected, noise = (rgb(exr.everything(reference + end + ".exr")) for end in ("", "_var"))
        size = expected.shape[1::-1]
        products = {kind: [] for kind in ("fluxion", *samplers)}
        loaded = {sampler: mitsuba_scene(mi, path, size, sampler) for sampler in samplers}
        for scene in loaded.values():
            np.array(mi.render(scene, spp=int(spp), seed=0))
        for seed in range(1, 4):
            image, _, record = fluxion(path, size, int(spp), "primal", seed=seed)
            renders = [("fluxion", image, record["seconds"]["render"])]
            for sampler, scene in loaded.items():
                start = time.time()
                image = np.array(mi.render(scene, spp=int(spp), seed=seed), dtype=np.float64)[..., :3]
                renders.append((sampler, image, time.time() - start))
            for kind, image, seconds in renders:
                error = (((image - expected) ** 2 - noise) / (expected ** 2 + 0.01)).mean()
                products[kind].append(error * seconds)
        mean = {kind: statistics.mean(values) for kind, values in products.items()}
        best = min(mean[sampler] for sampler in samplers)
        print("| %s | %s | %.2f |" % (name, " | ".join("%.4g" % value for value in mean.values()), mean["fluxion"] / best),
              flush=True)


def bundled(spp="1024"):
    """Our own scenes, rendered by both."""
    print("| scene | mean ratio R G B | standard error | z rms | beyond 4 |\n|---|---|---|---|---|")
    names = ["unit/" + n for n in sorted(os.listdir("scenes/unit")) if os.path.exists("scenes/unit/%s/scene.xml" % n)]
    for name in ["cornell-box", "door-ajar", "glossy-metal", "glass-caustic"] + names:
        path, size = "scenes/%s/scene.xml" % name, (32, 24) if name == "unit/orthographic" else (64, 48)
        _, layers, _ = fluxion(path, size, int(spp), "primal")
        expected, theirs = fresh(path, size, int(spp) // 8)
        mean = rgb(layers) + rgb(layers, "direct.")
        variance = rgb(layers, "variance.") + rgb(layers, "direct_variance.")
        z_row(name, mean, variance, expected, theirs)


LOAD = """
import sys, time, resource
import mitsuba as mi
mi.set_variant(sys.argv[1])
start = time.time()
mi.load_file(sys.argv[2])
print(time.time() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3)
"""


def loading(scenes, *names):
    """Seconds to a scene that is ready to be rendered, and peak memory; the programs take turns, medians of five."""
    print("| scene | Fluxion s | MB | scalar_rgb s | MB | llvm_ad_rgb s | MB | Fluxion / scalar | Fluxion / llvm |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in names or ("kitchen", "staircase"):
        path = os.path.join(scenes, name, "scene.xml")
        figures = {"fluxion": [], "scalar_rgb": [], "llvm_ad_rgb": []}
        for _ in range(5):
            _, _, stats = fluxion(path, (8, 8), 1, "primal")
            figures["fluxion"].append((stats["seconds"]["load"], stats["peak_bytes"] / 1e6))
            for variant in ("scalar_rgb", "llvm_ad_rgb"):
                run = subprocess.run([sys.executable, "-c", LOAD, variant, path], capture_output=True, text=True, check=True)
                figures[variant].append(tuple(float(word) for word in run.stdout.split()[-2:]))
        middle = {key: [statistics.median(column) for column in zip(*rows)] for key, rows in figures.items()}
        ours, scalar, llvm = (middle[key] for key in figures)
        print("| %s | %.2f | %.0f | %.2f | %.0f | %.2f | %.0f | %.2f | %.2f |" % (
            name, *ours, *scalar, *llvm, ours[0] / scalar[0], ours[0] / llvm[0]), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    for table, folders, spp in ((radiance, ("scenes", "references"), 512), (gradients, (), 128),
                                (correlation, ("scenes", "references"), 64), (speed, ("scenes",), 8),
                                (efficiency, ("scenes", "references"), 32), (bundled, (), 1024)):
        command = commands.add_parser(table.__name__, help=table.__doc__)
        for folder in folders:
            command.add_argument(folder)
        command.add_argument("spp", nargs="?", type=int, default=spp)
        command.set_defaults(table=table)
        if table is radiance:
            command.add_argument("only", nargs="?", default="")
            command.add_argument("program", nargs="?", choices=["fluxion", "mitsuba"], default="fluxion")
    command = commands.add_parser("loading", help=loading.__doc__)
    command.add_argument("scenes")
    command.add_argument("names", nargs="*")
    command.set_defaults(table=lambda scenes, names: loading(scenes, *names))
    args = vars(parser.parse_args())
    table = args.pop("table")
    args.pop("command")
    table(*args.values())


if __name__ == "__main__":
    main()
