"""Radiance of training scenes beside Mitsuba 3.

    python tools/train/check.py SCENE... [--spp 256]

Prints for every scene the ratio of both images' means, its standard error, the share of 8x8 blocks that differ by more than
four of theirs, and the share of pixels that are compared: Mitsuba's may be no numbers. Run from the repository's top folder
after `cargo build --release`. Needs PyPI mitsuba, openimageio and numpy, and LLVM.
"""
import argparse
import os
import sys
import tempfile

import numpy as np

TOOLS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
sys.path[:0] = [TOOLS, os.path.join(TOOLS, "figures")]
import exr
import peers
import program

VARIANT = "llvm_ad_rgb"

SIZE, BLOCK, RUNS = 64, 8, 4


def blocks(image, known):
    """Means of the known pixels of every block; not a number where there is none."""
    n = SIZE // BLOCK
    of_blocks = lambda values: values.reshape(n, BLOCK, n, BLOCK).sum((1, 3))
    with np.errstate(invalid="ignore"):
        return of_blocks(np.where(known, image.mean(-1), 0)) / of_blocks(known.astype(float))


def runs(render, spp):
    """Several independent images."""
    return [render(seed, spp // RUNS) for seed in range(RUNS)]


def means(images, known):
    """Means of blocks, and their variances."""
    made = np.array([blocks(image, known) for image in images])
    return made.mean(0), made.var(0, ddof=1) / RUNS


def by_mitsuba(path):
    scene = peers.load(VARIANT, path, (SIZE, SIZE))
    return lambda seed, spp: peers.render(VARIANT, scene, spp, seed)


def by_fluxion(path):
    def render(seed, spp):
        with tempfile.TemporaryDirectory() as folder:
            image = os.path.join(folder, "image.exr")
            program.call("render", path, "-o", image, "--size", f"{SIZE}x{SIZE}", "--spp", spp, "--seed", seed, "--method", "primal", "-q")
            return exr.rgb(image)

    return render


def main(options):
    print("| scene | ratio of means | standard error | blocks beyond 4 | pixels |\n|---|---|---|---|---|")
    for path in options.scenes:
        ours, theirs = runs(by_fluxion(path), options.spp), runs(by_mitsuba(path), options.spp)
        # Mitsuba's images have pixels that are not numbers in some scenes.
        known = np.isfinite(theirs).all((0, -1))
        (a, va), (b, vb) = means(ours, known), means(theirs, known)
        seen = np.isfinite(a)
        (a, va), (b, vb) = (a[seen], va[seen]), (b[seen], vb[seen])
        # Variances of few runs are rough: each block's is at least the mean one.
        deviation = np.sqrt(np.maximum(va + vb, (va + vb).mean()) + 1e-12)
        name = os.path.basename(os.path.dirname(path))
        error = np.sqrt((va + vb).sum()) / b.sum()
        row = (name, a.sum() / b.sum(), error, (np.abs(a - b) > 4 * deviation).mean(), known.mean())
        print("| %s | %.4f | %.4f | %.3f | %.2f |" % row, flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--spp", type=int, default=256)
    main(parser.parse_args())
