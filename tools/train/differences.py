"""The second network of the method `net`: corrects the image of frgr, and is shown sampled differences.

    python tools/train/differences.py train FRAMES... --run runs/differences
    python tools/train/differences.py test FRAMES... --run runs/differences
    python tools/train/differences.py export FRAMES... --run runs/differences

FRAMES are folders of `fluxion dataset --layers features,gradients --method frgr --notes --target l2`; ten of every hundred scenes are kept
apart for tests. `export` writes src/reconstruct/net/differences.safetensors if the gate holds: on the scenes kept apart less error than
frgr at every sample count.
"""
import json
import os

import numpy as np
import torch
from safetensors.torch import save_file

import crops
import encoders
import frames
import net
import runs
from encoders import DEVICE, NOISE, SAMPLED, GradNet, compress, decompress, fit, given
from frames import planes

IMAGES = {"frgr": "frgr", "denoised": "frgr_denoised", "enhanced": "frgr_level0_enhanced"}
LAYOUT = SAMPLED | NOISE | {"claimed": 1, "target": 3} | {name: 3 for name in IMAGES}
INPUTS = (3 * (len(IMAGES) + 1) + 7 + 3, 8)
CROP, BATCH, RATE, STEPS, LONGEST = 128, 16, 1e-3, 17000, 1.0


def network():
    """At first it leaves the image of frgr as it is."""
    made = GradNet(INPUTS)
    torch.nn.init.zeros_(made.out.weight)
    torch.nn.init.zeros_(made.out.bias)
    return made


def inputs_of(parts):
    return given(parts, images=[*IMAGES, "colour"])


def moved(image, output):
    return decompress(compress(image) + output)


def prepared(frame):
    """A frame as one tensor, or none if a value is not finite."""
    claimed = planes(frame.radiance("frgr_sigma")) ** 2 - planes(frame.radiance("direct_sigma")) ** 2
    parts = encoders.sampled(frame) | {name: planes(frame.image(image)) for name, image in IMAGES.items()}
    parts["claimed"] = compress(claimed.clamp(min=0).mean(0, keepdim=True).sqrt())
    return encoders.whole(parts, LAYOUT)


def load(folders, apart):
    """Prepared frames with their frames, of the scenes kept apart or of the others."""
    everything = [frame for frame in frames.load(folders) if runs.is_apart(frame.name) == apart]
    made = [(prepared(frame), frame) for frame in everything]
    return [(whole, frame) for whole, frame in made if whole is not None]


def train(options):
    training = [whole.to(DEVICE) for whole, _ in load(options.frames, False)]
    print(f"{len(training)} images to train on", flush=True)
    torch.manual_seed(options.seed)
    made = network().to(DEVICE, memory_format=torch.channels_last)

    def loss(rng):
        batch = crops.batch(training, LAYOUT, rng, CROP, BATCH)
        return sum(fit(moved(batch["frgr"], made(*inputs_of(batch))), batch["target"]))

    runs.descend(made, loss, RATE, options, longest=LONGEST, factors=runs.cosine(options.steps))


def compared(made, apart):
    """Errors on the scenes kept apart, the targets' noise taken off: of frgr, of this network, of the other one, and of the mean of both,
    as a table of means over the frames, each in units of frgr's. True if this network's are less than frgr's at every sample count."""
    rows, other = {}, net.shipped()
    for whole, frame in apart:
        parts = crops.split(whole.float(), LAYOUT)
        own = moved(parts["frgr"], encoders.padded(made, *inputs_of(parts))).clamp(min=0)
        images = torch.stack([planes(frame.image(name)) for name in net.IMAGES])
        beside = net.solved(other, net.features(frame, images), images, net.variance_of(frame), frame.spp)
        last = lambda image: np.moveaxis(image.numpy(), 0, -1)
        errors = [frame.rel_mse(last(image)) for image in (parts["frgr"], own, beside, 0.5 * (own + beside))]
        rows.setdefault(frame.spp, []).append(frame.comparable(errors, errors[0]))
    return frames.holds(rows, ["frgr", "differences", "images", "mean of both"], "differences", ["frgr"])


def test(options):
    compared(runs.trained(network(), options)[0], load(options.frames, True))


def export(options):
    """Writes half floats, and for the tests what the network makes of them on one crop."""
    (made, steps), apart = runs.trained(network(), options), load(options.frames, True)
    if not compared(made, apart):
        raise SystemExit("not exported: frgr is better")
    made = made.half().float()
    recipe = {"images": list(IMAGES), "steps": steps, "batch": BATCH, "crop": CROP, "rate": RATE, "seed": options.seed}
    save_file({name: value.half().contiguous() for name, value in made.state_dict().items()},
              os.path.join(net.TOP, "src/reconstruct/net/differences.safetensors"), {"recipe": json.dumps(recipe)})
    parts = crops.split(apart[0][0][:, :16, :24].float(), LAYOUT)
    vectors = dict(zip(("data", "gradient"), inputs_of(parts))) | {"image": parts["frgr"]}
    vectors["output"] = moved(parts["frgr"], encoders.padded(made, vectors["data"], vectors["gradient"])).clamp(min=0)
    save_file({name: value.permute(1, 2, 0).contiguous() for name, value in vectors.items()},
              os.path.join(net.TOP, "tests/data/net-differences.safetensors"))


if __name__ == "__main__":
    runs.command(__doc__, STEPS, train=train, test=test, export=export)
