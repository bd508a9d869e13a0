"""Errors of learned methods beside what they are made of on scenes that they were not trained on.

    python tools/train/gates.py SCENES REFERENCES NAME... [--spp 4,16,64] [--seeds 3]

SCENES is a folder with NAME/scene.xml; REFERENCES one with NAME.exr (mean) and NAME_var.exr (variance of the mean). Prints
relMSE, the references' noise taken off, means of the seeds, as ratios to frgr; fails if one is above 1.1 of the best
of those on a scene. Needs PyPI numpy, openimageio and, active, pyoidn.
"""
import argparse
import os
import subprocess
import sys
import tempfile

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import exr

# What each learned method must not lose to.
LEARNED = {"net": ["frgr"], "blend:oidn=on": ["frgr", "net", "oidn", "frgr:denoiser=oidn"]}
METHODS = ["frgr", "oidn", "frgr:denoiser=oidn", "net", "blend:oidn=on"]


def errors(options, name, spp):
    """Mean relMSE of the seeds by method."""
    scene = os.path.join(options.scenes, name, "scene.xml")
    reference, variance = (exr.rgb(os.path.join(options.references, name + end)) for end in (".exr", "_var.exr"))
    height, width, _ = reference.shape
    found = {method: [] for method in METHODS}
    with tempfile.TemporaryDirectory() as folder:
        layers, image = (os.path.join(folder, file) for file in ("layers.exr", "image.exr"))
        for seed in range(1, options.seeds + 1):
            subprocess.run([options.fluxion, "render", scene, "-o", image, "--layers", layers, "--spp", str(spp), "--size",
                            f"{width}x{height}", "--seed", str(seed), "--method", "l2", "-q"], check=True,
                           stderr=subprocess.DEVNULL)
            for method in METHODS:
                subprocess.run([options.fluxion, "reconstruct", layers, "-o", image, "--method", method, "-q"], check=True)
                square = (exr.rgb(image) - reference) ** 2 - variance
                found[method].append(float((square / (reference ** 2 + 0.01)).mean()))
    return {method: float(np.mean(values)) for method, values in found.items()}


def main(options):
    failed = []
    for spp in map(int, options.spp.split(",")):
        print(f"\n| {spp} spp | frgr | " + " | ".join(METHODS[1:]) + " |\n" + "|---" * (len(METHODS) + 1) + "|", flush=True)
        ratios = []
        for name in options.names:
            found = errors(options, name, spp)
            ratios.append([found[method] / found["frgr"] for method in METHODS])
            print(f"| {name} | {found['frgr']:.2e} | " + " | ".join("%.2f" % r for r in ratios[-1][1:]) + " |", flush=True)
            for learned, others in LEARNED.items():
                if found[learned] > 1.1 * min(found[other] for other in others):
                    failed.append(f"{learned} on {name} at {spp} spp")
        means = np.exp(np.log(np.array(ratios)).mean(0))
        print("| geometric mean | 1 | " + " | ".join("%.2f" % mean for mean in means[1:]) + " |", flush=True)
    if failed:
        sys.exit("above one of these: " + ", ".join(failed))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes")
    parser.add_argument("references")
    parser.add_argument("names", nargs="+")
    parser.add_argument("--spp", default="4,16,64")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--fluxion", default="target/release/fluxion")
    main(parser.parse_args())
