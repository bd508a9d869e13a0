"""Errors within budgets of time or samples, each run by itself: `fluxion bench`."""
import json
import os

import program


def cells(run, where):
    """Scenes."""
    return [[scene.name] for scene in where.scenes if scene.name not in run.get("without", [])]


def measure(cell, run, where, folder):
    scene = where.scene(*cell)
    output = os.path.join(folder, scene.name)
    budget = ["--times", ",".join(run["times"])] if "times" in run else ["--spp", ",".join(map(str, run["spp"]))]
    program.call("bench", scene.path, "--methods", ",".join(run["methods"]), *budget, "--seeds", run["seeds"], "--reference",
                 where.reference(scene.name)[0], "-o", output, "--resume", "-q")
    with open(os.path.join(output, "results.json")) as file:
        results = json.load(file)
    return [entry(record) for record in results["records"]]


def entry(record):
    """A record without what all of them share."""
    same = {key: record[key] for key in ("scene", "method", "budget", "seed", "spp")}
    return {**same, **program.four(record["metrics"], record["floor"]), "seconds": record["seconds"]["total"]}
