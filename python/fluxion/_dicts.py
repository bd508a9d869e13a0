"""Scenes as Python dictionaries, with the conventions of `mitsuba.load_dict`, as lines of a scene file.

Every line has the key that it comes from, as `scene["floor"]["bsdf"]`, which messages name in place of a file and a line.
"""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from ._fluxion import FluxionError, Scene, class_of, load_lines, write_image

# Elements of scene files whose plugins are no tables of the library.
_CLASSES = {
    **dict.fromkeys(["hdrfilm", "specfilm", "ldrfilm"], "film"),
    **dict.fromkeys(["independent", "stratified", "multijitter", "orthogonal", "ldsampler"], "sampler"),
    **dict.fromkeys(["box", "tent", "gaussian", "mitchell", "catmullrom", "lanczos"], "rfilter"),
    **dict.fromkeys(["path", "volpath", "volpathmis", "direct", "moment", "aov", "prb", "ptracer", "depth"], "integrator"),
    **dict.fromkeys(["homogeneous", "heterogeneous"], "medium"),
    **dict.fromkeys(["isotropic", "hg", "rayleigh"], "phase"),
    **dict.fromkeys(["gridvolume", "constvolume"], "volume"),
}
# Keys that say what an object of an unknown type is.
_KEYS = ("shape", "bsdf", "emitter", "texture", "sensor", "film", "sampler", "rfilter", "integrator", "medium", "phase")
# Elements of a `mesh`, with the names that ply files have for their columns.
_COLUMNS = {"vertex_positions": "xyz", "vertex_normals": ("nx", "ny", "nz"), "vertex_texcoords": "uv"}


def load_dict(scene: Mapping[str, Any], **keywords: Any) -> Scene:
    """Reads a scene from nested dictionaries, as `mitsuba.load_dict` does, with the keywords of `load_file`.

    Every object is a dictionary with its `type`; transforms are arrays of 4 x 4 (or, of texture coordinates, 3 x 3) or have
    such a `matrix`, colours are `{"type": "rgb", "value": [r, g, b]}`, and `{"type": "ref", "id": ...}` refers to another object of
    the scene by its key or `id`. Images are arrays of height, width and channels, or Mitsuba's bitmaps, as `bitmap` or `data` of a
    texture or an environment: those of integers are display-encoded unless `raw` is true. Meshes are arrays: `{"type": "mesh",
    "vertex_positions": n x 3, "faces": m x 3}`, with `vertex_normals` and `vertex_texcoords` if there are any; or have a method
    `write_ply`, as those of Mitsuba, and then the default material. Files are looked for in the current folder.
    """
    if not isinstance(scene, Mapping) or scene.get("type") != "scene":
        raise FluxionError('a scene is a dictionary with "type": "scene"')
    folder = tempfile.TemporaryDirectory(prefix="fluxion-")
    writer = _Writer(Path(folder.name))
    writer.lines.append(("scene", '<scene version="3.0.0">'))
    for key, value in scene.items():
        if key != "type":
            writer.value(key, value, f'scene["{key}"]', "scene")
    writer.lines.append(("scene", "</scene>"))
    return load_lines(writer.lines, folder, **keywords)


class _Writer:
    """Lines of a scene file, each with the key that it comes from."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.lines: list[tuple[str, str]] = []

    def put(self, at: str, tag: str, attributes: dict[str, str], closed: bool = True) -> None:
        text = "".join(f" {name}={quoteattr(value)}" for name, value in attributes.items())
        self.lines.append((at, f"<{tag}{text}{'/' if closed else ''}>".replace("\n", " ")))

    def value(self, key: str, value: Any, at: str, parent: str) -> None:
        """A property of an object."""
        if isinstance(value, Mapping):
            self.nested(key, value, at, parent)
        elif hasattr(value, "write_ply"):
            if getattr(value, "is_emitter", lambda: False)():
                raise FluxionError(f'{at}: an emissive mesh: give its arrays as {{"type": "mesh"}}, with the emitter in it')
            path = self.file("ply")
            value.write_ply(str(path))
            self.put(at, "shape", {"type": "ply", **_id(key, {}, parent)}, closed=False)
            self.put(at, "string", {"name": "filename", "value": str(path)})
            self.lines.append((at, "</shape>"))
        elif isinstance(value, (bool, np.bool_)):
            self.put(at, "boolean", {"name": key, "value": str(bool(value)).lower()})
        elif isinstance(value, (int, np.integer)):
            self.put(at, "integer", {"name": key, "value": str(int(value))})
        elif isinstance(value, (float, np.floating)):
            self.put(at, "float", {"name": key, "value": repr(float(value))})
        elif isinstance(value, (str, Path)):
            self.put(at, "string", {"name": key, "value": str(value)})
        else:
            self.array(key, value, at)

    def array(self, key: str, value: Any, at: str) -> None:
        """A vector, a colour or a transform."""
        numbers = _numbers(getattr(value, "matrix", value), at)
        text = " ".join(repr(number) for number in numbers.ravel().tolist())
        if numbers.shape in [(3, 3), (4, 4)]:
            if numbers.shape == (3, 3):
                # Texture coordinates have two axes and a translation.
                (a, b, x), (c, d, y), _ = numbers.tolist()
                text = f"{a} {b} 0 {x} {c} {d} 0 {y} 0 0 1 0 0 0 0 1"
            self.put(at, "transform", {"name": key}, closed=False)
            self.put(at, "matrix", {"value": text})
            self.lines.append((at, "</transform>"))
        elif numbers.shape == (3,):
            tag = "rgb" if "Color" in type(value).__name__ else "vector"
            self.put(at, tag, {"name": key, "value": text})
        elif numbers.shape in [(), (1,)]:
            self.put(at, "float", {"name": key, "value": text})
        else:
            shape = " x ".join(map(str, numbers.shape))
            raise FluxionError(f"{at}: an array of {shape} is neither a vector of 3 numbers nor a transform of 4 x 4")

    def nested(self, key: str, value: Mapping[str, Any], at: str, parent: str) -> None:
        """An object, a reference or a colour."""
        plugin = value.get("type")
        if not isinstance(plugin, str):
            raise FluxionError(f'{at}: a dictionary needs its "type"')
        name = {} if parent == "scene" else {"name": key}
        if plugin == "ref":
            self.put(at, "ref", {**name, "id": str(value.get("id", ""))})
        elif plugin in ("rgb", "spectrum") and "value" in value:
            self.put(at, plugin, {**name, "value": _spectrum(value["value"], f'{at}["value"]')})
        elif plugin == "spectrum":
            self.put(at, plugin, {**name, "filename": str(value.get("filename", ""))})
        else:
            self.object(key, dict(value), at, parent)

    def object(self, key: str, value: dict[str, Any], at: str, parent: str) -> None:
        """An object with everything in it, its arrays in files."""
        plugin = value.pop("type").lower()
        if plugin == "mesh":
            plugin, value = "ply", self.mesh(value, at)
        for name in ("bitmap", "data"):
            if plugin in ("bitmap", "envmap") and name in value:
                value["filename"] = str(self.image(value.pop(name), bool(value.get("raw", False)), f'{at}["{name}"]'))
        tag = class_of(plugin) or _CLASSES.get(plugin) or (key if key in _KEYS else "shape")
        attributes = {"type": plugin, **_id(key, value, parent)}
        if parent != "scene":
            attributes["name"] = key
        value.pop("id", None)
        self.put(at, tag, attributes, closed=False)
        for name, inner in value.items():
            self.value(name, inner, f'{at}["{name}"]', tag)
        self.lines.append((at, f"</{tag}>"))

    def file(self, extension: str) -> Path:
        return self.folder / f"{len(self.lines)}.{extension}"

    def image(self, value: Any, raw: bool, at: str) -> Path:
        """An image as a file of linear floats."""
        pixels = np.asarray(value)
        if pixels.ndim == 2:
            pixels = pixels[:, :, None]
        if pixels.ndim != 3 or pixels.shape[2] not in (1, 2, 3, 4):
            shape = " x ".join(map(str, pixels.shape))
            raise FluxionError(f"{at}: an array of {shape} is no image of height x width x channels")
        encoded = getattr(value, "srgb_gamma", lambda: pixels.dtype.kind in "ui")() and not raw
        pixels = pixels[:, :, :3] if pixels.shape[2] > 2 else np.repeat(pixels[:, :, :1], 3, axis=2)
        if pixels.dtype.kind in "ui":
            pixels = pixels / np.iinfo(pixels.dtype).max
        if encoded:
            pixels = np.where(pixels <= 0.04045, pixels / 12.92, ((np.maximum(pixels, 0.0) + 0.055) / 1.055) ** 2.4)
        path = self.file("exr")
        write_image(path, np.ascontiguousarray(pixels, dtype=np.float32))
        return path

    def mesh(self, value: dict[str, Any], at: str) -> dict[str, Any]:
        """A mesh as a ply file, and everything else in it."""
        columns, names = [], []
        for name, axes in _COLUMNS.items():
            if name in value:
                numbers = _numbers(value.pop(name), f'{at}["{name}"]')
                columns.append(numbers.astype("<f4").reshape(-1, len(axes)))
                names += axes
        if "faces" not in value or not columns or names[0] != "x":
            raise FluxionError(f'{at}: a mesh needs "vertex_positions" and "faces"')
        if len({len(column) for column in columns}) != 1:
            raise FluxionError(f"{at}: positions, normals and texture coordinates of a mesh are as many as its vertices")
        faces = np.asarray(value.pop("faces")).reshape(-1, 3).astype("<i4")
        header = [f"ply\nformat binary_little_endian 1.0\nelement vertex {len(columns[0])}"]
        header += [f"property float {name}" for name in names]
        header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header\n"]
        rows = np.zeros(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
        rows["count"], rows["corners"] = 3, faces
        path = self.file("ply")
        path.write_bytes("\n".join(header).encode() + np.hstack(columns).tobytes() + rows.tobytes())
        return {**value, "filename": str(path)}


def _id(key: str, value: Mapping[str, Any], parent: str) -> dict[str, str]:
    """The id of an object: its own, or the key of one directly in the scene."""
    own = value.get("id", key if parent == "scene" else None)
    return {} if own is None else {"id": str(own)}


def _numbers(value: Any, at: str) -> np.ndarray:
    try:
        numbers = np.squeeze(np.asarray(value, dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise FluxionError(f"{at}: {type(value).__name__} is no value of a scene: {error}") from None
    if not np.isfinite(numbers).all():
        raise FluxionError(f"{at}: a number is not finite")
    return numbers


def _spectrum(value: Any, at: str) -> str:
    """One number, three of a colour, or pairs of a wavelength and a value."""
    if isinstance(value, str):
        return value
    numbers = _numbers(value, at)
    if np.ndim(value) == 2:
        return ", ".join(f"{wavelength}:{number}" for wavelength, number in numbers.reshape(-1, 2).tolist())
    return " ".join(repr(number) for number in np.atleast_1d(numbers).tolist())
