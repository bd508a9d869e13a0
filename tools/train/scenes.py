"""Random scenes to train on, as Mitsuba XML that Fluxion and Mitsuba 3 read alike.

    python tools/train/models.py MODELS
    python tools/train/scenes.py MODELS FOLDER --first 0 --count 400

writes FOLDER/000000/scene.xml and so on. A scene is a function of its number: furnished rooms (eight of ten), models
outdoors, and abstract heaps of shapes. A scene that shows little (darkness, one surface, something right before the lens) is
drawn again; `--fluxion` names the program that looks. Needs numpy and PyPI openimageio.
"""
import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import exr
import meshes
from materials import ODDS, OPAQUE, Palette, choose, log_uniform, number, rgb

KINDS = {"room": 80, "outdoors": 10, "abstract": 10}
SMALLEST_TABLE = 0.4
ATTEMPTS = 12


class Scene:
    """Elements of a file, and the boxes that furniture takes on the floor."""

    def __init__(self, rng, models, folder):
        self.rng, self.models, self.folder = rng, models, folder
        self.palette = Palette(rng, folder)
        self.elements, self.taken, self.meshes = [], [], 0
        # Points that a camera may look at.
        self.interesting = []

    def mesh(self, triangles, inside):
        name = f"mesh{self.meshes}.ply"
        self.meshes += 1
        meshes.write_ply(os.path.join(self.folder, name), triangles)
        self.elements.append(f'<shape type="ply"><string name="filename" value="{name}"/>{inside}</shape>')

    def sphere(self, center, radius, inside):
        point = '<point name="center" x="%.5g" y="%.5g" z="%.5g"/>' % tuple(center)
        self.elements.append(f'<shape type="sphere">{point}{number("radius", radius)}{inside}</shape>')

    def model(self, row, at, angle, scale=1.0):
        """A piece of furniture; materials are drawn anew, half of the time with the model's own images."""
        to_world = ('<transform name="to_world"><scale value="%.4g"/><rotate y="1" angle="%.4g"/>'
                    '<translate x="%.5g" y="%.5g" z="%.5g"/></transform>' % (scale, angle, *at))
        for part in row["parts"]:
            own = part["image"] and self.rng.random() < 0.5
            image = os.path.relpath(os.path.join(self.models, os.path.dirname(part["file"]), part["image"]),
                                    self.folder) if own else None
            if not own and self.rng.random() < 0.2:
                colour = rgb("reflectance", np.clip(part["colour"], 0.02, 0.9))
                bsdf = f'<bsdf type="twosided"><bsdf type="diffuse">{colour}</bsdf></bsdf>'
            else:
                bsdf = self.palette.bsdf(OPAQUE if self.rng.random() < 0.9 else ODDS, image)
            file = os.path.relpath(os.path.join(self.models, part["file"]), self.folder)
            self.elements.append(f'<shape type="ply"><string name="filename" value="{file}"/>{to_world}{bsdf}</shape>')
        self.interesting.append(np.add(at, [0, 0.5 * scale * row["size"][1], 0]))

    def free(self, center, half, margin=0.05):
        """Whether a rectangle on the floor overlaps nothing there."""
        apart = lambda other: np.any(np.abs(center - other[0]) > half + other[1] + margin)
        return all(apart(other) for other in self.taken)

    def environment(self, scale):
        folder = os.path.join(self.models, "environments")
        names = sorted(os.listdir(folder))
        file = os.path.relpath(os.path.join(folder, names[self.rng.integers(len(names))]), self.folder)
        turn = '<transform name="to_world"><rotate y="1" angle="%.4g"/></transform>' % self.rng.uniform(0, 360)
        self.elements.append(f'<emitter type="envmap"><string name="filename" value="{file}"/>'
                             f'{number("scale", scale)}{turn}</emitter>')

    def radiance(self, area, power):
        """An area emitter of a total power in watts a unit of spectrum, its colour warm to cold."""
        warm = self.rng.uniform(-0.35, 0.2)
        value = power / max(area * np.pi, 1e-6) * np.array([1 - warm, 1, 1 + warm])
        return f'<emitter type="area">{rgb("radiance", value)}</emitter>'

    def primitive(self, at, size):
        """A sphere or a box."""
        bsdf = self.palette.bsdf()
        if self.rng.random() < 0.5:
            self.sphere(np.add(at, [0, size, 0]), size, bsdf)
        else:
            half = size * self.rng.uniform(0.4, 1, 3)
            triangles = meshes.box(-half * [1, 0, 1], half * [1, 2, 1])
            self.mesh(meshes.moved(triangles, self.rng.uniform(0, 6.3), at), bsdf)


def furnish(scene, models, low, high, count):
    """Furniture on the floor of a room from `low` to `high`, small things on tables."""
    rng = scene.rng
    large = [m for m in models if m["elevation"] < 0.05 and max(m["size"]) > 0.35]
    small = [m for m in models if max(m["size"]) < 0.45]
    for _ in range(count):
        row = large[rng.integers(len(large))]
        width, height, depth = row["size"]
        for _ in range(20):
            quarter = int(rng.integers(4))
            half = np.array([width, depth] if quarter % 2 == 0 else [depth, width]) / 2
            room = np.array([high[0] - low[0], high[2] - low[2]]) / 2 - half
            if np.any(room <= 0) or height > high[1]:
                break
            at = rng.uniform(-room, room)
            if rng.random() < 0.6:
                # The back, at negative z, stands against a wall.
                axis, side = [(1, -1), (0, -1), (1, 1), (0, 1)][quarter]
                at[axis] = side * (room[axis] - 0.02)
            at += np.array([high[0] + low[0], high[2] + low[2]]) / 2
            if not scene.free(at, half):
                continue
            scene.taken.append((at, half))
            scene.model(row, (at[0], 0, at[1]), 90.0 * quarter)
            if row["top"] and min(width, depth) > SMALLEST_TABLE:
                for _ in range(rng.integers(0, 4)):
                    thing = small[rng.integers(len(small))]
                    reach = half - max(thing["size"][0], thing["size"][2]) / 2
                    if np.all(reach > 0):
                        spot = at + rng.uniform(-reach, reach)
                        scene.model(thing, (spot[0], row["top"], spot[1]), rng.uniform(0, 360))
            break


def wall(scene, origin, along, width, height, hole, bsdf):
    """A wall from `origin` in the direction `along`, with a hole (left, right, bottom, top) or none."""
    origin, along, up = np.asarray(origin, float), np.asarray(along, float), np.array([0, 1.0, 0])
    panel = lambda s0, s1, t0, t1: (origin + s0 * along + t0 * up, (s1 - s0) * along, (t1 - t0) * up)
    if hole is None:
        panels = [panel(0, width, 0, height)]
    else:
        left, right, bottom, top = hole
        panels = [panel(0, left, 0, height), panel(right, width, 0, height), panel(left, right, top, height)]
        if bottom > 0:
            panels.append(panel(left, right, 0, bottom))
    scene.mesh(meshes.quads(panels), bsdf)


def lamps(scene, low, high, strength, indirect):
    """One to four lamps in a room; behind a screen, all of them, if the room is to be lit indirectly."""
    rng = scene.rng
    for _ in range(rng.integers(1, 5)):
        at = rng.uniform(low + 0.4, high - 0.4)
        power = log_uniform(rng, 5, 60) * strength
        if indirect:
            # An uplight in a shallow trough below the ceiling.
            size, y = rng.uniform(0.1, 0.5), high[1] - rng.uniform(0.3, 0.6)
            corner = np.array([at[0] - size, y, at[2] - size])
            scene.mesh(meshes.quads([(corner, [0, 0, 2 * size], [2 * size, 0, 0])]), scene.radiance(4 * size ** 2, power))
            low_, high_ = corner - [0.02, 0.04, 0.02], corner + [2 * size + 0.02, -0.01, 2 * size + 0.02]
            scene.mesh(meshes.box(low_, high_), scene.palette.bsdf(OPAQUE))
        elif rng.random() < 0.2:
            intensity = power / (4 * np.pi) * np.array([1.1, 1, 0.85])
            position = '<point name="position" x="%.4g" y="%.4g" z="%.4g"/>' % tuple(at)
            if rng.random() < 0.5:
                scene.elements.append(f'<emitter type="point">{position}{rgb("intensity", intensity)}</emitter>')
            else:
                aim = '<lookat origin="%.4g, %.4g, %.4g" target="%.4g, %.4g, %.4g" up="0, 0, 1"/>' % (
                    *at, *rng.uniform(low, high) * [1, 0.3, 1])
                scene.elements.append(f'<emitter type="spot"><transform name="to_world">{aim}</transform>'
                                      f'{rgb("intensity", 6 * intensity)}{number("cutoff_angle", rng.uniform(15, 60))}'
                                      '</emitter>')
        elif rng.random() < 0.6:
            half, y = rng.uniform(0.1, 0.6, 2), high[1] - rng.uniform(0.01, 0.5)
            corner = np.array([at[0] - half[0], y, at[2] - half[1]])
            scene.mesh(meshes.quads([(corner, [2 * half[0], 0, 0], [0, 0, 2 * half[1]])]),
                       scene.radiance(4 * half[0] * half[1], power))
        else:
            radius = rng.uniform(0.03, 0.15)
            scene.sphere(at, radius, scene.radiance(4 * np.pi * radius ** 2, power))
            scene.taken.append((at[[0, 2]], np.full(2, radius)))
        if rng.random() < 0.1:
            spot = at + rng.uniform(-0.5, 0.5, 3)
            scene.sphere([spot[0], rng.uniform(0.2, 1.2), spot[2]], rng.uniform(0.08, 0.3),
                         f'<bsdf type="dielectric">{number("int_ior", 1.5)}</bsdf>')


def room(scene, models):
    """A furnished room, sometimes with a window or with a second room behind an ajar door. Returns the camera's bounds."""
    rng = scene.rng
    size = np.array([rng.uniform(3, 8), rng.uniform(2.4, 3.5), rng.uniform(3, 8)])
    low, high = np.array([-size[0] / 2, 0, -size[2] / 2]), np.array([size[0] / 2, size[1], size[2] / 2])
    window, second, indirect = rng.random() < 0.35, rng.random() < 0.4, rng.random() < 0.15
    door = None
    if second:
        left = rng.uniform(0.2, size[2] - 1.2)
        door = (left, left + 0.9, 0, 2.05)
    hole = None
    if window:
        left, bottom = rng.uniform(0.2, size[0] / 2 - 0.3), rng.uniform(0.0, 1.0)
        hole = (left, rng.uniform(left + 0.5, size[0] - 0.2), bottom, rng.uniform(bottom + 0.6, size[1] - 0.1))
    walls = scene.palette.bsdf(OPAQUE) if rng.random() < 0.5 else None
    bsdf = lambda: walls or scene.palette.bsdf(OPAQUE)
    wall(scene, low, [1, 0, 0], size[0], size[1], hole, bsdf())
    wall(scene, [low[0], 0, high[2]], [1, 0, 0], size[0], size[1], None, bsdf())
    wall(scene, low, [0, 0, 1], size[2], size[1], None, bsdf())
    wall(scene, [high[0], 0, low[2]], [0, 0, 1], size[2], size[1], door, bsdf())
    scene.mesh(meshes.quads([(low, [0, 0, size[2]], [size[0], 0, 0])]), scene.palette.bsdf(OPAQUE))
    ceiling = scene.palette.bsdf({"diffuse": 1}) if rng.random() < 0.8 else bsdf()
    scene.mesh(meshes.quads([([low[0], high[1], low[2]], [size[0], 0, 0], [0, 0, size[2]])]), ceiling)
    behind = second and rng.random() < 0.4
    if second:
        depth = rng.uniform(2, 4)
        low2, high2 = np.array([high[0] + 0.1, 0, low[2]]), np.array([high[0] + 0.1 + depth, high[1], high[2]])
        shell = meshes.box(low2, high2)
        # The box's side towards the first room is left out: quads of a box come in pairs of triangles, x low first.
        scene.mesh(shell[2:], bsdf())
        frame = [([high[0], 0, low[2] + edge], [0.1, 0, 0], [0, door[3], 0]) for edge in door[:2]]
        frame.append(([high[0], door[3], low[2] + door[0]], [0.1, 0, 0], [0, 0, 0.9]))
        scene.mesh(meshes.quads(frame), bsdf())
        wall(scene, [high[0] + 0.1, 0, low[2]], [0, 0, 1], size[2], size[1], door, bsdf())
        leaf = meshes.box([-0.04, 0.01, 0], [0, 2.03, 0.88])
        scene.mesh(meshes.moved(leaf, -rng.uniform(0.1, 1.5), (high[0], 0, low[2] + door[0])), scene.palette.bsdf(OPAQUE))
        lamps(scene, low2, high2, 2.0 if behind else 1.0, False)
    if window:
        scene.environment(log_uniform(rng, 0.5, 8))
    strength = log_uniform(rng, 0.3, 3)
    if not behind and not (window and rng.random() < 0.5):
        lamps(scene, low, high, strength, indirect)
    furnish(scene, models, low, high, int(rng.integers(8, 26)))
    for _ in range(int(rng.integers(0, 13)) if rng.random() < 0.5 else 0):
        scene.primitive(rng.uniform(low + 0.3, high - 0.3) * [1, 0.2, 1], rng.uniform(0.05, 0.3))
    return low + [0.15, 0.6, 0.15], np.array([high[0] - 0.15, min(2.2, high[1] - 0.2), high[2] - 0.15])


def outdoors(scene, models):
    """Models on a plane under an environment."""
    rng = scene.rng
    scene.mesh(meshes.quads([([-40, 0, -40], [0, 0, 80], [80, 0, 0])]), scene.palette.bsdf(OPAQUE))
    scene.environment(log_uniform(rng, 0.5, 4))
    if rng.random() < 0.3:
        down = rng.uniform([-1, -1, -1], [1, -0.3, 1])
        scene.elements.append('<emitter type="directional"><vector name="direction" x="%.4g" y="%.4g" z="%.4g"/>%s</emitter>'
                              % (*down, rgb("irradiance", np.array([1.1, 1, 0.9]) * rng.uniform(1, 8))))
    low, high = np.array([-4.0, 0, -4]), np.array([4.0, 3, 4])
    furnish(scene, models, low, high, int(rng.integers(6, 20)))
    return np.array([-6, 0.5, -6]), np.array([6, 2.5, 6])


def abstract(scene, models):
    """Shapes and models of any size in the air, lit by an environment, lamps or both."""
    rng = scene.rng
    if rng.random() < 0.5:
        scene.mesh(meshes.quads([([-4, -1, -4], [0, 0, 8], [8, 0, 0])]), scene.palette.bsdf(OPAQUE))
    for _ in range(rng.integers(10, 40)):
        scene.primitive(rng.normal(0, 1.1, 3), log_uniform(rng, 0.05, 0.6))
        scene.interesting.append(rng.normal(0, 0.5, 3))
    for _ in range(rng.integers(0, 6)):
        row = models[rng.integers(len(models))]
        scene.model(row, rng.normal(0, 1, 3), rng.uniform(0, 360), log_uniform(rng, 0.5, 2) / max(row["size"]))
    if rng.random() < 0.7:
        scene.environment(log_uniform(rng, 0.3, 3))
    else:
        scene.elements.append('<emitter type="constant">%s</emitter>' % rgb("radiance", np.full(3, 0.05)))
        lamps(scene, np.full(3, -2.0), np.full(3, 2.5), 1.0, False)
    return np.full(3, -3.0), np.full(3, 3.0)


def sensor(scene, low, high):
    """A camera within bounds, off the furniture, that looks at something."""
    rng = scene.rng
    target = scene.interesting[rng.integers(len(scene.interesting))] if scene.interesting else (low + high) / 2
    for _ in range(50):
        eye = rng.uniform(low, high)
        distance = np.linalg.norm(target - eye)
        if distance > 0.8 and scene.free(eye[[0, 2]], np.full(2, 0.1)):
            break
    target = target + rng.normal(0, 0.1, 3) * distance
    aim = '<lookat origin="%.5g, %.5g, %.5g" target="%.5g, %.5g, %.5g" up="0, 1, 0"/>' % (*eye, *target)
    lens = rng.random() < 0.15
    inside = (number("aperture_radius", log_uniform(rng, 0.005, 0.04)) + number("focus_distance", distance)) if lens else ""
    return (f'<sensor type="{"thinlens" if lens else "perspective"}">{number("fov", rng.uniform(35, 90))}{inside}'
            f'<transform name="to_world">{aim}</transform><film type="hdrfilm"><integer name="width" value="256"/>'
            '<integer name="height" value="256"/><rfilter type="box"/></film></sensor>')


def draw(seed, models_folder, models, folder):
    """Writes the scene of a seed."""
    rng = np.random.default_rng(seed)
    scene = Scene(rng, models_folder, folder)
    bounds = {"room": room, "outdoors": outdoors, "abstract": abstract}[choose(rng, KINDS)](scene, models)
    depth = int(rng.choice([5, 8, 17, 65]))
    head = [f'<integrator type="path"><integer name="max_depth" value="{depth}"/></integrator>', sensor(scene, *bounds)]
    with open(os.path.join(folder, "scene.xml"), "w") as file:
        file.write("\n".join(['<scene version="3.0.0">', *head, *scene.elements, "</scene>", ""]))


def complaint(fluxion, path):
    """What speaks against a scene, by a glance at it; None if nothing does."""
    with tempfile.TemporaryDirectory() as scratch:
        layers = os.path.join(scratch, "layers.exr")
        done = subprocess.run([fluxion, "render", path, "-o", os.path.join(scratch, "o.exr"), "--layers", layers, "--size",
                               "64x64", "--spp", "8", "--method", "rdfc", "-q"], capture_output=True, text=True)
        if done.returncode != 0:
            raise SystemExit(f"{path}: {done.stderr}")
        found = exr.everything(layers)
    radiance = found["R"] + found["G"] + found["B"]
    depth = found["depth"] if "depth" in found else found["depth.Z"]
    normals = np.stack([found[name] for name in found if name.lower().startswith("normal") and "var" not in name.lower()], -1)
    facing = np.unique(np.round(normals.reshape(len(depth) ** 2, -1) * 8), axis=0, return_counts=True)[1].max()
    if (radiance < 0.02 * radiance.mean()).mean() > 0.4:
        return "dark"
    if np.median(depth[depth > 0]) < 0.4 if (depth > 0).any() else True:
        return "something before the lens"
    if facing > 0.7 * depth.size:
        return "one surface"
    return None


def main(options):
    with open(os.path.join(options.models, "models.json")) as file:
        models = json.load(file)
    for number_ in range(options.first, options.first + options.count):
        folder = os.path.join(options.folder, "%06d" % number_)
        if os.path.exists(os.path.join(folder, "scene.xml")):
            continue
        for attempt in range(ATTEMPTS):
            part = folder + ".part"
            shutil.rmtree(part, ignore_errors=True)
            os.makedirs(part)
            draw([number_, attempt], os.path.abspath(options.models), models, os.path.abspath(part))
            against = complaint(options.fluxion, os.path.join(part, "scene.xml"))
            print("%06d" % number_, against or "kept", flush=True)
            if against is None:
                os.rename(part, folder)
                break
        else:
            raise SystemExit(f"{folder}: {ATTEMPTS} scenes were turned down")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models")
    parser.add_argument("folder")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=1)
    parser.add_argument("--fluxion", default="target/release/fluxion")
    main(parser.parse_args())
