"""Frames of `fluxion dataset`, as a training loop takes them."""
import glob
import json
import os

import numpy as np
import torch

# Least typical luminance, and regularisation of relMSE.
DARK, EPSILON = 1e-18, 0.01
# Networks are not told of more samples than they were trained with.
TRAINED_SAMPLES = 64
# Endings of the names of intermediate images.
INNER = ("_denoised", "_level0_enhanced")


def typical_luminance(colour):
    """Geometric mean in which dark pixels count as a thousandth of the mean, as src/reconstruct/inputs.rs has it."""
    luminance = np.maximum(colour.mean(-1, dtype=np.float64), 0)
    mean = luminance.mean()
    return max(float(np.exp(np.log(luminance + 1e-3 * mean).mean())), DARK) if mean > 0 else 1.0


def planes(array):
    """An image as PyTorch takes it, channels first."""
    return torch.from_numpy(np.ascontiguousarray(np.moveaxis(array, -1, 0)))


class Frame:
    """A frame at one number of samples; radiance in units of its typical luminance, without directly seen emitters."""

    def __init__(self, folder, manifest, spp):
        self.name, self.spp = manifest["name"], spp
        path = os.path.join(folder, "%s_%04dspp.npy" % (self.name, spp))
        self.array, self.columns = np.load(path).astype(np.float32), manifest["channels"]
        if self.array.shape[-1] != len(self.columns):
            raise SystemExit(f"{path}: the array has other channels than its manifest names: render the frame again")
        target = np.load(os.path.join(folder, self.name + "_ref.npy")).astype(np.float32)
        self.scale = 1 / typical_luminance(self.get("", "RGB"))
        self.direct = self.radiance("direct")
        # Samples may not have met light that the target has; both halves of it are kept for errors without their noise.
        self.target = target[..., :3] * self.scale - self.direct
        self.difference = target[..., 3:6] * self.scale
        self.floor = manifest["floor"]

    def told_samples(self):
        """What networks are told of the number of samples, as src/reconstruct/inputs.rs has it."""
        return np.log2(min(self.spp, TRAINED_SAMPLES)) / 4

    def get(self, name, channels):
        prefix = name + "." if name else ""
        return self.array[..., [self.columns.index(prefix + c) for c in channels]]

    def radiance(self, name):
        return self.get(name, "RGB") * self.scale

    def image(self, method):
        """A method's image, or the sampled colours; intermediate images are without directly seen emitters already."""
        inner = not method or method.endswith(INNER)
        return self.radiance(method) - (0 if inner else self.direct)

    def rel_mse(self, image):
        """relMSE against the target, the target's own noise taken off."""
        whole = self.target + self.direct
        noise = 0.25 * self.difference ** 2
        scale = 1 / self.scale
        error = (image - self.target) ** 2 - noise
        return float((error * scale ** 2 / ((whole * scale) ** 2 + EPSILON)).mean())

    def comparable(self, errors, base):
        """Errors of images in units of one of them and of the target's noise, so that of many frames none decides their mean."""
        return np.array(errors) / (abs(base) + 2 * self.floor)


def holds(rows, columns, made, others):
    """Prints the means of `rows`, lists of errors by sample count, with the column `made` over the least of the columns `others`. True if
    that is below one at every sample count."""
    print("| spp | frames | " + " | ".join(columns) + " | ratio |\n" + "|---" * (len(columns) + 3) + "|")
    good = bool(rows)
    for spp in sorted(rows):
        means = dict(zip(columns, np.mean(rows[spp], 0)))
        ratio = means[made] / min(means[other] for other in others)
        good &= ratio < 1
        print("| %d | %d | %s | %.2f |" % (spp, len(rows[spp]), " | ".join("%.3f" % mean for mean in means.values()), ratio), flush=True)
    return bool(good)


def manifest(folder, name):
    with open(os.path.join(folder, name + ".json")) as file:
        return json.load(file)


def names(folder):
    """Names of the frames in a folder, with their sample counts."""
    found = sorted(os.path.basename(path)[:-5] for path in glob.glob(os.path.join(folder, "*.json")))
    return [(name, manifest(folder, name)["recipe"]["spp"]) for name in found]


def load(folders):
    """All frames of some folders, in the order of names and sample counts."""
    made = [Frame(folder, manifest(folder, name), spp) for folder in folders for name, spps in names(folder) for spp in spps]
    return sorted(made, key=lambda frame: (frame.name, frame.spp))
