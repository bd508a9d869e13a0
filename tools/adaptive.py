#!/usr/bin/env python3
"""Prints the tables of docs/adaptive.md, and draws its plot.

    tools/adaptive.py SCENES REFERENCES calibration PLOT.png
    tools/adaptive.py SCENES REFERENCES gain SPP METHOD...
    tools/adaptive.py SCENES REFERENCES stop METHOD...

SCENES holds folders of public scenes (kitchen, veach-ajar, veach-mis), REFERENCES their images, named after them, as
`fluxion bench` takes them; bundled scenes bring their own. Needs the Python packages numpy and OpenImageIO, and
`cargo build --release`.
"""
import argparse
import json
import os
import subprocess
import tempfile

import numpy as np

import exr

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
FLUXION = os.environ.get("FLUXION", os.path.join(ROOT, "target", "release", "fluxion"))
BUNDLED = ["cornell-box", "door-ajar", "glossy-metal", "glass-caustic"]
PUBLIC = ["kitchen", "veach-ajar", "veach-mis", "staircase", "living-room", "classroom"]
EPSILON = 0.01


class Case:
    def __init__(self, name, scenes, references):
        bundled = name in BUNDLED
        folder = os.path.join(ROOT, "scenes") if bundled else scenes
        self.name = name
        self.scene = os.path.join(folder, name, "scene.xml")
        path = os.path.join(folder, name, "reference.exr") if bundled else os.path.join(references, name + ".exr")
        self.truth = exr.rgb(path)

    def render(self, *arguments):
        """The image, its estimated squared error, and the statistics of the run."""
        height, width, _ = self.truth.shape
        with tempfile.TemporaryDirectory() as folder:
            image, stats = f"{folder}/a.exr", f"{folder}/a.json"
            subprocess.run([FLUXION, "render", "-q", self.scene, "-o", image, "--size", f"{width}x{height}",
                            "--seed", "11", "--json", stats, *map(str, arguments)], check=True)
            error = [f"error.{c}" for c in "RGB"]
            error = exr.channels(image, error).astype(np.float64) if error[0] in exr.names(image) else None
            return exr.rgb(image), error, json.load(open(stats))

    def errors(self, image):
        return ((image - self.truth) ** 2 / (self.truth ** 2 + EPSILON)).mean(2)


def ranks(values):
    return np.argsort(np.argsort(values))


def blocks(values, side=8):
    height, width = (length // side * side for length in values.shape)
    return values[:height, :width].reshape(height // side, side, width // side, side).mean((1, 3)).ravel()


def calibration(cases, plot):
    """Estimated over true relMSE, and the rank correlation of both over squares of 8x8 pixels."""
    panels = []
    print("| 64 spp | " + " | ".join(case.name for case in cases) + " |")
    print("|---" * (len(cases) + 1) + "|")
    for method in ["apr", "frgr", "nfor", "rdfc"]:
        row = []
        for case in cases:
            image, error, _ = case.render("--spp", 64, "--method", method)
            estimated = (error / (np.maximum(image, 0) ** 2 + EPSILON)).mean(2)
            true = case.errors(image)
            correlation = np.corrcoef(ranks(blocks(estimated)), ranks(blocks(true)))[0, 1]
            row.append(f"{estimated.mean() / true.mean():.2f}, {correlation:.2f}")
            if method == "apr":
                panels.append(panel(blocks(estimated), blocks(true)))
        print(f"| {method} | " + " | ".join(row) + " |", flush=True)
    exr.write(plot, np.concatenate(panels, axis=1), exr.EIGHT_BIT)


def panel(estimated, true, side=240, low=-7.0, high=0.0):
    """A dot for each square, estimated error to the right and true error upwards, seven decades; grey: both alike."""
    picture = np.ones((side, side, 3))
    place = lambda values: np.clip((np.log10(np.maximum(values, 1e-12)) - low) / (high - low), 0, 0.995) * side
    for k in range(side):
        picture[side - 1 - k, k] = 0.6
    for x, y in zip(place(estimated).astype(int), place(true).astype(int)):
        picture[side - 1 - y, x] = [0.1, 0.3, 0.7]
    for decade in range(1, int(high - low)):
        at = int(decade / (high - low) * side)
        picture[side - 4:, at] = picture[side - 1 - at, :4] = 0
    picture[[0, -1]] = picture[:, [0, -1]] = 0
    return picture


def gain(cases, spp, methods):
    """relMSE with adaptive over that with uniform samples, at the same number of samples."""
    print(f"| {spp} spp | " + " | ".join(case.name for case in cases) + " | geometric mean |")
    print("|---" * (len(cases) + 2) + "|")
    for method in methods:
        uniform = [case.errors(case.render("--spp", spp, "--method", method)[0]).mean() for case in cases]
        for allocator in ["predicted_error", "variance"]:
            try:
                adaptive = [case.errors(case.render("--spp", spp, "--method", method, "--adaptive", allocator)[0]).mean()
                            for case in cases]
            except subprocess.CalledProcessError:
                # The method does not estimate its error.
                continue
            ratios = np.array(adaptive) / uniform
            mean = np.exp(np.log(ratios).mean())
            print(f"| {method}, {allocator} | " + " | ".join(f"{r:.2f}" for r in ratios) + f" | {mean:.2f} |", flush=True)


def stop(cases, methods):
    """True relMSE over the target, and samples per pixel, at the stop; one minute at most."""
    print("| method, target | " + " | ".join(case.name for case in cases) + " |")
    print("|---" * (len(cases) + 1) + "|")
    for method in methods:
        for target in [0.01, 0.002]:
            row = []
            for case in cases:
                image, _, stats = case.render("--method", method, "--target-error", target, "--time", 60)
                reached = stats["passes"][-1]["error"]
                late = " (time)" if reached is None or reached > target else ""
                row.append(f"{case.errors(image).mean() / target:.2f} at {stats['spp']}{late}")
            print(f"| {method}, {target} | " + " | ".join(row) + " |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", help="folder of public scenes")
    parser.add_argument("references", help="folder of their references")
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("calibration").add_argument("plot", help="image file to write")
    command = commands.add_parser("gain")
    command.add_argument("spp", type=int)
    command.add_argument("methods", nargs="+")
    commands.add_parser("stop").add_argument("methods", nargs="+")
    args = parser.parse_args()
    cases = [Case(name, args.scenes, args.references) for name in BUNDLED + PUBLIC]
    if args.command == "calibration":
        calibration([case for case in cases if case.name in ("door-ajar", "glossy-metal", "kitchen", "veach-ajar")], args.plot)
    elif args.command == "gain":
        gain(cases, args.spp, args.methods)
    else:
        stop(cases[:5], args.methods)


if __name__ == "__main__":
    main()
