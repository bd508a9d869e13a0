"""Sampled differences less those of independent images: Student's t of every edge, over pairs of renders."""
import os

import numpy as np

import exr
import program
from scenes import ROOT

REFERENCES = False


def cells(run, where):
    return [[name] for name in run["scenes"]]


def measure(cell, run, where, folder):
    name, runs = cell[0], run["runs"]
    scene = os.path.join(ROOT, "scenes", "unit", name, "scene.xml")
    path = os.path.join(folder, "layers.exr")
    rgb = lambda channels, prefix: np.stack([channels[prefix + c] for c in "RGB"], -1)

    def layers(method, spp, seed):
        program.with_statistics("render", scene, "--layers", path, "-o", os.path.join(folder, "image.exr"), "--size", run["size"], "--spp", spp,
                                "--seed", seed, "--method", method)
        return exr.everything(path)

    errors, variances = {"dx": [], "dy": []}, []
    for k in range(runs):
        sampled, other = layers("l2", run["spp"], 2 * k), layers("primal", 2 * run["spp"], 2 * k + 1)
        for edge, axis in (("dx", 1), ("dy", 0)):
            inside = (slice(None), slice(0, -1)) if axis == 1 else (slice(0, -1),)
            both = lambda v, axis=axis: v[:, 1:] + v[:, :-1] if axis == 1 else v[1:] + v[:-1]
            errors[edge].append((rgb(sampled, edge + ".")[inside] - np.diff(rgb(other, ""), axis=axis)).ravel())
            variances.append((rgb(sampled, edge + "_variance.").sum(), both(rgb(sampled, "variance.")).sum()))
    t = []
    for values in map(np.array, errors.values()):
        deviation = values.std(0, ddof=1) / np.sqrt(runs)
        t.append(values.mean(0)[deviation > 0] / deviation[deviation > 0])
    t, (edges, colours) = np.concatenate(t), np.array(variances).sum(0)
    return [{"scene": name, "values": int(t.size), "mean": float(t.mean()), "spread": float(np.sqrt((t * t).mean())),
             "beyond": float(100 * (np.abs(t) > 4).mean()), "variance": float(edges / colours)}]
