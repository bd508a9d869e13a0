"""Rays of a render by purpose and depth, lanes of their packets, and what they cost: `cargo bench --bench counts`."""
import json
import os
import subprocess

import program
from scenes import ROOT

REFERENCES = False

PURPOSES = ["camera", "path", "light", "offset_camera", "connection", "extension"]


def cells(run, where):
    """Scenes and kinds of processors."""
    return [[scene.name, isa] for isa in run["processors"] for scene in where.scenes]


def measure(cell, run, where, folder):
    name, isa = cell
    scene = where.scene(name)
    width, height = (length // 2 for length in scene.width_and_height)
    restricted = {"FLUXION_EMBREE": "isa=" + isa, "FLUXION_LANES": isa} if isa != "widest" else {}
    command = ["cargo", "bench", "--quiet", "--bench", "counts", "--", "%s@%dx%d" % (os.path.abspath(scene.path), width, height)]
    done = subprocess.run(command, cwd=ROOT, env={**program.environment(), **restricted}, capture_output=True, text=True)
    if done.returncode:
        raise program.Failed("%s\n%s" % (" ".join(command), done.stderr))
    modes = {line["mode"]: line for line in map(json.loads, done.stdout.splitlines())}
    paths, all_of = modes["paths"], modes["differences"]
    entry = {"scene": name, "processor": isa, "row": name if isa == "widest" else "%s, %s" % (name, isa)}
    entry.update({mode: line["nanoseconds"] for mode, line in modes.items()})
    for mode, line in (("paths", paths), ("differences", all_of)):
        entry["embree_" + mode] = sum(line["embree"].values())
    for purpose in PURPOSES:
        rays, packets = total(all_of, purpose)
        entry.update({"rays_" + purpose: rays, "lanes_" + purpose: rays / packets if packets else 0.0, "embree_" + purpose: all_of["embree"][purpose]})
    entry["lanes_path_by_depth"] = [lanes(all_of, "path", depth) for depth in range(1, 5)]
    entry["lanes_light_by_depth"] = [lanes(all_of, "light", depth) for depth in range(4)]
    return [entry]


def total(line, purpose, depth=None):
    """Rays and packets of a sample."""
    tallies = [tally for tally in line["rays"] if tally["purpose"] == purpose and depth in (None, tally["depth"])]
    return sum(tally["rays"] for tally in tallies), sum(tally["packets"] for tally in tallies)


def lanes(line, purpose, depth):
    """Active lanes of a packet in the mean."""
    rays, packets = total(line, purpose, depth)
    return rays / packets if packets else 0.0
