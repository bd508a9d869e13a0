"""Runs figures that are stale, cell by cell; an interrupted run goes on with the cells that are missing."""
import importlib
import json
import os
import time
from dataclasses import dataclass

import figure
import scenes


@dataclass(frozen=True)
class Context:
    """Where things are."""

    scenes: list
    """Scenes of figures/scenes.toml, as far as they are there."""
    public: str
    """Folder of public scenes; empty if there is none."""
    references: str
    """Folder of references, as `references` makes it."""
    mitsuba: str
    """Folder of means and variances that Mitsuba has rendered, NAME.exr and NAME_var.exr."""
    work: str
    """Folder of unfinished figures."""

    def scene(self, name):
        return next(scene for scene in self.scenes if scene.name == name)

    def reference(self, name):
        """A reference's file and its floor."""
        with open(os.path.join(self.references, name + ".json")) as file:
            return os.path.join(self.references, name + ".exr"), json.load(file)["floor"]


def context(public, work):
    here = lambda name: os.path.join(os.path.abspath(work), name)
    public = os.path.abspath(public) if public else ""
    return Context(scenes.load(public)[0], public, here("references"), here("mitsuba"), here("runs"))


def run(one, where):
    """Measures a figure and stores it."""
    measure = importlib.import_module("measures." + one["measure"].replace("-", "_"))
    cells = measure.cells(one["run"], where)
    name = "%s-%s" % (one.name, figure.digest_of_text(json.dumps(one.inputs(), sort_keys=True)))
    folder = os.path.join(where.work, name)
    os.makedirs(folder, exist_ok=True)
    path = os.path.join(folder, "cells.jsonl")
    done = {}
    if os.path.exists(path):
        with open(path) as file:
            for line in file:
                entry = json.loads(line)
                done[json.dumps(entry["cell"])] = entry
    for number, cell in enumerate(cells):
        key = json.dumps(cell)
        if key in done:
            continue
        print("%s: %d of %d, %s" % (one.name, number + 1, len(cells), " ".join(map(str, cell))), flush=True)
        start = time.monotonic()
        runs = measure.measure(cell, one["run"], where, folder)
        done[key] = {"cell": cell, "seconds": round(time.monotonic() - start, 2), "runs": runs}
        with open(path, "a") as file:
            file.write(json.dumps(done[key]) + "\n")
    entries = [done[json.dumps(cell)] for cell in cells]
    one.save([entry for all_of in entries for entry in all_of["runs"]], sum(entry["seconds"] for entry in entries))
