"""Gradient-domain path tracing and image reconstruction.

    import fluxion

    scene = fluxion.load_file("scene.xml", size=(640, 360))
    rendering = fluxion.render(scene, spp=16)
    fluxion.write_image("image.exr", rendering.image)

Images are arrays of height, width and channels in 32-bit floats, in linear radiance. Those of frames and solutions are read-only
and share the memory of their owner. Long work releases the interpreter's lock and ends soon after Ctrl-C.
"""

import importlib.util
import os
from pathlib import Path

from . import data
from ._dicts import load_dict
from ._fluxion import (
    FluxionError,
    Frame,
    Job,
    Rendering,
    Scene,
    Solution,
    __version__,
    compare,
    load_file,
    load_string,
    methods,
    metrics,
    read_image,
    reconstruct,
    render,
    statistics,
    write_image,
)

__all__ = [
    "FluxionError",
    "Frame",
    "Job",
    "Rendering",
    "Scene",
    "Solution",
    "__version__",
    "compare",
    "data",
    "load_dict",
    "load_file",
    "load_string",
    "methods",
    "metrics",
    "read_image",
    "reconstruct",
    "render",
    "statistics",
    "write_image",
]


def _find_open_image_denoise() -> None:
    """Lets the methods that need it find Open Image Denoise in the wheel `pyoidn` of the same environment."""
    found = importlib.util.find_spec("pyoidn")
    if found and found.origin:
        os.environ.setdefault("OIDN_DIR", str(Path(found.origin).parent / "oidn"))


_find_open_image_denoise()
