"""Calls of the program, and errors of its images."""
import json
import os
import subprocess
import sys
import tempfile

import scenes


class Failed(Exception):
    """A command that has failed, with what it said."""


def environment():
    """The environment of the program: Open Image Denoise is found in the virtual environment that Python runs in."""
    return {**os.environ, "VIRTUAL_ENV": sys.prefix}


def finished(*arguments):
    """Runs a command: its exit code, output and messages. Ctrl-C reaches it, too, and it is given the time to save what it has."""
    command = [scenes.FLUXION, *map(str, arguments)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment()) as process:
        try:
            output, messages = process.communicate()
        except KeyboardInterrupt:
            process.wait()
            raise
    return process.returncode, output, messages


def call(*arguments, codes=(0,)):
    """Runs a command that may end with these exit codes, and returns what it prints on standard output."""
    code, output, messages = finished(*arguments)
    if code not in codes:
        raise Failed("fluxion %s\n%s" % (" ".join(map(str, arguments)), messages))
    return output


def with_statistics(*arguments, codes=(0,)):
    """Runs a command that writes figures with `--json`, and returns these."""
    with tempfile.TemporaryDirectory() as folder:
        stats = os.path.join(folder, "stats.json")
        call(*arguments, "--json", stats, "-q", codes=codes)
        with open(stats) as file:
            return json.load(file)


def errors(image, reference, floor):
    """The four measures of an image, all of them zero for the reference. The floor, its own relMSE, is a part of relMSE."""
    return four(json.loads(call("compare", image, reference, "--json", "-")), floor)


def four(measured, floor):
    return {
        "relmse": measured["relmse"],
        "smape": measured["smape"],
        "flip": measured["flip"],
        "dissimilarity": 1 - measured["ms_ssim"],
        "floor": floor,
    }
