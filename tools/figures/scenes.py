"""The scenes of figures/scenes.toml, and folders of what is measured."""
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


def load(public):
    """All scenes, and the floor that references should have. `public` is the folder of public scenes; without one these are left
    out."""
    with open(os.path.join(ROOT, "figures", "scenes.toml"), "rb") as file:
        table = tomllib.load(file)
    folders = [("bundled", os.path.join(ROOT, "scenes"))] + ([("public", public)] if public else [])
    scenes = [
        Scene(name, os.path.join(folder, name, "scene.xml"), size)
        for group, folder in folders
        for name, size in table[group].items()
    ]
    return scenes, table["reference"]["floor"]
