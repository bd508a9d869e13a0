"""Figures: what figures/NAME.toml asks for, and what docs/figures/NAME.json holds."""
import hashlib
import json
import os
import subprocess
import tomllib
from datetime import date

from scenes import ROOT

SPECIFICATIONS = os.path.join(ROOT, "figures")
RESULTS = os.path.join(ROOT, "docs", "figures")
# Lines of code that say nothing to a compiler.
COMMENT = ("//",)
CODE = (".rs", ".h", ".c", ".cpp")
# Measures that take every scene there is.
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

    def inputs(self):
        """Digests of what decides the figure: folders of the program, and what is run."""
        text = json.dumps([self["measure"], self["run"]], sort_keys=True)
        scenes = {"figures/scenes.toml": digest("figures/scenes.toml")} if self["measure"] in OF_ALL_SCENES else {}
        return {"run": digest_of_text(text), **scenes, **{folder: digest(folder) for folder in self["depends"]}}

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
        return [name for name, value in self.inputs().items() if results["inputs"].get(name) != value]

    def save(self, runs, seconds):
        """Stores the runs, one a line."""
        head = {"commit": commit(self["depends"]), "date": date.today().isoformat(), "machine": machine(), "minutes": round(seconds / 60, 1),
                "inputs": self.inputs()}
        lines = ",\n".join(json.dumps(rounded(run)) for run in runs)
        os.makedirs(RESULTS, exist_ok=True)
        with open(self.file + ".part", "w") as file:
            file.write(json.dumps(head)[:-1] + ', "runs": [\n' + lines + "\n]}\n")
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


def digest_of_text(text):
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def digest(path):
    """Of a file or folder. Comments and empty lines of code do not count, nor do documents."""
    whole = hashlib.sha256()
    top = os.path.join(ROOT, path)
    names = [top] if os.path.isfile(top) else sorted(
        os.path.join(folder, name) for folder, _, files in os.walk(top) for name in files if not name.endswith((".md", ".pyc")))
    for name in names:
        with open(name, "rb") as file:
            content = file.read()
        if name.endswith(CODE):
            lines = (line.strip() for line in content.decode().splitlines())
            content = "\n".join(line for line in lines if line and not line.startswith(COMMENT)).encode()
        whole.update(os.path.relpath(name, ROOT).encode() + b"\0" + content + b"\0")
    return whole.hexdigest()[:16]


def commit(folders):
    """The commit that is checked out, with a plus where files in these folders differ from it."""
    git = lambda *arguments: subprocess.run(["git", "-C", ROOT, *arguments], check=True, capture_output=True, text=True).stdout.strip()
    changed = git("status", "--porcelain", "--", *folders)
    return git("rev-parse", "--short=10", "HEAD") + ("+" if changed else "")


def machine():
    """Processor and number of its threads."""
    with open("/proc/cpuinfo") as file:
        model = next((line.split(":", 1)[1].strip() for line in file if line.startswith("model name")), "unknown processor")
    return "%s, %d threads" % (model, len(os.sched_getaffinity(0)))
