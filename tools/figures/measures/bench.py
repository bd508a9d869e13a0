"""Errors within budgets of time or samples, each run by itself: `fluxion bench`."""
import json
import os
import re

import program

REFERENCES = True


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
    for left_out in results["left_out"]:
        print("%(scene)s, %(method)s, %(budget)s was left out: %(reason)s" % left_out, flush=True)
    expected = len(run["methods"]) * len(run.get("times", run.get("spp"))) * run["seeds"]
    if len(results["records"]) + len(results["left_out"]) * run["seeds"] < expected:
        raise program.Failed("fluxion bench has stopped before its end on %s" % scene.name)
    return [entry(record) for record in results["records"]]


def image(folder, scene, method, budget):
    """The file of the image that `fluxion bench` keeps of the first seed."""
    name = "%s-%s-%s" % (scene, method, budget)
    return os.path.join(folder, scene, "images", re.sub(r"[^A-Za-z0-9.-]", "_", name) + ".exr")


def entry(record):
    """A record without what all of them share."""
    same = {key: record[key] for key in ("scene", "method", "budget", "seed", "spp")}
    return {**same, **program.four(record["metrics"], record["floor"]), "seconds": record["seconds"]["total"]}
