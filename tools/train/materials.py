"""Random materials and textures of training scenes, as elements of Mitsuba's files."""
import os

import numpy as np

import meshes

CONDUCTORS = ["Cu", "Au", "Al", "Ag", "Cr", "W"]
# Odds of materials; the rest are changed surfaces: blends, masks, bumps and normal maps over one of these.
ODDS = {"diffuse": 35, "plastic": 8, "roughplastic": 12, "principled": 15, "roughconductor": 10, "conductor": 5,
        "dielectric": 5, "roughdielectric": 3, "changed": 7}
# Walls, floors and most furniture transmit no light.
OPAQUE = {name: odds for name, odds in ODDS.items() if not name.endswith("dielectric")}


def choose(rng, odds):
    names = list(odds)
    weights = np.array([odds[name] for name in names], float)
    return names[rng.choice(len(names), p=weights / weights.sum())]


def log_uniform(rng, low, high):
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def rgb(name, values):
    return '<rgb name="%s" value="%s"/>' % (name, ", ".join("%.4g" % value for value in values))


def number(name, value):
    return '<float name="%s" value="%.5g"/>' % (name, value)


def colour(rng):
    """Reflectance of a surface, up to 0.9; a third of them are grey or white."""
    value = rng.uniform(0.05, 0.9)
    if rng.random() < 0.35:
        return np.full(3, value)
    hue = rng.random(3)
    hue = (hue - hue.min()) / max(np.ptp(hue), 1e-3)
    return np.clip(value * (1 - rng.uniform(0.1, 0.9) * (1 - hue)), 0.01, 0.9)


def value_noise(rng, size, cells, octaves=4):
    """Noise from 0 to 1 that repeats."""
    made, total = np.zeros((size, size)), 0.0
    for octave in range(octaves):
        n = min(cells << octave, size)
        grid = rng.random((n, n))
        at = np.arange(size) * n / size
        k, t = at.astype(int) % n, at % 1
        t = t * t * (3 - 2 * t)
        rows = grid[k] * (1 - t)[:, None] + grid[(k + 1) % n] * t[:, None]
        made += 0.5 ** octave * (rows[:, k] * (1 - t) + rows[:, (k + 1) % n] * t)
        total += 0.5 ** octave
    return made / total


def pattern(rng, size=256):
    """Values from 0 to 1 of a pattern that repeats: bricks, planks, tiles, stripes, checkers, noise, or lines of marks."""
    y, x = np.mgrid[0:size, 0:size] / size
    kind = rng.integers(7)
    n = int(2 ** rng.integers(1, 5))
    if kind in (0, 1):
        rows = np.floor(y * 2 * n)
        across = x * n * (1 if kind == 0 else 0.5) + rng.random(2 * n)[rows.astype(int)] * (kind == 1) + 0.5 * (rows % 2)
        joint = (np.abs(across % 1 - 0.5) > 0.5 - 0.03 * (2 - kind)) | (np.abs(y * 2 * n % 1 - 0.5) > 0.44)
        shade = rng.random((64, 64))[(np.floor(across) % 64).astype(int), (rows % 64).astype(int)]
        return np.where(joint, 0.0, 0.4 + 0.6 * shade)
    if kind == 2:
        return np.where((np.abs(x * n % 1 - 0.5) > 0.47) | (np.abs(y * n % 1 - 0.5) > 0.47), 0.0, 0.8)
    if kind == 3:
        return (x * n % 1 < rng.uniform(0.1, 0.9)).astype(float)
    if kind == 4:
        return ((np.floor(x * n) + np.floor(y * n)) % 2).astype(float)
    if kind == 5:
        return value_noise(rng, size, n)
    # Rows of dark marks on a light ground, like print.
    rows, marks = 4 * n, rng.random((size, size)) < 0.5
    marks = marks[:, :: max(size // 128, 1)].repeat(max(size // 128, 1), 1)[:, :size]
    return np.where((y * rows % 1 < 0.6) & marks & (value_noise(rng, size, 2 * n, 1) > 0.35), 0.05, 0.95)


class Palette:
    """Materials of one scene; their images are written into the scene's folder."""

    def __init__(self, rng, folder):
        self.rng, self.folder, self.images = rng, folder, 0

    def image(self, values):
        name = f"texture{self.images}.png"
        self.images += 1
        meshes.write_png(os.path.join(self.folder, name), values)
        return name

    def bitmap(self, name, file, scale=1.0, raw=False):
        to_uv = '<transform name="to_uv"><scale x="%.4g" y="%.4g"/></transform>' % (scale, scale)
        return ('<texture name="%s" type="bitmap"><string name="filename" value="%s"/>%s%s</texture>'
                % (name, file, '<boolean name="raw" value="true"/>' if raw else "", to_uv))

    def reflectance(self, name, image=None):
        """A colour, or in six of ten cases an image."""
        rng = self.rng
        if image:
            return self.bitmap(name, image)
        if rng.random() < 0.4:
            return rgb(name, colour(rng))
        low, high = colour(rng) ** 0.45, colour(rng) ** 0.45
        values = pattern(rng)[..., None]
        return self.bitmap(name, self.image(low + (high - low) * values), log_uniform(rng, 0.2, 4.0))

    def roughness(self, name):
        rng = self.rng
        alpha = log_uniform(rng, 0.02, 0.5)
        if rng.random() < 0.2:
            values = np.repeat((alpha * (0.4 + 0.6 * pattern(rng)))[..., None], 3, 2)
            return self.bitmap(name, self.image(values), log_uniform(rng, 0.2, 4.0), raw=True)
        return number(name, alpha)

    def bsdf(self, odds=ODDS, image=None, depth=0):
        """An element, two-sided unless it transmits light."""
        rng = self.rng
        kind = choose(rng, odds if depth == 0 else {k: v for k, v in odds.items() if k != "changed"})
        if kind == "changed":
            return self.changed(odds, image)
        ggx = '<string name="distribution" value="%s"/>' % ("ggx" if rng.random() < 0.7 else "beckmann")
        metal = '<string name="material" value="%s"/>' % CONDUCTORS[rng.integers(len(CONDUCTORS))]
        ior = number("int_ior", rng.uniform(1.3, 1.8))
        inside = {
            "diffuse": lambda: self.reflectance("reflectance", image),
            "plastic": lambda: self.reflectance("diffuse_reflectance", image) + ior,
            "roughplastic": lambda: self.reflectance("diffuse_reflectance", image) + ior
            + number("alpha", log_uniform(rng, 0.03, 0.4)) + ggx,
            "conductor": lambda: metal,
            "roughconductor": lambda: metal + self.roughness("alpha") + ggx,
            "dielectric": lambda: ior,
            "roughdielectric": lambda: ior + number("alpha", log_uniform(rng, 0.03, 0.4)) + ggx,
            "principled": lambda: self.reflectance("base_color", image) + self.roughness("roughness")
            + number("metallic", rng.random() ** 3) + number("specular", rng.uniform(0.2, 0.8))
            + (number("clearcoat", rng.random()) if rng.random() < 0.3 else "")
            + (number("sheen", rng.random()) if rng.random() < 0.2 else ""),
        }[kind]()
        element = f'<bsdf type="{kind}">{inside}</bsdf>'
        return element if kind.endswith("dielectric") else f'<bsdf type="twosided">{element}</bsdf>'

    def changed(self, odds, image):
        """A blend, a mask, a bump map or a normal map over other materials."""
        rng = self.rng
        nested = lambda: self.bsdf({k: v for k, v in OPAQUE.items() if k in odds}, image, 1)
        kind = rng.integers(4)
        if kind == 0:
            weight = self.bitmap("weight", self.image(np.repeat(pattern(rng)[..., None], 3, 2)), raw=True)
            return f'<bsdf type="blendbsdf">{weight}{nested()}{nested()}</bsdf>'
        if kind == 1:
            opacity = self.bitmap("opacity", self.image(np.repeat(pattern(rng)[..., None] > 0.3, 3, 2)), raw=True)
            return f'<bsdf type="mask">{opacity}{nested()}</bsdf>'
        heights = pattern(rng)
        scale = log_uniform(rng, 0.5, 4.0)
        if kind == 2:
            bumps = self.bitmap("arbitrary", self.image(np.repeat(heights[..., None], 3, 2)), scale, raw=True)
            return f'<bsdf type="bumpmap">{bumps}{number("scale", log_uniform(rng, 0.003, 0.03))}{nested()}</bsdf>'
        slope = np.stack([np.roll(heights, 1, axis) - np.roll(heights, -1, axis) for axis in (1, 0)], -1)
        normal = np.concatenate([slope * rng.uniform(0.3, 1.5), np.ones(heights.shape + (1,))], -1)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        bumps = self.bitmap("normalmap", self.image(0.5 + 0.5 * normal), scale, raw=True)
        return f'<bsdf type="normalmap">{bumps}{nested()}</bsdf>'
