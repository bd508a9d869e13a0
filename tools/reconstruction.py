#!/usr/bin/env python3
"""Prints the tables of docs/frgr.md: errors of reconstructions against references, over samples and switches.

    tools/reconstruction.py WORK SHARED methods|time|ablation|floors

SHARED holds folders of public scenes (kitchen, living-room, staircase, veach-mis, veach-ajar). WORK keeps what was
rendered, so that a second run only reconstructs: WORK/in/SCENE-SPP.exr are layers, WORK/ref/SCENE-SEED.exr the two
halves of a reference. Needs the Python packages numpy and OpenImageIO, and `cargo build --release`.
"""
import argparse
import json
import math
import os
import subprocess

import numpy as np

import exr

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
FLUXION = os.path.join(ROOT, "target", "release", "fluxion")
# Scene: size, samples of each half of the reference, how the halves are made.
SCENES = {
    "cornell-box": ("128x128", 4096, "l2"),
    "door-ajar": ("160x90", 4096, "l2"),
    "glossy-metal": ("160x90", 4096, "l2"),
    "glass-caustic": ("128x96", 4096, "l2"),
    "kitchen": ("320x180", 2048, "l2"),
    "living-room": ("320x180", 2048, "l2"),
    "staircase": ("180x320", 1536, "l2"),
    "veach-mis": ("320x180", 4096, "primal"),
    "veach-ajar": ("320x180", 2048, "l2"),
}
BUNDLED = list(SCENES)[:4]
METRICS = ["relmse", "smape", "flip"]


def run(*arguments):
    return subprocess.run([FLUXION, *arguments], check=True, capture_output=True, text=True).stdout


def scene(name, shared):
    folder = os.path.join(ROOT, "scenes") if name in BUNDLED else shared
    return os.path.join(folder, name, "scene.xml")


def layers(work, shared, name, spp):
    path = f"{work}/in/{name}-{spp}.exr"
    if not os.path.exists(path):
        size = SCENES[name][0]
        stats = f"{work}/in/{name}-{spp}.json"
        run("render", "-q", scene(name, shared), "--size", size, "--spp", str(spp), "--seed", str(100 + spp),
            "--method", "l2", "--layers", path, "-o", f"{work}/out.exr", "--json", stats)
    return path


def reference(work, shared, name):
    """The mean of two halves, as a file, and its noise: the relative squared error it has itself."""
    size, spp, method = SCENES[name]
    halves = []
    for seed in (1001, 1002):
        path = f"{work}/ref/{name}-{seed}.exr"
        if not os.path.exists(path):
            run("render", "-q", scene(name, shared), "--size", size, "--spp", str(spp), "--seed", str(seed),
                "--method", method, "-o", path)
        halves.append(exr.rgb(path))
    mean = (halves[0] + halves[1]) / 2
    path = f"{work}/ref/{name}.exr"
    exr.write(path, mean)
    return path, float(np.mean((halves[0] - halves[1]) ** 2 / 4 / (mean ** 2 + 0.01)))


def errors(work, layer_file, method, reference_file):
    out, stats = f"{work}/out.exr", f"{work}/out.json"
    run("reconstruct", "-q", layer_file, "-o", out, "--method", method, "--json", stats)
    figures = json.loads(run("compare", out, reference_file, "--json", "-"))
    figures["seconds"] = json.load(open(stats))["seconds"]["reconstruct"]
    return figures


def geometric(values):
    return math.exp(sum(map(math.log, values)) / len(values))


def methods(work, shared):
    names = ["primal", "l2", "frgr:form=paper", "frgr:form=code", "frgr"]
    for metric in METRICS:
        print(f"\n{metric}\n\n| scene | spp | {' | '.join(names)} |\n|---|---|{'---|' * len(names)}")
        table = {}
        for spp in (16, 64, 256):
            for name in SCENES:
                key = (name, spp)
                if metric == METRICS[0]:
                    path, _ = reference(work, shared, name)
                    CACHE[key] = [errors(work, layers(work, shared, name, spp), method, path) for method in names]
                table[key] = [figures[metric] for figures in CACHE[key]]
                print(f"| {name} | {spp} | {' | '.join(f'{value:.3g}' for value in table[key])} |")
        for spp in (16, 64, 256):
            rows = [table[name, spp] for name in SCENES]
            ratios = [geometric([row[k] / row[1] for row in rows]) for k in range(len(names))]
            print(f"| geometric mean over l2 | {spp} | {' | '.join(f'{value:.3f}' for value in ratios)} |")
            worst = [max(row[k] / row[0] for row in rows) for k in range(len(names))]
            print(f"| worst over primal | {spp} | {' | '.join(f'{value:.3f}' for value in worst)} |")


def time(work, shared):
    names = ["primal", "l2", "frgr"]
    print(f"| scene | spp | render s | {' | '.join(names)} | reconstruct s |\n|---|---|---|{'---|' * len(names)}---|")
    for name in BUNDLED:
        path, floor = reference(work, shared, name)
        rows = []
        for spp in (4, 8, 32, 128, 512, 1024, 2048):
            file = layers(work, shared, name, spp)
            seconds = json.load(open(f"{work}/in/{name}-{spp}.json"))["seconds"]["render"]
            found = [errors(work, file, method, path) for method in names]
            rows.append((seconds, [figures["relmse"] for figures in found], found[2]["seconds"]))
            values = " | ".join(f"{figures['relmse']:.3g}" for figures in found)
            print(f"| {name} | {spp} | {seconds:.2f} | {values} | {found[2]['seconds']:.3f} |", flush=True)
        # Slopes over the last factor of 16 in samples, after taking off the reference's own noise.
        early, late = rows[-4], rows[-1]
        for label, noise in (("slope, 128 to 2048 spp", 0.0), ("the same without the reference's noise", floor)):
            slopes = [math.log((late[1][k] - noise) / (early[1][k] - noise)) / math.log(2048 / 128) for k in range(3)]
            print(f"| {name}, {label} | | | {' | '.join(f'{slope:.2f}' for slope in slopes)} | |")


def ablation(work, shared):
    scenes = ["door-ajar", "glass-caustic", "kitchen", "staircase"]
    variants = ["frgr", "frgr:levels=1", "frgr:levels=3", "frgr:levels=4", "frgr:resample=bilinear",
                "frgr:albedo=off,normal=off", "frgr:denoised=off", "frgr:enhance=off", "frgr:solver=exact"]
    variants += [variant.replace("frgr", "frgr:form=paper").replace("paper:", "paper,") for variant in variants]
    print(f"| relMSE at 64 spp | {' | '.join(scenes)} |\n|---|{'---|' * len(scenes)}")
    for variant in variants:
        row = []
        for name in scenes:
            path, _ = reference(work, shared, name)
            row.append(errors(work, layers(work, shared, name, 64), variant, path)["relmse"])
        print(f"| {variant} | {' | '.join(f'{value:.3g}' for value in row)} |", flush=True)
    print("\nrelMSE of the gradients at 64 spp\n")
    print(f"| gradients | {' | '.join(scenes)} |\n|---|{'---|' * len(scenes)}")
    rows = {"sampled": [], "outliers removed": [], "paper": [], "code": [], "best": []}
    for name in scenes:
        exact = exr.rgb(reference(work, shared, name)[0])
        exact_layers = layers(work, shared, name, 64)
        direct = exr.channels(exact_layers, [f"direct.{c}" for c in "RGB"]).max(2) > 0
        # Away from lamps that are seen directly, whose light is not part of the differences.
        lit = direct[:, 1:] | direct[:, :-1]
        truth = exact[:, 1:] - exact[:, :-1]
        weight = 1 / (exact[:, 1:] ** 2 + 0.01)

        def score(gradient):
            return float(np.mean((((gradient - truth) ** 2) * weight)[~lit]))

        rows["sampled"].append(score(exr.channels(exact_layers, [f"dx.{c}" for c in "RGB"])[:, :-1]))
        for form in ("paper", "code", "best"):
            run("reconstruct", "-q", exact_layers, "-o", f"{work}/out.exr", "--method", f"frgr:form={form}",
                "--notes", f"{work}/notes")
            enhanced = exr.rgb(f"{work}/notes/level0_enhanced.exr")
            rows[form].append(score(enhanced[:, 1:] - enhanced[:, :-1]))
            if form == "best":
                rows["outliers removed"].append(score(exr.rgb(f"{work}/notes/dx.exr")[:, :-1]))
    for label, row in rows.items():
        print(f"| {label} | {' | '.join(f'{value:.3g}' for value in row)} |")


def floors(work, shared):
    print("| scene | size | noise of the reference (relMSE) |\n|---|---|---|")
    for name in SCENES:
        print(f"| {name} | {SCENES[name][0]} | {reference(work, shared, name)[1]:.2g} |")


CACHE = {}


def main():
    tables = {"methods": methods, "time": time, "ablation": ablation, "floors": floors}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("work", help="folder that keeps what was rendered")
    parser.add_argument("shared", help="folder of public scenes")
    parser.add_argument("table", choices=tables)
    args = parser.parse_args()
    for folder in ("in", "ref"):
        os.makedirs(os.path.join(args.work, folder), exist_ok=True)
    tables[args.table](args.work, args.shared)


if __name__ == "__main__":
    main()
