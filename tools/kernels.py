"""Reconstructions on the cross and on other kernels at equal samples, as the tables of docs/kernels.md.

    python tools/kernels.py SCENES REFERENCES [--depth N [--reference 8192] [--keep DIR]] [--spp 16,64] [--seeds 3] [--kernels cross,structure] [--shift reconnect] [--method l1]

SCENES is a folder with NAME/scene.xml; REFERENCES one with NAME.exr and NAME_var.exr. With a depth other than the scenes' own the
references are rendered here, by path tracing with --reference samples of another seed. Errors are means over seeds and geometric means over
scenes; weights that a kernel comes with are compared with weights by variance of the first kernel. Run from the repository's top folder
after `cargo build --release`. Needs PyPI openimageio and numpy.
"""
import argparse
import json
import math
import os
import statistics
import subprocess
import tempfile

import numpy as np

import exr

FLUXION = os.environ.get("FLUXION", "target/release/fluxion")
NAMES = ("cornell-box", "kitchen", "veach-ajar", "living-room", "classroom", "staircase")
WEIGHTS = ("uniform", "variance")
# Of kernels that come with weights.
OWN_WEIGHTS = ("given", "product")


# The method whose weights are compared.
CONTROL = "control_variate"


def weights_of(kernel, method=CONTROL):
    """Weights to compare; other methods have their own."""
    if method != CONTROL:
        return WEIGHTS[:1]
    return WEIGHTS + (OWN_WEIGHTS if kernel.startswith("learned") else ())


def run(*arguments):
    return subprocess.run([FLUXION, *map(str, arguments)], check=True, capture_output=True, text=True).stdout


def reference(args, name, folder):
    """File and size of a reference, rendered if the depth is not the scene's."""
    path = os.path.join(args.references, name + ".exr")
    width, height = np.stack([exr.everything(path)[c] for c in "RGB"], -1).shape[1::-1]
    if args.depth:
        path = os.path.join(args.keep or folder, "%s-%d-%d.exr" % (name, args.depth, args.reference))
        if not os.path.exists(path):
            run("render", scene(args, name), "-o", path, "-q", "--size", "%dx%d" % (width, height), "--spp", args.reference, "--seed", 977,
                "--method", "primal", "--max-depth", args.depth)
    return path, "%dx%d" % (width, height)


def scene(args, name):
    return os.path.join(args.scenes, name, "scene.xml")


def errors(args, folder, name, path, size, kernel, spp, seed):
    """Metrics by weights, and the seconds of rendering."""
    layers, image, stats = (os.path.join(folder, file) for file in ("l.exr", "i.exr", "s.json"))
    depth = ["--max-depth", args.depth] if args.depth else []
    run("render", scene(args, name), "-o", image, "-q", "--size", size, "--spp", spp, "--seed", seed, "--layers", layers,
        "--method", args.method, "--kernel", kernel, "--shift", args.shift, "--json", stats, *depth)
    found = {}
    for weights in weights_of(kernel, args.method):
        method = "control_variate:weights=" + weights if args.method == CONTROL else args.method
        run("reconstruct", layers, "-o", image, "-q", "--method", method)
        found[weights] = json.loads(run("compare", image, path, "--json", "-"))
    with open(stats) as file:
        return found, json.load(file)["seconds"]["render"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes")
    parser.add_argument("references")
    parser.add_argument("--depth", type=int)
    parser.add_argument("--reference", type=int, default=8192)
    parser.add_argument("--keep", help="folder for references that are rendered, to be found again")
    parser.add_argument("--spp", default="16,64")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--kernels", default="cross,structure")
    parser.add_argument("--shift", default="reconnect")
    parser.add_argument("--method", default=CONTROL, help="another method on edges")
    args = parser.parse_args()
    # Parameters of a kernel are given with + in place of a comma.
    kernels = [kernel.replace("+", ",") for kernel in args.kernels.split(",")]
    print("| spp | weights | kernel | SMAPE | FLIP | 1 - MS-SSIM | relMSE | SMAPE / first | worst | relMSE / first | worst | time / first |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        references = {name: reference(args, name, folder) for name in NAMES}
        for spp in args.spp.split(","):
            of = {(weights, kernel): [] for kernel in kernels for weights in weights_of(kernel, args.method)}
            for name in NAMES:
                runs = {key: [] for key in of}
                for seed in range(1, args.seeds + 1):
                    for kernel in kernels:
                        found, seconds = errors(args, folder, name, *references[name], kernel, spp, seed)
                        for weights in found:
                            metrics = found[weights]
                            values = metrics["smape"], metrics["flip"], 1 - metrics.get("ms_ssim", 0), metrics["relmse"], seconds
                            runs[weights, kernel].append(values)
                for key, values in runs.items():
                    of[key].append([statistics.mean(column) for column in zip(*values)])
            for (weights, kernel), rows in of.items():
                mean = [math.exp(statistics.mean(math.log(row[k]) for row in rows)) for k in range(5)]
                first = of[weights if weights in WEIGHTS else WEIGHTS[-1], kernels[0]]
                ratios = [[a[k] / b[k] for a, b in zip(rows, first)] for k in range(5)]
                product = [math.exp(statistics.mean(map(math.log, column))) for column in ratios]
                print("| %s | %s | %s | %.3f | %.3f | %.4f | %.4f | %.2f | %.2f | %.2f | %.2f | %.2f |" % (
                    spp, weights, kernel, *mean[:4], product[0], max(ratios[0]), product[3], max(ratios[3]), product[4]), flush=True)


if __name__ == "__main__":
    main()
