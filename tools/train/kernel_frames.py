"""Frames with differences to all neighbours, to train adaptive kernels on.

    python tools/train/kernel_frames.py SCENES FOLDER --fluxion target/release/fluxion

renders every scene of the folder SCENES thrice, with seeds of their own: a pilot, whose samples are kept one by one; colours with the
differences to all 24 pixels of a window of 5x5; and a target. Sample counts, shifts, depths and the size of the film, of whose middle
96x96 pixels are rendered, change from scene to scene. FOLDER then holds NAME.npz for each, half floats in units of the pilot's scale;
what is there is kept. Needs numpy and PyPI openimageio.
"""
import argparse
import glob
import os
import subprocess
import sys
import tempfile

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import exr
from frames import DARK
from steps import HALF_PLANE

SIZE, PILOT = 96, 8
# Samples of targets: those of direct light, which has the least noise to tell from theirs, are more.
TARGET, DIRECT_TARGET = 64, 192
# Sides of films: textures and outlines are as coarse and as fine as in images of any size.
FILMS = (96, 192, 384)
COUNTS = (4, 8, 16, 32)
# Replay traces every neighbour's path anew: samples beyond this many take too long.
REPLAYED = 16
LIMIT = 6e4


def window(number):
    """Options for the pixels of a scene that are rendered."""
    film = FILMS[number % len(FILMS)]
    corner = (film - SIZE) // 2
    return ["--size", f"{film}x{film}", "--crop", f"{corner},{corner},{SIZE}x{SIZE}"]


def render(program, scene, *arguments):
    subprocess.run([program, "render", scene, "-q", *map(str, arguments)], check=True, capture_output=True)


def recipe(number):
    """Sample count and shift of a scene, and whether it is of direct light alone."""
    spp = COUNTS[number % len(COUNTS)]
    shift = "replay" if number // 4 % 2 and spp <= REPLAYED else "reconnect"
    return spp, shift, number // 8 % 4 == 0


def samples(folder):
    """The pilot's samples, (samples, rows, columns, 17), and the factor of radiance: that of the first sample has a mean of one."""
    get = lambda name: np.load(os.path.join(folder, name + ".npy"))
    colour, depth = get("color"), get("depth")
    scale = 1 / max(float(colour[0].mean(dtype=np.float64)), DARK)
    middle = max(float(np.median(depth[0])), 1e-9)
    parts = [np.log1p(np.maximum(colour * scale, 0)), get("albedo"), get("normal"), depth / (depth + middle), get("roughness"),
             get("scattering")]
    return np.concatenate(parts, -1), scale


def frame(program, scene, number):
    """Arrays of a scene's frame."""
    spp, shift, direct = recipe(number)
    common = [*window(number), *(["--max-depth", 2] if direct else [])]
    with tempfile.TemporaryDirectory() as folder:
        layers, target = os.path.join(folder, "l.exr"), os.path.join(folder, "t.exr")
        pilot = os.path.join(folder, "samples")
        render(program, scene, "--spp", PILOT, "--seed", 3 * number, "--method", "primal", "--samples", pilot, "-o", target, *common)
        render(program, scene, "--spp", spp, "--seed", 3 * number + 1, "--method", "l2", "--kernel", "nearest:k=24", "--shift", shift,
               "--layers", layers, "-o", target, *common)
        render(program, scene, "--spp", DIRECT_TARGET if direct else TARGET, "--seed", 3 * number + 2, "--method", "frgr", "-o", target, *common)
        found, (encoded, scale) = exr.everything(layers), samples(pilot)
        rgb = lambda name: np.stack([found[name + c] for c in "RGB"]) * scale
        # The pilot's colours count, as in a render.
        before = np.moveaxis(np.load(os.path.join(pilot, "color.npy")).mean(0, dtype=np.float64), -1, 0) * scale
        direct = np.moveaxis(np.load(os.path.join(pilot, "direct.npy")).mean(0, dtype=np.float64), -1, 0) * scale
        colour = (PILOT * before + spp * rgb("")) / (PILOT + spp)
        edges = np.stack([rgb("edge_%d_%d." % step) for step in HALF_PLANE])
        clean = np.moveaxis(exr.rgb(target), -1, 0) * scale - (rgb("direct.") * spp + direct * PILOT) / (PILOT + spp)
    half = lambda array: np.clip(array, -LIMIT, LIMIT).astype(np.float16)
    return {"pilot": half(encoded), "colour": half(colour), "edges": half(edges), "target": half(clean), "spp": spp}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes")
    parser.add_argument("folder")
    parser.add_argument("--fluxion", default="target/release/fluxion")
    args = parser.parse_args()
    os.makedirs(args.folder, exist_ok=True)
    for scene in sorted(glob.glob(os.path.join(args.scenes, "*", "scene.xml"))):
        name = os.path.basename(os.path.dirname(scene))
        path = os.path.join(args.folder, name + ".npz")
        if not os.path.exists(path):
            np.savez(path + ".part.npz", **frame(args.fluxion, scene, int(name)))
            os.replace(path + ".part.npz", path)
            print(name, flush=True)


if __name__ == "__main__":
    main()
