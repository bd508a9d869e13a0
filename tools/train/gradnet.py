"""The network of the method `gradnet` (Guo et al. 2019): a solver for colours and differences, trained without clean images.

    python tools/train/gradnet.py train FRAMES... --run runs/gradnet [--preset paper]
    python tools/train/gradnet.py test FRAMES... --run runs/gradnet
    python tools/train/gradnet.py export FRAMES... --run runs/gradnet

FRAMES are folders of `fluxion dataset --layers features,gradients --method l1`; ten of every hundred scenes are kept apart for tests,
and need a target and the methods that `test` compares with. `--preset paper` takes 64 samples per pixel and the inputs as printed;
the other, `own`, any number of samples, which it is told, variances, and weights of the first-order loss from the l1 image.
"""
import argparse
import json
import os

import numpy as np
import torch
from safetensors.torch import save_file
from torch import nn
from torch.nn import functional as F

import frames
import runs
from frames import planes

MU = 16.0
WIDTH, BLOCKS, SLOPE = 16, 4, 0.01
# Channels of the data and the gradient encoder's inputs.
INPUTS = {"paper": (10, 6), "own": (12, 8)}
BRANCH = 64
# One over twice the variance of the first-order loss's weights.
SHARPNESS = 9.0
CROP, BATCH, STEPS, EPOCHS = 96, 4, 30000, 50
RATE = {"paper": 1e-4, "own": 5e-4}
# Radius and deviation of the window whose means are corrected, and least mean, over the image's.
RADIUS, DEVIATION, DARK = 45, 15.0, 1e-3
HALF_MAX = 6e4
SOLVERS = ["l2", "l1"]
METHODS = ["l2", "l1", "control_variate", "least_trimmed", "frgr"]


def compress(x):
    return torch.sign(x) * torch.log1p(MU * x.abs()) / np.log(1 + MU)


def decompress(y):
    # Beyond what half floats hold after compression there is nothing to learn.
    return torch.sign(y) * torch.expm1(y.abs().clamp(max=4) * np.log(1 + MU)) / MU


class Residual(nn.Module):
    def __init__(self, channels):
        super().__init__()
        self.a, self.b = (nn.Conv2d(channels, channels, 3, padding=1) for _ in range(2))

    def forward(self, x):
        return x + self.b(F.leaky_relu(self.a(x), SLOPE))


class GradNet(nn.Module):
    """Two encoders, residual blocks, a decoder with skips from both encoders."""

    def __init__(self, inputs, width=WIDTH):
        super().__init__()
        levels = [width, 2 * width, 4 * width]
        encoder = lambda channels: nn.ModuleList([nn.Conv2d(i, o, 3, stride=2, padding=1) for i, o in zip([channels] + levels, levels)])
        self.data, self.gradient = encoder(inputs[0]), encoder(inputs[1])
        self.blocks = nn.ModuleList([Residual(8 * width) for _ in range(BLOCKS)])
        below = [8 * width] + levels[:0:-1]
        self.decoder = nn.ModuleList([nn.ConvTranspose2d(b + 2 * s, o, 4, stride=2, padding=1)
                                      for b, s, o in zip(below, levels[::-1], levels[::-1])])
        self.out = nn.Conv2d(width, 3, 3, padding=1)

    def forward(self, data, gradient):
        act = lambda x: F.leaky_relu(x, SLOPE)
        skips = []
        for a, b in zip(self.data, self.gradient):
            data, gradient = act(a(data)), act(b(gradient))
            skips.append((data, gradient))
        x = torch.cat([data, gradient], 1)
        for block in self.blocks:
            x = block(x)
        for layer in self.decoder:
            x = act(layer(torch.cat([x, *skips.pop()], 1)))
        return self.out(x)


def branch(inputs):
    """Slopes of the compressed colours along the features, seven for each channel."""
    return nn.Sequential(nn.Conv2d(inputs, BRANCH, 3, padding=1), nn.LeakyReLU(SLOPE), nn.Conv2d(BRANCH, BRANCH, 3, padding=1),
                         nn.LeakyReLU(SLOPE), nn.Conv2d(BRANCH, 21, 3, padding=1))


def prepare(frame, preset):
    """What the network is given and what the losses need, channels first."""
    depth = np.maximum(frame.get("depth", "Z"), 0)
    far = max(float(np.quantile(depth, 0.99)), 1e-9)
    colour, dx, dy = (planes(frame.radiance(name)) for name in ("", "dx", "dy"))
    features = torch.cat([planes(frame.get("albedo", "RGB")), planes((frame.get("normal", "XYZ") + 1) / 2),
                          planes(np.minimum(depth / far, 1))])
    data, gradient = [compress(colour), features], [compress(dx), compress(dy)]
    if preset == "own":
        deviation = lambda name: compress(planes(frame.radiance(name)).mean(0, keepdim=True))
        data += [deviation("sigma"), torch.full_like(colour[:1], np.log2(frame.spp) / 4)]
        gradient += [deviation("dx_sigma"), deviation("dy_sigma")]
    guide = planes(frame.image("l1")) if preset == "own" else colour
    made = {"data": torch.cat(data), "gradient": torch.cat(gradient), "colour": colour, "dx": dx, "dy": dy, "features": features,
            "guide": guide}
    if not all(torch.isfinite(part).all() for part in made.values()):
        return None
    return {key: part.clamp(-HALF_MAX, HALF_MAX).half() for key, part in made.items()} | {"spp": frame.spp, "name": frame.name}


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
                sample = prepare(frame, options.preset)
                if sample:
                    made.append(sample | ({"frame": frame} if apart else {}))
    return made if apart else made[:max(1, int(len(made) * options.share))]


# Position of the normal among the features, and of the albedo.
ALBEDO, NORMAL = slice(0, 3), slice(3, 6)


def turned(part, key, other, transposed, mirrored):
    """A crop of `key` transposed and mirrored. `other` is the other direction's differences, which transposition swaps."""
    part = (other if transposed and other is not None else part)
    part = part.transpose(-1, -2) if transposed else part
    if mirrored:
        part = part.flip(-1)
        if key == "dx":
            # The difference to the right was one to the left, of the pixel beside.
            part = -torch.roll(part, -1, -1)
    return part


def crops(data, rng, preset):
    """A batch of crops, transposed and mirrored, their colours permuted, at random."""
    keys = ("colour", "dx", "dy", "features", "guide", "data", "gradient")
    batch = {key: [] for key in keys}
    for _ in range(BATCH):
        sample = data[rng.integers(len(data))]
        height, width = sample["colour"].shape[-2:]
        y, x = rng.integers(height - CROP + 1), rng.integers(width - CROP + 1)
        transposed, mirrored = rng.random() < 0.5, rng.random() < 0.5
        colours = torch.from_numpy(rng.permutation(3))
        cut = lambda key: sample[key][..., y:y + CROP, x:x + CROP].float()
        part = {key: turned(cut(key), key, {"dx": cut("dy"), "dy": cut("dx")}.get(key), transposed, mirrored)
                for key in ("colour", "dx", "dy", "features", "guide")}
        for key in ("colour", "dx", "dy", "guide"):
            part[key] = part[key][colours]
        part["features"] = torch.cat([part["features"][ALBEDO][colours], part["features"][3:]])
        data_rest = turned(cut("data")[10:], "", None, transposed, mirrored)
        gradient_rest = cut("gradient")[6:]
        if preset == "own":
            gradient_rest = gradient_rest[[1, 0]] if transposed else gradient_rest
            gradient_rest = turned(gradient_rest, "", None, transposed, mirrored)
            if mirrored:
                gradient_rest = torch.cat([torch.roll(gradient_rest[:1], -1, -1), gradient_rest[1:]])
        part["data"] = torch.cat([compress(part["colour"]), part["features"], data_rest])
        part["gradient"] = torch.cat([compress(part["dx"]), compress(part["dy"]), gradient_rest])
        for key in keys:
            batch[key].append(part[key])
    return {key: torch.stack(parts) for key, parts in batch.items()}


def step_x(image):
    return image[..., 1:] - image[..., :-1]


def step_y(image):
    return image[..., 1:, :] - image[..., :-1, :]


def first_order(image, slopes, batch):
    """How far compressed colours are from what slopes along the features say, over pairs of neighbours in both directions."""
    total = 0.0
    image, guide, features = compress(image), batch["guide"], batch["features"]
    for step, near, far in ((step_x, (..., slice(None, -1)), (..., slice(1, None))),
                            (step_y, (..., slice(None, -1), slice(None)), (..., slice(1, None), slice(None)))):
        weight = torch.exp(-SHARPNESS * (step(guide) ** 2).sum(1, keepdim=True))
        along = step(features)
        for end in (near, far):
            own = slopes[end].unflatten(1, (3, 7))
            told = (own * along.unsqueeze(1)).sum(2)
            total = total + (weight * (step(image) - told).abs()).mean()
    return total / 4 * 3


def losses(output, batch):
    """Distances of the compressed differences and colours."""
    image = decompress(output)
    gradient = ((compress(step_x(image)) - compress(batch["dx"][..., :-1])).abs().mean()
                + (compress(step_y(image)) - compress(batch["dy"][..., :-1, :])).abs().mean())
    return image, 3 * gradient, 3 * (output - compress(batch["colour"])).abs().mean()


def train(options):
    training = load(options, False)
    print(f"{len(training)} images to train on", flush=True)
    torch.manual_seed(options.seed)
    inputs = INPUTS[options.preset]
    net, slopes = GradNet(inputs).to(memory_format=torch.channels_last), branch(10)
    rate = RATE[options.preset]
    optimiser = torch.optim.Adam(net.parameters(), rate, betas=(0.5, 0.999))
    of_slopes = torch.optim.Adam(slopes.parameters(), rate, betas=(0.5, 0.999))
    decay = lambda step: 0.95 ** (step * EPOCHS // options.steps // 2)
    schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, decay)

    def step_of(rng, step):
        batch = crops(training, rng, options.preset)
        epoch = step * EPOCHS / options.steps
        share = 0.0 if epoch <= 5 or options.without == "first" else min(0.1 * 1.1 ** (epoch - 5), 2.0)
        output = net(batch["data"], batch["gradient"])
        image, of_gradient, of_data = losses(output, batch)
        value = of_data if options.without == "gradient" else of_gradient + of_data
        # In turn: the branch learns in every second step.
        if share > 0 and step % 2 == 0:
            own = first_order(batch["guide"], slopes(batch["data"][:, :10]), batch)
            of_slopes.zero_grad()
            own.backward()
            of_slopes.step()
        if share > 0:
            with torch.no_grad():
                told = slopes(batch["data"][:, :10])
            value = value + share * first_order(image, told, batch)
        optimiser.zero_grad()
        value.backward()
        optimiser.step()
        schedule.step()
        return float(value.detach())

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


def solved(net, sample):
    """The image before and after the correction, channels first."""
    padded = lambda x: F.pad(x[None].float(), (0, -x.shape[-1] % 8, 0, -x.shape[-2] % 8), mode="reflect")
    with torch.no_grad():
        output = net(padded(sample["data"]), padded(sample["gradient"]))[0, :, :sample["data"].shape[-2], :sample["data"].shape[-1]]
    image = decompress(output).clamp(min=0)
    return image, corrected(image, sample["colour"].float())


def test(options):
    """Errors on the scenes kept apart, geometric means over frames, the targets' noise taken off. True if those of GradNet are below
    the solvers' at every sample count."""
    good = True
    net, _ = runs.trained(GradNet(INPUTS[options.preset]), options)
    rows = {}
    for sample in load(options, True):
        frame, last = sample["frame"], lambda planes: np.moveaxis(planes.numpy(), 0, -1)
        methods = [method for method in METHODS if method + ".R" in frame.columns]
        errors = [frame.rel_mse(frame.image(method)) for method in methods]
        errors += [frame.rel_mse(last(image)) for image in solved(net, sample)]
        if min(errors) > 0.3 * frame.floor:
            rows.setdefault(sample["spp"], []).append(errors)
    print("| spp | frames | " + " | ".join(methods) + " | uncorrected | gradnet |\n" + "|---" * (len(methods) + 4) + "|")
    for spp in sorted(rows):
        means = np.exp(np.log(rows[spp]).mean(0))
        print("| %d | %d | %s |" % (spp, len(rows[spp]), " | ".join("%.5f" % mean for mean in means)))
        good &= means[-1] < min(means[methods.index(method)] for method in SOLVERS)
    return good


def export(options):
    """Writes half floats if the gate holds, and for tests what the network makes of them on one crop."""
    if not test(options):
        raise SystemExit("not exported: a solver is better")
    net, steps = runs.trained(GradNet(INPUTS[options.preset]), options)
    net = net.half().float()
    top = os.path.join(os.path.dirname(__file__), "..", "..")
    recipe = {"preset": options.preset, "steps": steps, "batch": BATCH, "crop": CROP, "rate": RATE[options.preset], "seed": options.seed}
    folder = os.path.join(top, "src/reconstruct/gradnet")
    os.makedirs(folder, exist_ok=True)
    save_file({name: value.half().contiguous() for name, value in net.state_dict().items()},
              os.path.join(folder, options.preset + ".safetensors"), {"recipe": json.dumps(recipe)})
    sample = load(options, True)[0]
    part = {key: sample[key][..., :24, :40].float() for key in ("data", "gradient")}
    with torch.no_grad():
        part["output"] = net(part["data"][None], part["gradient"][None])[0]
    save_file({name: value.permute(1, 2, 0).contiguous() for name, value in part.items()},
              os.path.join(top, "tests/data", f"gradnet-{options.preset}.safetensors"))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=["train", "test", "export"])
    runs.arguments(parser, STEPS)
    parser.add_argument("--preset", choices=list(INPUTS), default="own")
    parser.add_argument("--share", type=float, default=1.0, help="of the frames that is trained on")
    parser.add_argument("--without", choices=["first", "gradient"], help="leaves out a loss")
    options = parser.parse_args()
    {"train": train, "test": test, "export": export}[options.action](options)
