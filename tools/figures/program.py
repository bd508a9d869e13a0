"""Calls of the program, and errors of its images."""
import json
import os
import subprocess
import sys
import tempfile

import scenes

# The noise of a reference is taken off relMSE; this share of it, which is how well it is known, stays (as in `fluxion bench`).
KNOWN = 0.05


def environment():
    """The environment of the program: Open Image Denoise is found in the virtual environment that Python runs in."""
    return {**os.environ, "VIRTUAL_ENV": sys.prefix}


def call(*arguments):
    """Runs a command, and returns what it prints on standard output."""
    done = subprocess.run([scenes.FLUXION, *map(str, arguments)], check=False, capture_output=True, text=True, env=environment())
    if done.returncode != 0:
        sys.exit("fluxion %s\n%s" % (" ".join(map(str, arguments)), done.stderr))
    return done.stdout


def with_statistics(*arguments):
    """Runs a command that writes figures with `--json`, and returns these."""
    with tempfile.TemporaryDirectory() as folder:
        stats = os.path.join(folder, "stats.json")
        call(*arguments, "--json", stats, "-q")
        with open(stats) as file:
            return json.load(file)


def floored(relmse, floor):
    """relMSE without the reference's own noise."""
    return max(relmse - floor, KNOWN * floor)


def errors(image, reference, floor):
    """The four measures of an image. All of them are zero for the reference."""
    measured = json.loads(call("compare", image, reference, "--json", "-"))
    return four(measured, floor)


def four(measured, floor):
    return {
        "relmse": floored(measured["relmse"], floor),
        "smape": measured["smape"],
        "flip": measured["flip"],
        "dissimilarity": 1 - measured["ms_ssim"],
        "floor": floor,
    }
