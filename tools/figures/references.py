"""References of the scenes of figures/scenes.toml.

A reference is the mean of two halves with seeds of their own, NAME.exr; half of their difference, squared, is the variance of that mean,
NAME_var.exr, as `fluxion bench` takes it. Each half is one render that is continued from its checkpoint, by path tracing or with differences,
whichever has less error for its time on the scene.

With differences, a half is a mean of its path-traced image and of the linear screened Poisson solution `l2`, which spreads the noise of bright
outlines over what is beside them. The weights of each half come from the other one, which is independent of it. So everything is
unbiased; nothing is denoised.
"""
import json
import os
import tempfile
import time

import numpy as np

import exr
import program
import scenes

# Far from the seeds of what is judged.
SEEDS = (977001, 977002)
METHODS = ("primal", "l2")
FIRST = 64
# Exit code of a render that a signal has stopped; its samples are saved.
STOPPED = 75


class Reference:
    """The state of a scene's reference, in a folder."""

    def __init__(self, scene, folder):
        self.scene, self.folder = scene, folder
        self.state = {}
        if os.path.exists(self.at(".json")):
            with open(self.at(".json")) as file:
                self.state = json.load(file)

    def at(self, end):
        return os.path.join(self.folder, self.scene.name + end)

    @property
    def seconds(self):
        return self.state.get("seconds", 0.0)

    @property
    def floor(self):
        return self.state.get("floor", float("inf"))

    def go_on(self):
        """Twice the samples."""
        if not self.state:
            self.begin()
            return
        method, spp = self.state["method"], 2 * self.state["spp"]
        self.save(method, spp, *self.halves(method, spp))

    def begin(self):
        """Chooses the method, by its squared error times its seconds."""
        tried = {method: self.halves(method, FIRST) for method in METHODS}
        best = min(METHODS, key=lambda method: floor(*tried[method][0]) * tried[method][1])
        for method in METHODS:
            if method != best:
                for seed in SEEDS:
                    os.remove(self.at(f"-{method}-{seed}.ckpt"))
        self.save(best, FIRST, *tried[best])

    def halves(self, method, spp):
        """Both images, and the seconds of all their samples."""
        images, seconds = zip(*(self.half(method, spp, seed) for seed in SEEDS))
        if method != "primal":
            first, second = (Half(image, self.layers(method, seed)) for image, seed in zip(images, SEEDS))
            images = first.mixed_by(second), second.mixed_by(first)
        return images, sum(seconds)

    def layers(self, method, seed):
        """What a half has sampled."""
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "layers.exr")
            program.call("merge", self.at(f"-{method}-{seed}.ckpt"), "-o", file, "-q")
            return exr.everything(file)

    def half(self, method, spp, seed):
        """Continues a half: its image, and the seconds of its samples."""
        checkpoint = self.at(f"-{method}-{seed}.ckpt")
        with tempfile.TemporaryDirectory() as folder:
            image, stats = (os.path.join(folder, name) for name in ("image.exr", "stats.json"))
            code, _, messages = program.finished(
                "render", self.scene.path, "-o", image, "--json", stats, "--size", self.scene.size, "--method", method, "--spp", spp,
                "--seed", seed, "--checkpoint", checkpoint, "--resume", "-q")
            if code == STOPPED:
                raise KeyboardInterrupt
            if code != 0:
                raise program.Failed(messages)
            with open(stats) as file:
                return exr.rgb(image), json.load(file)["seconds"]["render"]

    def save(self, method, spp, images, seconds):
        first, second = images
        exr.write(self.at(".exr"), (first + second) / 2)
        exr.write(self.at("_var.exr"), (first - second) ** 2 / 4)
        self.state = {"method": method, "spp": spp, "seconds": seconds, "floor": floor(first, second)}
        with open(self.at(".json.part"), "w") as file:
            json.dump(self.state, file)
        os.replace(self.at(".json.part"), self.at(".json"))


class Half:
    """The image of a method, and what was sampled for it."""

    def __init__(self, image, layers):
        rgb = lambda prefix: np.stack([layers[prefix + channel] for channel in "RGB"], -1)
        self.image, self.sampled = image, rgb("") + rgb("direct.")
        self.variance = rgb("variance.") + rgb("direct_variance.")

    def solution_share(self):
        """Weights by the variance of the sampled colours and the solution's squared distance from them, in 3x3 pixels. Both are
        unbiased, so what the distance has beyond that variance is the solution's own; below twice of it nothing is known."""
        relative = lambda values: around((values / (self.image ** 2 + 0.01)).mean(-1))
        variance = relative(self.variance)
        own = relative((self.image - self.sampled) ** 2) - variance
        return np.minimum(1, variance / np.maximum(own, 1e-20))[..., None]

    def mixed_by(self, other):
        """Solution and sampled colours, by shares that are independent of both."""
        share = other.solution_share()
        return share * self.image + (1 - share) * self.sampled


def around(values):
    """Means over 3x3 pixels; at the border those of the pixels that are there."""
    padded = np.pad(values, 1, mode="edge")
    height, width = values.shape
    return sum(padded[y:y + height, x:x + width] for y in range(3) for x in range(3)) / 9


def floor(first, second):
    """relMSE of the mean of two halves against the truth."""
    mean = (first + second) / 2
    return float(((first - second) ** 2 / 4 / (mean ** 2 + 0.01)).mean())


def make(public, folder, hours):
    """Continues the reference that has the most noise for the time that it has had, until all are good or the hours are over."""
    os.makedirs(folder, exist_ok=True)
    target = scenes.floor()
    references = [Reference(scene, folder) for scene in scenes.load(public)]
    end = time.monotonic() + 3600 * hours
    while time.monotonic() < end:
        left = [reference for reference in references if reference.floor > target]
        if not left:
            break
        reference = max(left, key=lambda reference: reference.floor / max(reference.seconds, 1e-9))
        reference.go_on()
        print("%s: %s, %d samples in each half, %.0f s, floor %.1e" % (
            reference.scene.name, reference.state["method"], reference.state["spp"], reference.seconds, reference.floor), flush=True)
    for reference in references:
        if reference.floor > target:
            print("%s: floor %.1e, wanted %.1e: run this again" % (reference.scene.name, reference.floor, target))
