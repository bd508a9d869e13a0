"""Renders with Mitsuba, reconstructs with Fluxion, and prints the errors against a render of many samples.

    pip install fluxion-render mitsuba pyoidn
    python denoise_mitsuba.py [scene.xml]

Mitsuba renders the picture several times with different seeds: their mean is the noisy image, and how they differ is its
variance, which filters go by. Albedo and normals come from its integrator `aov`. The film needs a box filter: with wider ones
neighbouring pixels share their noise, and no filter can tell it from the picture.
"""

import sys

import fluxion
import mitsuba as mi
import numpy as np

RENDERS, SPP, REFERENCE = 8, 4, 1024

for variant in ("llvm_ad_rgb", "scalar_rgb"):
    try:
        mi.set_variant(variant)
        break
    except ImportError:
        print(f"Mitsuba's {variant} is not available here")


def scene():
    """The file on the command line, or Mitsuba's own Cornell box."""
    if len(sys.argv) > 1:
        return mi.load_file(sys.argv[1])
    box = mi.cornell_box()
    box["sensor"]["film"]["rfilter"] = {"type": "box"}
    return mi.load_dict(box)


picture = scene()
aov = mi.load_dict({"type": "aov", "aovs": "albedo:albedo,normal:sh_normal", "image": {"type": "path"}})
renders = [np.array(mi.render(picture, integrator=aov, spp=SPP, seed=seed)) for seed in range(RENDERS)]
features = np.mean([render[..., -6:] for render in renders], axis=0)
reference = np.array(mi.render(picture, spp=REFERENCE, seed=RENDERS))[..., :3]

frame = fluxion.Frame.from_renders(
    [render[..., :3] for render in renders], spp=SPP, albedo=features[..., :3], normal=features[..., 3:]
)
print(f"{'':10}{'relMSE':>10}{'SMAPE':>10}{'FLIP':>10}")
for method in ("primal", "nlm", "rdfc", "nfor", "oidn"):
    try:
        image = fluxion.reconstruct(frame, method).image
    except fluxion.FluxionError as error:
        print(f"{method:10}{error}")
        continue
    found = fluxion.compare(image, reference, ["relmse", "smape", "flip"])
    print(f"{method:10}{found['relmse']:10.5f}{found['smape']:10.5f}{found['flip']:10.5f}")
    fluxion.write_image(f"mitsuba_{method}.png", image)
