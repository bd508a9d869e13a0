"""Renders of Mitsuba 3, with a box filter, as those of Fluxion have one. Needs PyPI mitsuba, and LLVM for its LLVM variant."""
import glob
import os
import tempfile
import xml.etree.ElementTree as ET

import numpy as np


def mitsuba(variant):
    """The module, set to a variant. LLVM is found where Debian has it."""
    found = sorted(glob.glob("/usr/lib/*/libLLVM[-.]*so*"))
    if found:
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", found[-1])
    import mitsuba as mi

    mi.set_variant(variant)
    return mi


def load(variant, path, size, sampler=None):
    """The scene at another size, and with another sampler where one is named."""
    mi = mitsuba(variant)
    tree = ET.parse(path)
    for element in tree.getroot().iter("sampler") if sampler else ():
        element.set("type", sampler)
    for film in tree.getroot().iter("film"):
        for old in film.findall("rfilter"):
            film.remove(old)
        ET.SubElement(film, "rfilter", type="box")
        # A cropped film keeps the size of its window.
        cropped = any(element.get("name").startswith("crop_") for element in film.findall("integer"))
        for key, value in () if cropped else zip(("width", "height"), size):
            for old in film.findall("integer"):
                if old.get("name") == key:
                    old.set("value", str(value))
    with tempfile.NamedTemporaryFile("wb", suffix=".xml", delete=False) as file:
        tree.write(file)
    try:
        # Names in the file are relative to its folder.
        mi.file_resolver().prepend(os.path.dirname(os.path.abspath(path)))
        return mi.load_file(file.name)
    finally:
        os.unlink(file.name)


def render(variant, scene, spp, seed):
    return np.array(mitsuba(variant).render(scene, spp=spp, seed=seed), dtype=np.float64)[..., :3]


def mean_and_variance(path, size, spp, runs=8):
    """Of so many renders: their mean and its variance."""
    scene = load("llvm_ad_rgb", path, size)
    images = [render("llvm_ad_rgb", scene, spp, 10 + seed) for seed in range(runs)]
    return np.mean(images, 0), np.var(images, 0, ddof=1) / runs
