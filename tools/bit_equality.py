#!/usr/bin/env python3
"""Checks that two builds of fluxion make the same bits: every method on the bundled scenes, rendered straight and
adaptively, and reconstructed from layers and from a checkpoint; chosen neighbours, light groups, and jobs of one round and two.

    tools/bit_equality.py OLD_FLUXION NEW_FLUXION [--scenes NAME...] [--methods NAME...] [--spp 8] [--size 48x36] [--python]

With --python the module `fluxion` of this interpreter has to make the new program's bits, too. Prints a line for every comparison and exits with 1 if any channel that both builds write differs. Channels that only one
of them writes are listed. Header attributes are not compared, since they hold times.
"""
import argparse
import hashlib
import pathlib
import subprocess
import sys
import tempfile

import exr

ROOT = pathlib.Path(__file__).resolve().parent.parent
METHODS = [
    "primal", "l2", "l1", "control_variate", "control_variate:weights=uniform", "control_variate:cross=on",
    "least_trimmed", "least_trimmed:norm=l2", "nlm", "rdfc", "nfor", "frgr", "frgr:form=paper", "frgr:form=code",
    "frgr:enhance=off", "feature", "feature:variances=draws,screen=0,prefilter=nlm", "feature:ambient=0.01", "apr",
    "gradnet", "net", "net:image=safe", "net:image=network", "net:image=filtered", "frgr:denoiser=net", "blend",
]
# Methods that estimate their error; the others allocate by variances.
ESTIMATES = ("primal", "frgr", "feature", "apr", "nfor", "rdfc", "gradnet", "net", "blend")


def hashes(path):
    """A hash of the bits of every channel."""
    wanted = exr.names(path)
    pixels = exr.channels(path, wanted)
    return {name: hashlib.sha256(pixels[:, :, k].tobytes()).hexdigest() for k, name in enumerate(wanted)}


def scenes():
    folders = sorted((ROOT / "scenes").glob("*/scene.xml")) + sorted((ROOT / "scenes" / "unit").glob("*/scene.xml"))
    return {str(path.parent.relative_to(ROOT / "scenes")): path for path in folders}


def runs(fluxion, scene, folder, arguments):
    """Runs a build on a scene. Returns the EXR files that it writes, by what they are."""
    common = ["--size", arguments.size, "--seed", "5", "-q"]
    files = {}

    def run(name, *words):
        files[name] = folder / f"{len(files)}.exr"
        subprocess.run([fluxion, *map(str, words), "-o", str(files[name])], check=True, stderr=subprocess.DEVNULL,
                       timeout=600)

    layers, film = folder / "layers.exr", folder / "film.ckpt"
    run("render all layers", "render", scene, *common, "--spp", arguments.spp, "--method", "l2", "--layers", layers,
        "--bins", "--occlusion", "--position", "--ambient", "--checkpoint", film)
    files["layers"] = layers
    run("render by replay", "render", scene, *common, "--spp", 2, "--shift", "replay", "--method", "l2")
    for method in arguments.methods:
        run(f"{method} straight", "render", scene, *common, "--spp", arguments.spp, "--method", method)
        run(f"{method} from layers", "reconstruct", layers, "--method", method, "-q")
        run(f"{method} from checkpoint", "reconstruct", film, "--method", method, "-q")
        allocator = "predicted_error" if method.split(":")[0] in ESTIMATES else "variance"
        run(f"{method} adaptive", "render", scene, *common, "--spp", 2 * arguments.spp, "--method", method, "--adaptive",
            allocator)
    for kernel, method in [("structure", "l2"), ("learned", "control_variate:weights=given")]:
        run(f"kernel {kernel}", "render", scene, *common, "--spp", 16, "--method", method, "--kernel", kernel)
    run("light groups", "render", scene, *common, "--spp", arguments.spp, "--light-groups", "all")
    for name, rounds in [("job", []), ("job of two rounds", ["--adaptive", "variance"])]:
        folder_of_job = folder / name
        seed, others = ["--seed", "5"], [word for word in common if word not in ("--seed", "5")]
        steps = [["plan", scene, "--spp", "32", "--chunks", "3", *seed, *rounds, "-o", folder_of_job, "--", *others,
                  "--method", "l2"]]
        steps += [["run", folder_of_job, str(chunk)] for chunk in ([0] if rounds else [0, 1, 2])]
        steps += [["allocate", folder_of_job], ["run", folder_of_job, "1"], ["run", folder_of_job, "2"]] if rounds else []
        for step in [*steps, ["merge", folder_of_job]]:
            subprocess.run([fluxion, "job", *map(str, step)], check=True, stdout=subprocess.DEVNULL,
                           stderr=subprocess.DEVNULL)
        files[name] = folder_of_job / f"{scene.parent.name}.exr"
    return files


def by_python(fluxion, scene, folder, arguments):
    """Images of the module and of the program."""
    import fluxion as module

    size, differing = tuple(map(int, arguments.size.split("x"))), 0
    for k, keywords in enumerate([{}, {"method": "frgr"}, {"method": "apr", "adaptive": "variance"}]):
        options = [word for name, value in keywords.items() for word in (f"--{name}", value)]
        image = folder / f"python{k}.exr"
        subprocess.run([fluxion, "render", scene, "--size", arguments.size, "--spp", "16", "-q", *options, "-o", image],
                       check=True, stderr=subprocess.DEVNULL)
        mine = module.render(scene, size=size, spp=16, **keywords).image
        differing += not (mine == module.read_image(image)).all()
    return differing


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("old", help="fluxion of the build before")
    parser.add_argument("new", help="fluxion of the build after")
    parser.add_argument("--scenes", nargs="+", default=list(scenes()), choices=list(scenes()), metavar="NAME")
    parser.add_argument("--methods", nargs="+", default=METHODS, metavar="NAME")
    parser.add_argument("--spp", type=int, default=8)
    parser.add_argument("--size", default="48x36")
    parser.add_argument("--python", action="store_true")
    arguments = parser.parse_args()
    compared = differing = 0
    for name in arguments.scenes:
        with tempfile.TemporaryDirectory() as first, tempfile.TemporaryDirectory() as second:
            old = runs(arguments.old, scenes()[name], pathlib.Path(first), arguments)
            new = runs(arguments.new, scenes()[name], pathlib.Path(second), arguments)
            for what in old:
                a, b = hashes(old[what]), hashes(new[what])
                wrong = [channel for channel in a if channel in b and a[channel] != b[channel]]
                alone = sorted(set(a) ^ set(b))
                compared, differing = compared + 1, differing + bool(wrong)
                if wrong or alone:
                    print(f"{name}, {what}: {'differs in ' + ' '.join(wrong[:6]) if wrong else 'equal'}"
                          f"{', only one has ' + ' '.join(alone) if alone else ''}", flush=True)
            if arguments.python:
                wrong = by_python(arguments.new, scenes()[name], pathlib.Path(second), arguments)
                compared, differing = compared + 3, differing + wrong
                if wrong:
                    print(f"{name}: {wrong} images of the module differ", flush=True)
        print(f"{name}: done", flush=True)
    print(f"{compared} files compared, {differing} differ")
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
