"""The network of the method `gradnet` (Guo et al. 2019): a solver for colours and differences, trained without clean images.

    python tools/train/gradnet.py train FRAMES... --run runs/gradnet [--preset paper]
    python tools/train/gradnet.py test FRAMES... --run runs/gradnet
    python tools/train/gradnet.py export FRAMES... --run runs/gradnet

FRAMES are folders of `fluxion dataset --layers features,gradients --method l1 --target l2`; ten of every hundred scenes are kept apart for
tests, and need the methods that `test` compares with. `--preset paper` takes 64 samples per pixel, the inputs as printed, and the losses
as printed, whose only targets are the network's own inputs. The other, `own`, takes any number of samples, which it is told, variances,
and the image of l1, of which its own takes a share; it comes near the image of other samples, which is noisy, too. `export` writes
src/reconstruct/gradnet/own.safetensors, or PRESET.safetensors into the run's folder if another is exported.
"""
import argparse
import json
import os

import numpy as np
import torch
from safetensors.torch import save_file
from torch import nn
from torch.nn import functional as F

import crops
import encoders
import frames
import runs
from encoders import DEVICE, NOISE, SAMPLED, GradNet, compress, decompress, fit, given, step_x, step_y
from frames import planes

TOP = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
LAYOUT = {"paper": SAMPLED, "own": SAMPLED | NOISE | {"l1": 3, "target": 3}}
# Channels that the encoders take and that come out.
SHAPES = {"paper": ((10, 6), 3), "own": ((15, 8), 4)}
BRANCH, SLOPE = 64, 0.01
# One over twice the variance of the first-order loss's weights.
SHARPNESS = 9.0
CROP, BATCH, EPOCHS, LONGEST = 128, 16, 50, 1.0
STEPS, RATE = {"paper": 30000, "own": 17000}, {"paper": 1e-4, "own": 6e-4}
# Radius and deviation of the window whose means are corrected, and least mean, over the image's.
RADIUS, DEVIATION, DARK = 45, 15.0, 1e-3
SOLVERS = ["l2", "l1"]
METHODS = ["l2", "l1", "control_variate", "least_trimmed", "frgr"]


def network(options):
    inputs, outputs = SHAPES[options.preset]
    return GradNet(inputs, outputs, options.width, near=options.preset == "own")


def image_of(output, parts):
    """The image from what comes out of the network, after the channels of a batch."""
    own = decompress(output[..., :3, :, :])
    return own if output.shape[-3] == 3 else torch.lerp(own, parts["l1"], torch.sigmoid(output[..., 3:, :, :]))


def inputs_of(parts):
    return given(parts, more=["l1"] if "l1" in parts else [])


def branch(inputs):
    """Slopes of the compressed colours along the features, seven for each channel."""
    return nn.Sequential(nn.Conv2d(inputs, BRANCH, 3, padding=1), nn.LeakyReLU(SLOPE), nn.Conv2d(BRANCH, BRANCH, 3, padding=1),
                         nn.LeakyReLU(SLOPE), nn.Conv2d(BRANCH, 21, 3, padding=1))


def load(options, apart):
    """Prepared frames, of one half of the scenes only: those kept apart, or the others."""
    made = []
    for folder in options.frames:
        for name, spps in frames.names(folder):
            if runs.is_apart(name) != apart:
                continue
            for spp in spps:
                if options.preset == "paper" and not apart and spp != 64:
                    continue
                frame = frames.Frame(folder, frames.manifest(folder, name), spp)
                parts = encoders.sampled(frame)
                if options.preset == "own":
                    parts["l1"] = planes(frame.image("l1"))
                prepared = encoders.whole(parts, LAYOUT[options.preset])
                if prepared is not None:
                    made.append((prepared, frame if apart else None))
    return made if apart else made[:max(1, int(len(made) * options.share))]


def first_order(image, slopes, batch):
    """How far compressed colours are from what slopes along the features say, over pairs of neighbours in both directions."""
    total = 0.0
    image, guide, features = compress(image), batch["colour"], batch["features"]
    for step, near, far in ((step_x, (..., slice(None, -1)), (..., slice(1, None))),
                            (step_y, (..., slice(None, -1), slice(None)), (..., slice(1, None), slice(None)))):
        weight = torch.exp(-SHARPNESS * (step(guide) ** 2).sum(1, keepdim=True))
        along = step(features)
        for end in (near, far):
            own = slopes[end].unflatten(1, (3, 7))
            told = (own * along.unsqueeze(1)).sum(2)
            total = total + (weight * (step(image) - told).abs()).mean()
    return total / 4 * 3


def losses(image, batch):
    """Distances of colours and of differences: to the target, or to what was sampled if there is none."""
    if "target" in batch:
        return fit(image, batch["target"])
    return fit(image, batch["colour"], batch["dx"][..., :-1], batch["dy"][..., :-1, :])


def train(options):
    training = [prepared.to(DEVICE) for prepared, _ in load(options, False)]
    print(f"{len(training)} images to train on", flush=True)
    torch.manual_seed(options.seed)
    net = network(options).to(DEVICE, memory_format=torch.channels_last)
    slopes, rate, layout = branch(10).to(DEVICE), RATE[options.preset], LAYOUT[options.preset]
    optimiser = torch.optim.Adam(net.parameters(), rate, betas=(0.5 if options.preset == "paper" else 0.9, 0.999))
    of_slopes = torch.optim.Adam(slopes.parameters(), rate, betas=(0.5, 0.999))
    decay = {"paper": lambda step: 0.95 ** (step * EPOCHS // options.steps // 2), "own": runs.cosine(options.steps)}
    schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, decay[options.preset])
    with_first = options.preset == "paper" and options.without != "first"

    def step_of(rng, step):
        batch = crops.batch(training, layout, rng, CROP, options.batch)
        epoch = step * EPOCHS / options.steps
        share = min(0.1 * 1.1 ** (epoch - 5), 2.0) if with_first and epoch > 5 else 0.0
        data, gradient = inputs_of(batch)
        image = image_of(net(data, gradient), batch)
        of_data, of_gradient = losses(image, batch)
        value = of_data if options.without == "gradient" else of_gradient + of_data
        # In turn: the branch learns in every second step.
        if share > 0 and step % 2 == 0:
            own = first_order(batch["colour"], slopes(data[:, :10]), batch)
            of_slopes.zero_grad()
            own.backward()
            of_slopes.step()
        if share > 0:
            with torch.no_grad():
                told = slopes(data[:, :10])
            value = value + share * first_order(image, told, batch)
        optimiser.zero_grad()
        value.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), LONGEST)
        optimiser.step()
        schedule.step()
        return value.detach()

    runs.train({"net": net, "slopes": slopes, "optimiser": optimiser, "of_slopes": of_slopes, "schedule": schedule}, step_of, options)


def window_mean(image):
    at = torch.arange(-RADIUS, RADIUS + 1, dtype=torch.float32)
    kernel = torch.exp(-0.5 * (at / DEVIATION) ** 2)
    channels, height, width = image.shape
    weigh = lambda x: F.conv2d(F.conv2d(x, kernel.view(1, 1, 1, -1), padding=(0, RADIUS)), kernel.view(1, 1, -1, 1), padding=(RADIUS, 0))
    return (weigh(image[:, None]) / weigh(torch.ones(1, 1, height, width)))[:, 0]


def corrected(image, colour):
    """Eq. 13: means over windows become those of the colours, within a factor of two."""
    least = DARK * colour.mean().clamp(min=0) + 1e-9
    ratio = (window_mean(colour) + least) / (window_mean(image) + least)
    return image * ratio.clamp(0.5, 2)


def solved(net, prepared, preset):
    """The image before and after the correction, channels first."""
    parts = crops.split(prepared.float(), LAYOUT[preset])
    image = image_of(encoders.padded(net, *inputs_of(parts)), parts).clamp(min=0)
    return image, corrected(image, parts["colour"])


def test(options):
    """Errors on the scenes kept apart, the targets' noise taken off, as a table of means over the frames, each in units of frgr's. True if
    those of GradNet are below the solvers' at every sample count."""
    net, _ = runs.trained(network(options), options)
    rows = {}
    for prepared, frame in load(options, True):
        last = lambda planes: np.moveaxis(planes.numpy(), 0, -1)
        methods = [method for method in METHODS if method + ".R" in frame.columns]
        errors = [frame.rel_mse(frame.image(method)) for method in methods]
        errors += [frame.rel_mse(last(image)) for image in solved(net, prepared, options.preset)]
        rows.setdefault(frame.spp, []).append(frame.comparable(errors, errors[methods.index("frgr")]))
    return frames.holds(rows, [*methods, "uncorrected", "gradnet"], "gradnet", SOLVERS)


def export(options):
    """Writes half floats if the gate holds, and for tests what the network makes of them on one crop."""
    if not test(options):
        raise SystemExit("not exported: a solver is better")
    net, steps = runs.trained(network(options), options)
    net = net.half().float()
    recipe = {"preset": options.preset, "width": options.width, "steps": steps, "batch": options.batch, "crop": CROP,
              "rate": RATE[options.preset], "seed": options.seed}
    folder = os.path.join(TOP, "src/reconstruct/gradnet") if options.preset == "own" else options.run
    save_file({name: value.half().contiguous() for name, value in net.state_dict().items()},
              os.path.join(folder, options.preset + ".safetensors"), {"recipe": json.dumps(recipe)})
    if options.preset != "own":
        return
    prepared, _ = load(options, True)[0]
    part = dict(zip(("data", "gradient"), inputs_of(crops.split(prepared[:, :16, :24].float(), LAYOUT[options.preset]))))
    with torch.no_grad():
        part["output"] = net(part["data"][None], part["gradient"][None])[0]
    save_file({name: value.permute(1, 2, 0).contiguous() for name, value in part.items()},
              os.path.join(TOP, "tests/data/gradnet-own.safetensors"))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=["train", "test", "export"])
    runs.arguments(parser, None)
    parser.add_argument("--preset", choices=list(SHAPES), default="own")
    parser.add_argument("--width", type=int, default=encoders.WIDTH, help="channels of the first level")
    parser.add_argument("--batch", type=int, default=BATCH)
    parser.add_argument("--share", type=float, default=1.0, help="of the frames that is trained on")
    parser.add_argument("--without", choices=["first", "gradient"], help="leaves out a loss")
    options = parser.parse_args()
    options.steps = options.steps or STEPS[options.preset]
    {"train": train, "test": test, "export": export}[options.action](options)
