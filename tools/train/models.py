"""Furniture and environments for training scenes, from two packages of Debian whose models and images are CC0.

    python tools/train/models.py FOLDER

downloads `sweethome3d-furniture` and `blender-data` by apt-get, converts the models of the CC0 catalogue (those under other
licences are left out) and copies the environments. FOLDER then holds models.json, models/NAME/K.ply with one mesh for each
material, the images they name, and environments/*.exr. Lengths are metres, y is up, models stand on the origin.
"""
import io
import json
import os
import subprocess
import sys
import tempfile
import zipfile

import numpy as np

import meshes

CATALOGUE = "usr/share/sweethome3d/furniture/BlendSwap-CC-0.sh3f"
ENVIRONMENTS = "usr/share/blender/datafiles/studiolights/world"
# Rooms have doors, lamps and inhabitants of their own.
LEFT_OUT = {"Exterior", "Staircases", "Characters", "Vehicles"}


def catalogue(archive):
    """Rows of the catalogue: dictionaries of a model's properties."""
    rows = {}
    for line in io.TextIOWrapper(archive.open("PluginFurnitureCatalog.properties"), "latin-1"):
        key, _, value = line.strip().partition("=")
        name, _, number = key.partition("#")
        if number.isdigit():
            rows.setdefault(int(number), {})[name] = value
    return [rows[number] for number in sorted(rows)]


def materials(text):
    """Diffuse colours and images by the name of a material."""
    found, current = {}, {}
    for line in text.splitlines():
        word, _, rest = line.strip().partition(" ")
        if word == "newmtl":
            current = found.setdefault(rest.strip(), {})
        elif word in ("Kd", "d"):
            current[word] = [float(x) for x in rest.split()]
        elif word == "map_Kd":
            current[word] = rest.strip()
    return found


def surfaces(text):
    """Vertices of triangles by material: arrays of shape (triangles, 3, 8) of position, normal and texture coordinates."""
    arrays, corners, material = {"v": [], "vn": [], "vt": []}, {}, ""
    for line in text.splitlines():
        word, _, rest = line.partition(" ")
        if word in arrays:
            arrays[word].append([float(x) for x in rest.split()])
        elif word == "usemtl":
            material = rest.strip()
        elif word == "f":
            polygon = [tuple(int(x) if x else 0 for x in (corner + "//").split("/")[:3]) for corner in rest.split()]
            triangles = [(polygon[0], polygon[k], polygon[k + 1]) for k in range(1, len(polygon) - 1)]
            corners.setdefault(material, []).extend(triangles)
    position = np.array(arrays["v"])[:, :3]
    normal = np.array(arrays["vn"] or [[0.0, 0.0, 0.0]])
    uv = np.array([pair[:2] for pair in arrays["vt"]] or [[0.0, 0.0]])
    made = {}
    for name, triangles in corners.items():
        index = np.array(triangles)
        at = lambda values, k: values[np.where(index[..., k] > 0, index[..., k] - 1, index[..., k])]
        parts = [at(position, 0), at(normal, 2) * (index[..., 2:] != 0), at(uv, 1) * (index[..., 1:2] != 0)]
        made[name] = np.concatenate(parts, -1)
    return made


def convert(archive, row, folder):
    """Writes a model; its row for models.json, or None where the catalogue turns it or it is empty."""
    path = row["model"].lstrip("/")
    beside = os.path.dirname(path)
    text = archive.read(path).decode("latin-1")
    library = [line.split(None, 1)[1].strip() for line in text.splitlines() if line.startswith("mtllib")]
    colours = materials(archive.read(f"{beside}/{library[0]}").decode("latin-1")) if library else {}
    by_material = surfaces(text)
    if "modelRotation" in row or not by_material:
        return None
    corners = np.concatenate([mesh[..., :3].reshape(-1, 3) for mesh in by_material.values()])
    low, high = corners.min(0), corners.max(0)
    size = np.array([float(row["width"]), float(row["height"]), float(row["depth"])]) / 100
    scale = size / np.maximum(high - low, 1e-6)
    origin = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    name = os.path.basename(beside)
    os.makedirs(f"{folder}/models/{name}", exist_ok=True)
    parts = []
    for k, (material, mesh) in enumerate(by_material.items()):
        mesh[..., :3] = (mesh[..., :3] - origin) * scale
        normal = mesh[..., 3:6] / scale
        mesh[..., 3:6] = normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
        meshes.write_ply(f"{folder}/models/{name}/{k}.ply", mesh)
        colour = colours.get(material, {})
        image = colour.get("map_Kd")
        if image and f"{beside}/{image}" in archive.namelist():
            with open(f"{folder}/models/{name}/{os.path.basename(image)}", "wb") as file:
                file.write(archive.read(f"{beside}/{image}"))
            image = os.path.basename(image)
        else:
            image = None
        parts.append({"file": f"models/{name}/{k}.ply", "colour": colour.get("Kd", [0.5] * 3), "image": image})
    top = float(row["dropOnTopElevation"]) / 100 if "dropOnTopElevation" in row else None
    return {"name": name, "category": row["category"], "size": size.tolist(), "top": top, "parts": parts,
            "elevation": float(row.get("elevation", 0)) / 100, "creator": row.get("creator", "")}


def main(folder):
    os.makedirs(f"{folder}/environments", exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        # Package lists may be old or absent; downloading does not need to be root, updating them does.
        subprocess.run(["apt-get", "update", "-qq"], check=False)
        for package in ("sweethome3d-furniture", "blender-data"):
            subprocess.run(["apt-get", "download", package], cwd=scratch, check=True)
        for package in os.listdir(scratch):
            subprocess.run(["dpkg-deb", "-x", package, "unpacked"], cwd=scratch, check=True)
        environments = f"{scratch}/unpacked/{ENVIRONMENTS}"
        for name in sorted(os.listdir(environments)):
            if name.endswith(".exr"):
                with open(f"{environments}/{name}", "rb") as source, open(f"{folder}/environments/{name}", "wb") as file:
                    file.write(source.read())
        with zipfile.ZipFile(f"{scratch}/unpacked/{CATALOGUE}") as archive:
            rows = [row for row in catalogue(archive) if row["category"] not in LEFT_OUT]
            made = [model for row in rows if (model := convert(archive, row, folder))]
    with open(f"{folder}/models.json", "w") as file:
        json.dump(made, file, indent=1)
    print(f"{len(made)} models in {folder}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
