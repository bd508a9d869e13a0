"""Training data that `fluxion dataset` has written, as arrays.

    for sample in fluxion.data.open("frames"):
        noisy = sample.inputs(spp=16)     # a dictionary of arrays, height x width x channels
        clean = sample.target()           # height x width x 3
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._fluxion import read_image


class Sample:
    """One picture of a data set: what is known of it at several numbers of samples, and its target."""

    def __init__(self, manifest: Path):
        self.manifest: dict[str, Any] = json.loads(manifest.read_text())
        self.name: str = self.manifest["name"]
        self.spp: list[int] = list(self.manifest["recipe"]["spp"])
        self._layout: str = self.manifest["recipe"]["layout"]
        self._stem = str(manifest.with_suffix(""))

    def __repr__(self) -> str:
        return f"<fluxion.data.Sample {self.name} at {self.spp} samples a pixel>"

    def array(self, spp: int) -> NDArray[np.floating]:
        """All channels at so many samples, mapped from the file: height x width x channels, as `channels` names them."""
        self._check(spp, "npy")
        path = f"{self._stem}_{spp:04}spp.npy"
        array = np.load(path, mmap_mode="r")
        if array.shape[-1] != len(self.channels):
            what = f"{array.shape[-1]} channels, its manifest names {len(self.channels)}: render the frame again"
            raise ValueError(f"{path}: the array has {what}")
        return array

    @property
    def channels(self) -> list[str]:
        """Names of the channels of `array`."""
        return list(self.manifest["channels"])

    def inputs(self, spp: int) -> dict[str, NDArray[np.floating]]:
        """The layers at so many samples by their names; the colour is `color`."""
        if self._layout == "oidn":
            self._check(spp, "oidn")
            ends = {"color": "hdr", "albedo": "alb", "normal": "nrm"}
            return {name: read_image(f"{self._stem}_{spp:04}spp.{end}.exr") for name, end in ends.items()}
        array, groups = self.array(spp), {}
        for k, channel in enumerate(self.channels):
            layer = channel.rpartition(".")[0] or "color"
            groups.setdefault(layer, []).append(k)
        return {layer: array[..., at[0] : at[-1] + 1] for layer, at in groups.items()}

    def target(self) -> NDArray[np.floating]:
        """The image to be learned, directly seen emitters included: height x width x 3."""
        if self._layout == "oidn":
            return read_image(f"{self._stem}_ref.hdr.exr")
        return np.load(f"{self._stem}_ref.npy", mmap_mode="r")[..., :3]

    def difference(self) -> NDArray[np.floating]:
        """The first half of the target's samples less the second: half of it, squared, is the target's own noise."""
        self._check(self.spp[0], "npy")
        return np.load(f"{self._stem}_ref.npy", mmap_mode="r")[..., 3:6]

    def _check(self, spp: int, layout: str) -> None:
        if self._layout != layout:
            raise ValueError(f"{self.name} has the layout {self._layout}, not {layout}")
        if spp not in self.spp:
            raise ValueError(f"{self.name} has no {spp} samples a pixel; there are {self.spp}")


class Dataset(Sequence[Sample]):
    """All pictures of a folder whose manifests are there, by name."""

    def __init__(self, folder: str | PathLike[str]):
        self.folder = Path(folder)
        if not self.folder.is_dir():
            raise FileNotFoundError(f"{self.folder} is no folder of frames")
        self._manifests = sorted(path for path in self.folder.glob("*.json") if _is_manifest(path))

    def __len__(self) -> int:
        return len(self._manifests)

    def __getitem__(self, index):
        if isinstance(index, slice):
            return [Sample(path) for path in self._manifests[index]]
        return Sample(self._manifests[index])

    def __repr__(self) -> str:
        return f"<fluxion.data.Dataset {self.folder} of {len(self)} pictures>"


def _is_manifest(path: Path) -> bool:
    """Whether a file is a manifest rather than something else that is kept beside the frames."""
    return re.search(r'"target_seed"\s*:', path.read_text()) is not None


def open(folder: str | PathLike[str]) -> Dataset:
    """The data set in a folder that `fluxion dataset -o` wrote."""
    return Dataset(folder)
