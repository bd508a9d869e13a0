"""Runs figures, cell by cell; an interrupted run goes on with the cells that are missing."""
import hashlib
import importlib
import json
import os
import shutil
import sys
import time
from dataclasses import dataclass

import figure
import scenes
import sources


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
    return Context(scenes.load(public), public, here("references"), here("mitsuba"), here("runs"))


def run(one, where):
    """Measures a figure and stores it."""
    measure = importlib.import_module("measures." + one["measure"])
    require(one.name, "scene", [name for name in one.sizes() if name not in {scene.name for scene in where.scenes}])
    if measure.REFERENCES:
        require(one.name, "reference", [name for name in one.sizes() if not os.path.exists(os.path.join(where.references, name + ".json"))])
    head, runs, seconds = measured(one.name, measure, one["run"], where, one.sizes() if measure.REFERENCES else [], one.head())
    one.save(head, runs, seconds)
    forget(one.name, where)


def require(name, what, missing):
    if missing:
        sys.exit("figure %s needs the %s of %s: give the folder of public scenes as SCENES to `make references` and `make figures`"
                 % (name, what, ", ".join(missing)))


def measured(name, measure, run, where, judged, head):
    """All runs of a measure, with the head that was written down when they were begun and the seconds that they took. Cells that were
    measured before an interruption, by the same program on the same machine and with the same references of the scenes that are `judged`
    by them, are not measured again."""
    decides = [head.get("machine"), head.get("inputs"), run, {scene: where.reference(scene)[1] for scene in judged}, program_digest()]
    folder = os.path.join(where.work, "%s-%s" % (name, sources.of_text(json.dumps(decides, sort_keys=True))))
    os.makedirs(folder, exist_ok=True)
    head = first_head(os.path.join(folder, "head.json"), head)
    path = os.path.join(folder, "cells.jsonl")
    done = {json.dumps(entry["cell"]): entry for entry in entries(path)}
    cells = measure.cells(run, where)
    for number, cell in enumerate(cells):
        key = json.dumps(cell)
        if key in done:
            continue
        print("%s: %d of %d, %s" % (name, number + 1, len(cells), " ".join(map(str, cell))), flush=True)
        start = time.monotonic()
        runs = measure.measure(cell, run, where, folder)
        done[key] = {"cell": cell, "seconds": round(time.monotonic() - start, 2), "runs": runs}
        with open(path, "a") as file:
            file.write(json.dumps(done[key]) + "\n")
    wanted = [done[json.dumps(cell)] for cell in cells]
    return head, [one for entry in wanted for one in entry["runs"]], sum(entry["seconds"] for entry in wanted)


def forget(name, where):
    """Removes what was kept of interrupted measurements."""
    for folder in os.listdir(where.work):
        if folder.rpartition("-")[0] == name:
            shutil.rmtree(os.path.join(where.work, folder))


def first_head(path, head):
    """The head that is stored, or else this one, stored."""
    if not os.path.exists(path):
        with open(path + ".part", "w") as file:
            json.dump(head, file)
        os.replace(path + ".part", path)
    with open(path) as file:
        return json.load(file)


def entries(path):
    """Cells that are done. The last line may be torn where a machine went down."""
    found = []
    if os.path.exists(path):
        with open(path) as file:
            for line in file:
                try:
                    found.append(json.loads(line))
                except json.JSONDecodeError:
                    break
    return found


def program_digest():
    with open(scenes.FLUXION, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()
