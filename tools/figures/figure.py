"""Figures: what figures/NAME.toml asks for, and what docs/figures/NAME.json holds."""
import json
import os
import subprocess
import tomllib
from datetime import date

import scenes
import sources
from scenes import ROOT

SPECIFICATIONS = os.path.join(ROOT, "figures")
RESULTS = os.path.join(ROOT, "docs", "figures")
# Measures that take every scene of figures/scenes.toml but those that the figure leaves out.
OF_ALL_SCENES = ("agreement", "bench", "samples")


class Figure:
    """A figure by its specification."""

    def __init__(self, name):
        self.name = name
        with open(os.path.join(SPECIFICATIONS, name + ".toml"), "rb") as file:
            self.specification = tomllib.load(file)

    def __getitem__(self, key):
        return self.specification[key]

    @property
    def file(self):
        return os.path.join(RESULTS, self.name + ".json")

    def sizes(self):
        """The scenes of figures/scenes.toml that it measures, with their sizes."""
        known, run = scenes.sizes(), self["run"]
        if self["measure"] in OF_ALL_SCENES:
            names = [name for name in known if name not in run.get("without", [])]
        else:
            names = [run["scene"]] if "scene" in run else run.get("scenes", [])
        return {name: known[name] for name in names if name in known}

    def inputs(self):
        """Digests of what decides the figure: what is run on which scenes, by which code."""
        sizes, inside = self.sizes(), scenes.bundled()
        asked = {"run": [self["measure"], self["run"]], **({"sizes": sizes} if sizes else {})}
        bundled = [os.path.join("scenes", name) for name in sizes if name in inside]
        paths = ["tools/figures/measures/%s.py" % self["measure"], *bundled, *sources.all_below(self["depends"])]
        digests = {key: sources.of_text(json.dumps(value, sort_keys=True)) for key, value in asked.items()}
        return {**digests, **{path: sources.of_path(path) for path in paths}}

    def results(self):
        """What was measured; None before the first time."""
        if not os.path.exists(self.file):
            return None
        with open(self.file) as file:
            return json.load(file)

    def changed(self):
        """Inputs that are others than when it was measured; None where it was not."""
        results = self.results()
        if results is None:
            return None
        now = self.inputs()
        return [name for name in {**now, **results["inputs"]} if results["inputs"].get(name) != now.get(name)]

    def head(self):
        """What is written down before the first run."""
        return {"commit": commit(sources.all_below(self["depends"])), "date": date.today().isoformat(), "machine": machine(),
                "inputs": self.inputs()}

    def save(self, head, runs, seconds):
        """Stores the runs, one a line."""
        lines = ",\n".join(json.dumps(rounded(run)) for run in runs)
        os.makedirs(RESULTS, exist_ok=True)
        with open(self.file + ".part", "w") as file:
            file.write(json.dumps({**head, "minutes": round(seconds / 60, 1)})[:-1] + ', "runs": [\n' + lines + "\n]}\n")
        os.replace(self.file + ".part", self.file)


def every():
    """All figures, by name."""
    names = sorted(name[:-5] for name in os.listdir(SPECIFICATIONS) if name.endswith(".toml") and name != "scenes.toml")
    return [Figure(name) for name in names]


def rounded(value):
    """Numbers with the five digits that mean something."""
    if isinstance(value, dict):
        return {key: rounded(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [rounded(inner) for inner in value]
    return float("%.5g" % value) if isinstance(value, float) else value


def commit(paths):
    """The commit that is checked out, with a plus where these files differ from it."""
    git = lambda *arguments: subprocess.run(["git", "-C", ROOT, *arguments], check=True, capture_output=True, text=True).stdout.strip()
    changed = git("status", "--porcelain", "--", *paths)
    return git("rev-parse", "--short=10", "HEAD") + ("+" if changed else "")


def machine():
    """Processor and number of its threads."""
    with open("/proc/cpuinfo") as file:
        model = next((line.split(":", 1)[1].strip() for line in file if line.startswith("model name")), "unknown processor")
    return "%s, %d threads" % (model, len(os.sched_getaffinity(0)))
