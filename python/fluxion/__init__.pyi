from collections.abc import Callable, Iterator, Mapping, Sequence
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import data as data

__version__: str

_Path = str | PathLike[str]
_Image = NDArray[np.float32]
_Progress = Callable[[str, float], object]

class FluxionError(Exception):
    """Input that cannot be used: a scene that is malformed, a layer that is missing, images that do not fit."""

class Scene:
    """A scene that has been read, ready to be rendered."""

    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def spp(self) -> int: ...
    @property
    def path(self) -> PathLike[str]: ...
    @property
    def warnings(self) -> list[str]: ...

class Frame:
    """Means and variances of all samples, as layers: what a reconstruction takes."""

    @staticmethod
    def from_arrays(color: ArrayLike, *, spp: int | None = None, **layers: ArrayLike) -> Frame: ...
    @staticmethod
    def from_renders(colors: Sequence[ArrayLike], *, spp: int, **layers: ArrayLike) -> Frame: ...
    @staticmethod
    def load(path: _Path, *, spp: int | None = None, view_layer: str | None = None) -> Frame: ...
    def save(self, path: _Path) -> None: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def provenance(self) -> dict[str, str]: ...
    def keys(self) -> list[str]: ...
    def __len__(self) -> int: ...
    def __contains__(self, key: str) -> bool: ...
    def __getitem__(self, key: str) -> _Image: ...
    def __iter__(self) -> Iterator[str]: ...

class Solution:
    """A reconstructed image."""

    @property
    def image(self) -> _Image: ...
    @property
    def alpha(self) -> _Image | None: ...
    @property
    def error(self) -> _Image | None: ...
    @property
    def notes(self) -> dict[str, _Image]: ...
    @property
    def lights(self) -> dict[str, _Image]: ...

class Rendering(Solution):
    """A rendered and reconstructed image, with the frame that it was made of."""

    @property
    def frame(self) -> Frame: ...
    @property
    def solution(self) -> Solution: ...
    @property
    def spp(self) -> float: ...
    @property
    def seconds(self) -> float: ...
    @property
    def plan(self) -> str: ...

class Job:
    """Renders in chunks for many machines: a folder with a plan, and a checkpoint for each chunk."""

    @staticmethod
    def plan(
        scenes: Sequence[_Path],
        folder: _Path,
        *,
        spp: int,
        chunks: int = 1,
        frames: tuple[int, int] | None = None,
        adaptive: str | None = None,
        **keywords: object,
    ) -> Job: ...
    @staticmethod
    def load(folder: _Path) -> Job: ...
    @property
    def chunks(self) -> int: ...
    @property
    def images(self) -> list[str]: ...
    def run(self, chunk: int, *, threads: int = 0, progress: _Progress | None = None) -> bool: ...
    def allocate(self) -> dict[str, tuple[int, int]]: ...
    def status(self, verify: bool = False) -> dict[str, int | list[int]]: ...
    def merge(self, *, partial: bool = False, image: bool = True) -> list[PathLike[str]]: ...

def load_file(
    path: _Path,
    *,
    size: tuple[int, int] | None = None,
    crop: tuple[int, int, int, int] | None = None,
    sensor: str | int | None = None,
    max_depth: int | None = None,
    strict: bool = False,
    threads: int = 0,
    texture_memory: int = 4096,
    light_groups: str | None = None,
    **defines: object,
) -> Scene: ...
def load_string(
    xml: str,
    *,
    size: tuple[int, int] | None = None,
    crop: tuple[int, int, int, int] | None = None,
    sensor: str | int | None = None,
    max_depth: int | None = None,
    strict: bool = False,
    threads: int = 0,
    texture_memory: int = 4096,
    light_groups: str | None = None,
    **defines: object,
) -> Scene: ...
def load_dict(
    scene: Mapping[str, object],
    *,
    size: tuple[int, int] | None = None,
    crop: tuple[int, int, int, int] | None = None,
    sensor: str | int | None = None,
    max_depth: int | None = None,
    strict: bool = False,
    threads: int = 0,
    texture_memory: int = 4096,
    light_groups: str | None = None,
) -> Scene: ...
def render(
    scene: Scene | _Path,
    *,
    spp: int | None = None,
    time: float | None = None,
    target_error: float | None = None,
    seed: int = 0,
    first: int = 0,
    goals: _Path | None = None,
    size: tuple[int, int] | None = None,
    method: str = ...,
    adaptive: str | None = None,
    kernel: str = "cross",
    pilot: int | None = None,
    shift: str = ...,
    every_difference: bool = False,
    layers: bool = False,
    memory: int | None = None,
    notes: bool = False,
    cryptomatte: _Path | None = None,
    samples: _Path | None = None,
    checkpoint: _Path | None = None,
    checkpoint_every: float = 60.0,
    resume: bool = False,
    threads: int = 0,
    progress: _Progress | None = None,
    **statistics: bool,
) -> Rendering: ...
def statistics() -> list[tuple[str, str]]: ...
def reconstruct(
    frame: Frame,
    method: str = ...,
    *,
    memory: int | None = None,
    notes: bool = False,
    threads: int = 0,
    progress: _Progress | None = None,
) -> Solution: ...
def compare(image: ArrayLike, reference: ArrayLike, metrics: Sequence[str] | None = None) -> dict[str, float]: ...
def methods() -> dict[str, str]: ...
def metrics() -> dict[str, str]: ...
def read_image(path: _Path) -> _Image: ...
def write_image(path: _Path, array: ArrayLike, *, exposure: float = 0.0) -> None: ...
