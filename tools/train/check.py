"""Radiance of training scenes beside Mitsuba 3.

    python tools/train/check.py SCENE... [--spp 256]

Prints for every scene the ratio of both images' means, its standard error, and the share of 8x8 blocks that differ by more than
four of theirs. Run from the repository's top folder after `cargo build --release`. Needs PyPI mitsuba, openimageio and numpy, and
DRJIT_LIBLLVM_PATH naming libLLVM.
"""
import argparse
import os
import sys

import mitsuba
import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import against_mitsuba

SIZE, BLOCK, RUNS = 64, 8, 4


def blocks(image):
    # Mitsuba's images have pixels that are not numbers in some scenes.
    n = SIZE // BLOCK
    return np.nanmean(image.reshape(n, BLOCK, n, BLOCK, 3), (1, 3, 4))


def runs(render, spp):
    """Means of blocks, and their variances, from several independent images."""
    made = np.array([blocks(render(seed, spp // RUNS)) for seed in range(RUNS)])
    return made.mean(0), made.var(0, ddof=1) / RUNS


def by_mitsuba(path):
    scene = against_mitsuba.mitsuba_scene(mitsuba, path, (SIZE, SIZE))
    return lambda seed, spp: np.array(mitsuba.render(scene, seed=seed, spp=spp))[..., :3]


def by_fluxion(path):
    return lambda seed, spp: against_mitsuba.fluxion(path, (SIZE, SIZE), spp, "primal", seed)[0]


def main(options):
    mitsuba.set_variant("llvm_ad_rgb")
    print("| scene | ratio of means | standard error | blocks beyond 4 |\n|---|---|---|---|")
    for path in options.scenes:
        (a, va), (b, vb) = runs(by_fluxion(path), options.spp), runs(by_mitsuba(path), options.spp)
        # Variances of few runs are rough: each block's is at least the mean one.
        deviation = np.sqrt(np.maximum(va + vb, (va + vb).mean()) + 1e-12)
        name = os.path.basename(os.path.dirname(path))
        error = np.sqrt((va + vb).sum()) / b.sum()
        print("| %s | %.4f | %.4f | %.3f |" % (name, a.sum() / b.sum(), error, (np.abs(a - b) > 4 * deviation).mean()), flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--spp", type=int, default=256)
    main(parser.parse_args())
