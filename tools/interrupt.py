#!/usr/bin/env python3
"""Kills renders at random moments, resumes them, and compares every bit with renders that nobody disturbed.

    tools/interrupt.py [--cycles 200] [--seed 1] [SCENE ...]

A cycle is a render that is killed (SIGKILL) after a random time and later resumed, until it ends; every scene is rendered
evenly and adaptively in turn. Needs only the built program. Exits with 1 at the first difference.
"""

import argparse
import json
import os
import pathlib
import random
import struct
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = ROOT / "target/release/fluxion"
SCENES = [ROOT / "scenes" / name / "scene.xml" for name in ("cornell-box", "glossy-metal", "door-ajar")]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cycles", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("scenes", nargs="*", type=pathlib.Path, default=SCENES)
    args = parser.parse_args()
    chance = random.Random(args.seed)
    cycles = interrupted = images = rounds = 0
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        straight = {}
        while cycles < args.cycles:
            scene = args.scenes[rounds % len(args.scenes)].resolve()
            adaptive = ["--adaptive"] if rounds // len(args.scenes) % 2 else []
            rounds += 1
            command = [PROGRAM, "render", scene, "--size", "192x144", "--spp", "48", "-q", *adaptive]
            whole = f"{rounds % len(args.scenes)}{len(adaptive)}"
            if whole not in straight:
                start = time.monotonic()
                subprocess.run([*command, "-o", f"{whole}.exr"], check=True)
                straight[whole] = time.monotonic() - start
                kept = ["--checkpoint", "whole.ckpt", "-o", "unused.exr"]
                subprocess.run([*command, *kept], check=True)
                pathlib.Path("whole.ckpt").rename(f"{whole}.ckpt")
            pathlib.Path("a.ckpt").unlink(missing_ok=True)
            resume = ["--checkpoint", "a.ckpt", "--checkpoint-every", "0.05s", "--resume", "-o", "a.exr"]
            ended = False
            while not ended:
                process = subprocess.Popen([*command, *resume])
                try:
                    # Some are killed while they load, some while they render, write, or have all but ended.
                    ended = process.wait(chance.uniform(0.02, 0.6 * straight[whole])) == 0
                    if not ended:
                        sys.exit(f"{scene}: exit code {process.returncode}")
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
                    interrupted += 1
                cycles += 1
            if statistics("a.ckpt") != statistics(f"{whole}.ckpt"):
                sys.exit(f"{scene}: the resumed film differs")
            if difference("a.exr", f"{whole}.exr") != 0:
                sys.exit(f"{scene}: the resumed image differs")
            images += 1
            print(f"{cycles} cycles, {interrupted} kills, {images} images, all equal", flush=True)


def statistics(checkpoint):
    """All that a checkpoint holds after its header, where times stand, and before its checksum."""
    content = pathlib.Path(checkpoint).read_bytes()
    return content[16 + struct.unpack_from("<I", content, 12)[0] : -4]


def difference(image, reference):
    """Mean squared error: zero for equal images only."""
    report = subprocess.run([PROGRAM, "compare", image, reference, "--json", "-"], check=True, capture_output=True)
    return json.loads(report.stdout)["mse"]


if __name__ == "__main__":
    main()
