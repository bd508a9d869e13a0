"""The scenes of figures/scenes.toml, and where the program is."""
import os
import tomllib
from dataclasses import dataclass

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
FLUXION = os.environ.get("FLUXION", os.path.join(ROOT, "target", "release", "fluxion"))


@dataclass(frozen=True)
class Scene:
    """A scene at the size of its reference."""

    name: str
    path: str
    size: str

    @property
    def width_and_height(self):
        return tuple(int(number) for number in self.size.split("x"))


def table():
    with open(os.path.join(ROOT, "figures", "scenes.toml"), "rb") as file:
        return tomllib.load(file)


def sizes():
    """Names and sizes of all scenes."""
    groups = table()
    return {**groups["bundled"], **groups["public"]}


def bundled():
    """Names of the scenes in the repository."""
    return list(table()["bundled"])


def floor():
    """The floor that references should have."""
    return table()["reference"]["floor"]


def load(public):
    """The scenes that are there. `public` is the folder of public scenes; without one these are left out."""
    inside = bundled()
    folder = lambda name: os.path.join(ROOT, "scenes") if name in inside else public
    scenes = [Scene(name, os.path.join(folder(name), name, "scene.xml"), size) for name, size in sizes().items() if folder(name)]
    return [scene for scene in scenes if os.path.exists(scene.path)]
