"""The network of the method `net`: mixes the images of frgr, and adds a correction.

    python tools/train/net.py train FRAMES... --run runs/net
    python tools/train/net.py test FRAMES... --run runs/net
    python tools/train/net.py export FRAMES... --run runs/net

FRAMES are folders of `fluxion dataset --method frgr --notes`; ten of every hundred scenes are kept apart for tests. A U-Net gives every
pixel weights of the images and a correction in units of frgr's luminance. `export` writes src/reconstruct/net/net.safetensors if the
gate holds: on the scenes kept apart less error than frgr at every sample count.
"""
import json
import os

import numpy as np
import torch
from safetensors.torch import load_file, save_file
from torch.nn import functional as F

import frames
import residual
import runs
from frames import planes
from unet import UNet

# Images that are mixed, and the sampled colours, which are only looked at.
IMAGES = ["frgr", "frgr_denoised", "frgr_level0_enhanced", ""]
MIXED = len(IMAGES) - 1
TOP = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
WEIGHTS = os.path.join(TOP, "src/reconstruct/net/net.safetensors")
# Channels of the levels on the way down and up again.
DOWN, UP = [24, 32, 40, 48, 64], [48, 40, 32, 32]
INPUTS, OUTPUTS = 19, MIXED + 3
# Luminance below which differences count as absolute, in units of the typical luminance.
DARK = 0.1
# Radius of the window of frgr's image whose values bound the result, room beyond them, over its luminance, and number of samples
# up to which these bounds stay.
REACH, ROOM, FEW = 2, 0.5, 32
# Logit of frgr among the images before training.
START = 4.0
CROP, BATCH, RATE, STEPS = 96, 4, 1e-3, 16000
EPSILON, FLOOR = 0.03, 1e-4


class Network(UNet):
    """At first it leaves the image of frgr as it is."""

    def __init__(self):
        super().__init__(INPUTS, OUTPUTS, DOWN, UP)
        with torch.no_grad():
            self.out.weight.zero_()
            self.out.bias.zero_()
            self.out.bias[0] = START


def extreme(image, largest):
    """Largest or least values of windows; beyond the border the last pixels are repeated."""
    padded, side = F.pad(image, (REACH,) * 4, mode="replicate"), 2 * REACH + 1
    return F.max_pool2d(padded, side, 1) if largest else -F.max_pool2d(-padded, side, 1)


def corrected(logits, images, spp=1):
    """The image from the network's output and the images, (batch, images, 3, height, width). Bounds close in on frgr after FEW samples;
    training does without that."""
    base, share = images[:, 0], min(1, FEW / spp) ** 2
    luminance = base.mean(1, keepdim=True).clamp(min=0)
    mixed = (torch.softmax(logits[:, :MIXED], 1).unsqueeze(2) * images[:, :MIXED]).sum(1)
    free, room = mixed + (luminance + DARK) * logits[:, MIXED:], ROOM * (luminance + DARK)
    bound = lambda extreme, room: base + share ** 2 * (extreme - base) + share * room
    return free.maximum(bound(extreme(base, False), -room)).minimum(bound(extreme(base, True), room))


def variance_of(frame):
    return (planes(frame.radiance("sigma")) ** 2).mean(0, keepdim=True)


def features(frame, images):
    """What the network is given, (channels, height, width); src/reconstruct/net/features.rs computes the same."""
    base = images[0]
    luminance = base.mean(0, keepdim=True).clamp(min=0)
    unit = luminance + DARK
    relative = lambda square: 0.5 * torch.log(square.clamp(min=0) + 1e-7) - torch.log(unit)
    variance = variance_of(frame)
    claimed = planes(frame.radiance("frgr_sigma")) ** 2 - planes(frame.radiance("direct_sigma")) ** 2
    depth = planes(frame.get("depth", "Z")).clamp(min=0)
    others = [torch.asinh(3 * (image.mean(0, keepdim=True) - luminance) / unit) for image in images[1:]]
    sigma = lambda name, channels: planes(frame.get(name, channels)).mean(0, keepdim=True)
    return torch.cat([torch.log(base.clamp(min=0) + DARK), *others, relative(variance),
                      relative(claimed.clamp(min=0).mean(0, keepdim=True)), planes(frame.get("albedo", "RGB")),
                      planes(frame.get("normal", "XYZ")), depth / (depth + depth.mean() + 1e-9),
                      sigma("albedo_sigma", "RGB"), sigma("normal_sigma", "XYZ"), sigma("depth_sigma", "Z") / (depth + depth.mean() + 1e-9),
                      torch.full_like(unit, frame.told_samples())])


def samples(folders):
    """Training samples and those of the scenes kept apart."""
    everything = frames.load(folders)
    last = {frame.name: frame for frame in everything}
    clean = {name: frame.image("frgr").mean(-1) / frame.scale for name, frame in last.items()}
    made = []
    for frame in everything:
        images = torch.stack([planes(frame.image(name)) for name in IMAGES])
        target = planes(frame.target)
        # From other samples than the target's: noise in it would darken the image.
        divisor = torch.from_numpy(clean[frame.name] * frame.scale)[None] ** 2 + EPSILON
        noise = planes(0.25 * frame.difference ** 2)
        error = ((images[0] - target) ** 2 - noise) / divisor
        sample = {"images": images.half(), "features": features(frame, images).half(), "target": target, "divisor": divisor,
                  "error": error, "whole": error.mean().expand_as(error[:1]), "noise": noise / divisor, "variance": variance_of(frame),
                  "spp": frame.spp, "name": frame.name, "frame": frame}
        if not all(torch.isfinite(sample[key]).all() for key in ("images", "features", "target")):
            continue
        frame.array = None
        made.append(sample)
    return [s for s in made if not runs.is_apart(s["name"])], [s for s in made if runs.is_apart(s["name"])]


KEYS = ("images", "features", "target", "divisor", "error", "whole", "noise")


def crops(data, rng):
    """A batch of random crops, turned and mirrored, their colours and axes permuted, at random."""
    batch = {key: [] for key in KEYS}
    for _ in range(BATCH):
        sample = data[rng.integers(len(data))]
        height, width = sample["target"].shape[-2:]
        y, x = rng.integers(height - CROP + 1), rng.integers(width - CROP + 1)
        turns, mirrored = int(rng.integers(4)), rng.random() < 0.5
        colors, axes = (torch.from_numpy(rng.permutation(3)) for _ in range(2))
        for key, parts in batch.items():
            part = torch.rot90(sample[key][..., y:y + CROP, x:x + CROP].float(), turns, (-2, -1))
            part = part.flip(-1) if mirrored else part
            if key == "features":
                part = part.clone()
                part[0:3], part[8:11], part[11:14] = part[0:3][colors], part[8:11][colors], part[11:14][axes]
            elif part.shape[-3] == 3:
                part = part[..., colors, :, :]
            parts.append(part)
    return {key: torch.stack(parts) for key, parts in batch.items()}


def loss(net, batch):
    """Error less frgr's over frgr's, mean over the crops. It is linear in the squared error, so that the target's noise changes
    nothing in the mean; crops of which little can be told count less."""
    image = corrected(net(batch["features"]), batch["images"])
    error = ((image - batch["target"]) ** 2 - (batch["images"][:, 0] - batch["target"]) ** 2) / batch["divisor"]
    mean = lambda key: batch[key].mean((1, 2, 3))
    return (error.mean((1, 2, 3)) / (mean("error").maximum(0.25 * mean("whole")) + 0.2 * mean("noise") + FLOOR)).mean()


def shipped():
    """The network that was exported."""
    net = Network()
    net.load_state_dict({name: value.float() for name, value in load_file(WEIGHTS).items()})
    return net


def train(options):
    training, apart = samples(options.frames)
    print(f"{len(training)} images to train on, {len(apart)} apart", flush=True)
    torch.manual_seed(options.seed)
    net = Network().to(memory_format=torch.channels_last)
    runs.descend(net, lambda rng: loss(net, crops(training, rng)), RATE, options, longest=1.0)


def solved(net, features, images, variance, spp):
    """The result of the method, after the safety rule, channels first. `variance` is that of the colours, mean over the channels."""
    with torch.no_grad():
        image = corrected(net(features[None].float()), images[None].float(), spp)[0]
    colour, safe = images[-1].float(), images[0].float()
    trust = residual.trust(residual.box(variance, residual.RADIUS), residual.squared_error(colour, variance, image), spp)
    return safe + trust * (image - safe)


def compared(net, apart):
    """Errors on the scenes kept apart, the targets' noise taken off, as a table of means over the frames, each in units of frgr's. True if
    they are less than frgr's at every sample count."""
    rows = {}
    for sample in apart:
        image = solved(net, sample["features"], sample["images"], sample["variance"], sample["spp"])
        frame, last = sample["frame"], lambda planes: np.moveaxis(planes.float().numpy(), 0, -1)
        errors = [frame.rel_mse(last(sample["images"][0])), frame.rel_mse(last(image))]
        rows.setdefault(sample["spp"], []).append(frame.comparable(errors, errors[0]))
    return frames.holds(rows, ["frgr", "net"], "net", ["frgr"])


def test(options):
    compared(runs.trained(Network(), options)[0], samples(options.frames)[1])


def export(options):
    """Writes half floats, and for the tests what the network makes of them on one crop."""
    (net, steps), (training, apart) = runs.trained(Network(), options), samples(options.frames)
    net = net.half().float()
    if not compared(net, apart):
        raise SystemExit("not exported: frgr is better")
    recipe = {"images": IMAGES, "frames": len(training), "steps": steps, "batch": BATCH, "crop": CROP, "rate": RATE, "seed": options.seed}
    save_file({name: value.half().contiguous() for name, value in net.state_dict().items()},
              WEIGHTS, {"recipe": json.dumps(recipe)})
    part = lambda key: apart[0][key][..., :32, :48].float()
    with torch.no_grad():
        logits = net(part("features")[None])
        made = corrected(logits, part("images")[None], 2 * FEW)[0]
    pixels = lambda planes: planes.permute(1, 2, 0).contiguous()
    save_file({"features": pixels(part("features")), "images": pixels(part("images").flatten(0, 1)), "logits": pixels(logits[0]),
               "output": pixels(made)}, os.path.join(TOP, "tests/data/net.safetensors"))


if __name__ == "__main__":
    runs.command(__doc__, STEPS, train=train, test=test, export=export)
