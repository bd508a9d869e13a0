"""The network of the kernel `learned`: chooses every pixel's neighbours, and weights of them and of the pixel.

    python tools/train/kernels.py train FRAMES --run runs/kernels
    python tools/train/kernels.py test FRAMES --run runs/kernels
    python tools/train/kernels.py export FRAMES --run runs/kernels [--preset full]

FRAMES is a folder of kernel_frames.py; ten of every hundred scenes are kept apart for tests. Samples of the pilot are encoded one by one;
a U-Net sees their means and largest values (Josse et al. 2025). Scores choose neighbours by degrees that become sharper as training
goes on; a third of the steps keeps the cross, so that one network serves both. `export` writes src/neighbours/learned/learned.safetensors if the
gate holds: on the scenes kept apart less error than the cross with uniform weights, with both kinds of neighbours.
"""
import glob
import json
import math
import os

import numpy as np
import torch
from safetensors.torch import save_file
from torch import nn
from torch.nn import functional as F

import runs
import selection
from kernel_frames import recipe
from ssim import ms_ssim
from steps import CROSS, HALF_PLANE, STEPS, forward
from unet import UNet, act

TOP = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
FEATURES, ENCODED, HIDDEN, HEAD = 17, 32, 25, 32
# Widths of the U-Net: half of the paper's, and the paper's.
WIDTHS = {"half": ([32, 32, 40, 48], [40, 32, 32]), "full": ([64, 64, 80, 96], [80, 64, 64])}
# Periods in pixels of the position's sines and cosines.
PERIODS = (4, 16)
COUNT, CHOSEN = len(STEPS), 4
# Bound of the logarithm of a weight.
LONGEST = 8.0
ITERATIONS, TEST_ITERATIONS = 20, 50
RATE, STEPS_OF_TRAINING = 5e-4, 5000
# Stiffness at the first step and at the last soft one; share of soft steps, and of those on the cross.
STIFFNESS, SOFT, ON_CROSS = (1.0, 1e4), 0.7, 0.33
EPSILON, SIMILARITY, LEAST = 0.01, 0.3, 0.02


class Network(nn.Module):
    def __init__(self, preset="half"):
        super().__init__()
        dense = lambda i, o: nn.Conv2d(i, o, 1)
        self.encoder = nn.ModuleList([dense(FEATURES, ENCODED), dense(ENCODED, ENCODED), dense(ENCODED, ENCODED)])
        self.unet = UNet(2 * ENCODED + 4 * len(PERIODS), HIDDEN, *WIDTHS[preset])
        self.head = nn.ModuleList([dense(HIDDEN, HEAD), dense(HEAD, 2 * COUNT + 1)])
        with torch.no_grad():
            self.head[1].weight.mul_(0.1)
            self.head[1].bias.zero_()
            # At first the cross is chosen.
            self.head[1].bias[:CROSS] = 1.0

    def encode(self, samples):
        """Means and largest values of encoded samples, (samples, 17, height, width)."""
        for layer in self.encoder:
            samples = act(layer(samples))
        return torch.cat([samples.mean(0, keepdim=True), samples.amax(0, keepdim=True)], 1)

    def forward(self, samples):
        """Scores of the neighbours, (24, height, width), and weights of the pixel and its neighbours, (25, ...)."""
        height, width = samples.shape[-2:]
        x = torch.cat([self.encode(samples), positions(height, width)[None]], 1)
        x = self.head[1](act(self.head[0](act(self.unet(x)))))[0]
        return torch.softmax(x[:COUNT], 0), torch.exp(LONGEST * torch.tanh(x[COUNT:] / LONGEST))


def positions(height, width):
    y, x = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    waves = [f(2 * math.pi * axis / period) for period in PERIODS for axis in (x, y) for f in (torch.sin, torch.cos)]
    return torch.stack(waves).float()


def shifted(image, step):
    """The values across a step, zero beyond the border."""
    dx, dy = step
    height, width = image.shape[-2:]
    return F.pad(image, (2, 2, 2, 2))[..., 2 + dy:2 + dy + height, 2 + dx:2 + dx + width]


def window(image):
    """Values across all steps, (24, channels, height, width)."""
    return torch.stack([shifted(image, step) for step in STEPS])


def opposite(values):
    """What the neighbours hold of the step back, of values by step, (24, ..., height, width)."""
    return torch.stack([shifted(values[k ^ 1], step) for k, step in enumerate(STEPS)])


def all_edges(half):
    """Differences to all 24 neighbours from those across the forward steps."""
    at = {step: half[k] for k, step in enumerate(HALF_PLANE)}
    back = lambda step: (-step[0], -step[1])
    return torch.stack([at[step] if forward(step) else -shifted(at[back(step)], step) for step in STEPS])


def around(image):
    """Values of a window of 5x5 of every pixel row by row, (channels, 25, pixels), zero beyond the border."""
    return F.unfold(image[None], 5, padding=2)[0].reshape(image.shape[0], 25, -1)


class Means(torch.autograd.Function):
    """Repeated means of windows by `weights`, (25, height, width), less a correction. The gradient runs the means backwards."""

    @staticmethod
    def forward(ctx, image, weights, correction, iterations):
        flat, images = weights.reshape(25, -1), [image]
        for _ in range(iterations):
            images.append((around(images[-1]) * flat).sum(1).reshape(image.shape) - correction)
        ctx.save_for_backward(weights, *images[:-1])
        return images[-1]

    @staticmethod
    def backward(ctx, gradient):
        weights, *images = ctx.saved_tensors
        offsets = [(k % 5 - 2, k // 5 - 2) for k in range(25)]
        back = torch.stack([shifted(weights[24 - k], offset) for k, offset in enumerate(offsets)]).reshape(25, -1)
        of_weights, of_correction = torch.zeros_like(back), torch.zeros_like(gradient)
        for image in reversed(images):
            of_correction -= gradient
            of_weights += (around(image) * gradient.reshape(gradient.shape[0], 1, -1)).sum(0)
            gradient = (around(gradient) * back).sum(1).reshape(gradient.shape)
        return gradient, of_weights.reshape(weights.shape), of_correction, None


def solved(colour, edges, present, weights, iterations):
    """Control variates: means of each pixel and its corrected neighbours by weights, again and again. `present` says, (24, height, width),
    to which degree there is an edge."""
    inside = window(torch.ones_like(colour[:1]))[:, 0]
    of_neighbours = present * inside * weights[1:]
    total = weights[0] + of_neighbours.sum(0)
    shares = of_neighbours / total
    correction = (shares[:, None] * edges).sum(0)
    by_place = {(0, 0): weights[0] / total} | dict(zip(STEPS, shares))
    stencil = torch.stack([by_place[k % 5 - 2, k // 5 - 2] for k in range(25)])
    return Means.apply(colour, stencil, correction, iterations)


def shown(image, exposure):
    """An image as it is looked at, in [0, 1]."""
    scaled = (image * exposure).clamp(min=0)
    return (scaled / (1 + scaled) + 1e-4) ** (1 / 2.2)


def smape(image, target):
    return ((image - target).abs() / (image.abs() + target.abs() + EPSILON)).mean()


class Frame:
    """Parts of a frame, channels first: samples of the pilot, colours, differences across forward steps, and the target."""

    def __init__(self, path):
        self.name = os.path.basename(path)[:-4]
        with np.load(path) as arrays:
            get = lambda name: torch.from_numpy(arrays[name])
            # The first sample has given the others their scale.
            self.samples = get("pilot")[1:].permute(0, 3, 1, 2).contiguous()
            self.colour, self.edges, self.target, self.spp = get("colour"), get("edges"), get("target"), int(arrays["spp"])
        self.plain = None

    def finite(self):
        return all(torch.isfinite(part).all() for part in (self.samples, self.colour, self.edges, self.target))


def parts(frame, turn=(False, False, False), colours=(0, 1, 2)):
    """Samples, colours, differences to all neighbours and target; transposed, mirrored in x and in y, colours permuted."""
    transposed, in_x, in_y = turn
    colours = list(colours)
    flips = [axis for axis, flipped in ((-1, in_x), (-2, in_y)) if flipped]
    turned = lambda image: (image.float().transpose(-1, -2) if transposed else image.float()).flip(flips)

    def moved(step):
        dx, dy = step[::-1] if transposed else step
        return (-dx if in_x else dx, -dy if in_y else dy)
    edges = all_edges(frame.edges.float())
    order = [0] * COUNT
    for k, step in enumerate(STEPS):
        order[STEPS.index(moved(step))] = k
    samples = turned(frame.samples)
    # Colour, albedo, normal (to the left, up and into the picture), and the rest.
    normal = samples[:, 6:9]
    if transposed:
        normal = normal[:, [1, 0, 2]]
    normal = normal * torch.tensor([-1.0 if in_x else 1.0, -1.0 if in_y else 1.0, 1.0])[:, None, None]
    samples = torch.cat([samples[:, 0:3][:, colours], samples[:, 3:6][:, colours], normal, samples[:, 9:]], 1)
    return samples, turned(frame.colour)[colours], turned(edges[order])[:, colours], turned(frame.target)[colours]


def exposure(target):
    """Brings the geometric mean, in which dark pixels count as a thousandth of the mean, to a middle grey."""
    luminance = target.mean(0).clamp(min=0)
    return 0.25 / torch.exp(torch.log(luminance + 1e-3 * luminance.mean() + 1e-9).mean())


def on_cross():
    return (torch.arange(COUNT) < CROSS).float()[:, None, None]


def load(folders):
    """Frames to train on, and those of the scenes kept apart."""
    frames = [Frame(path) for folder in folders for path in sorted(glob.glob(os.path.join(folder, "*.npz"))) if ".part" not in path]
    frames = [frame for frame in frames if frame.finite()]
    return [f for f in frames if not runs.is_apart(f.name)], [f for f in frames if runs.is_apart(f.name)]


def plain(frame):
    """SMAPE of the cross with uniform weights, which is looked for once."""
    if frame.plain is None:
        with torch.no_grad():
            _, colour, edges, target = parts(frame)
            shape, scale = colour.shape[1:], exposure(target)
            image = solved(colour, edges, on_cross().expand(-1, *shape), torch.ones(COUNT + 1, *shape), ITERATIONS)
            frame.plain = float(smape(image * scale, target * scale))
    return frame.plain


def train(options):
    training, apart = load(options.frames)
    print(f"{len(training)} frames to train on, {len(apart)} apart", flush=True)
    torch.manual_seed(options.seed)
    net, choose = Network(options.preset), selection.Selection(COUNT, CHOSEN)
    optimiser = torch.optim.Adam(net.parameters(), RATE)
    schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, runs.cosine(options.steps, 200))
    soft = SOFT * options.steps

    def step_of(rng, step):
        frame = training[rng.integers(len(training))]
        samples, colour, edges, target = parts(frame, rng.random(3) < 0.5, rng.permutation(3))
        scores, weights = net(samples)
        if rng.random() < ON_CROSS:
            chosen = on_cross().expand_as(scores)
        elif step < soft:
            chosen = choose(scores, STIFFNESS[0] * (STIFFNESS[1] / STIFFNESS[0]) ** (step / soft))
        else:
            chosen = selection.hard(scores.detach(), CHOSEN)
        back = opposite(chosen)
        image = solved(colour, edges, chosen + back - chosen * back, weights, ITERATIONS)
        scale = exposure(target)
        similar = ms_ssim(shown(image, scale)[None], shown(target, scale)[None])
        # In units of what the cross makes of it, so that dim and noisy frames weigh alike.
        value = (smape(image * scale, target * scale) + SIMILARITY * (1 - similar)) / (plain(frame) + LEAST)
        optimiser.zero_grad()
        value.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        return value.detach()

    runs.train({"net": net, "optimiser": optimiser, "schedule": schedule}, step_of, options)


def compared(net, apart):
    """SMAPE and 1 - MS-SSIM on the scenes kept apart, over those of the cross with uniform weights, by light and shift. True if SMAPE is
    less for both kinds of neighbours."""
    rows = {}
    with torch.no_grad():
        for frame in apart:
            samples, colour, edges, target = parts(frame)
            scores, weights = net(samples)
            chosen = selection.hard(scores, CHOSEN)
            chosen, cross, ones = torch.maximum(chosen, opposite(chosen)), on_cross().expand_as(scores), torch.ones_like(weights)
            scale = exposure(target)

            def errors(present, weights):
                image = solved(colour, edges, present, weights, TEST_ITERATIONS)
                return [float(smape(image * scale, target * scale)), 1 - float(ms_ssim(shown(image, scale)[None], shown(target, scale)[None]))]
            cases = (cross, ones), (cross, weights), (chosen, weights), (chosen, ones), (torch.ones_like(scores), ones)
            made = [errors(*case) for case in cases]
            if min(made[0]) > 0:
                _, shift, direct = recipe(int(frame.name))
                ratios = np.array(made[1:]).ravel() / np.tile(made[0], len(cases) - 1)
                rows.setdefault(("direct light" if direct else "path tracing", shift), []).append([*ratios, float(chosen.sum(0).mean())])
    print("| light, shift | frames | cross, learned weights | learned, learned weights | learned, uniform | all 24, uniform | degree |")
    print("|---|---|---|---|---|---|---|")
    for kind in sorted(rows):
        mean = np.exp(np.log(rows[kind]).mean(0))
        print("| %s, %s | %d | %.3f, %.3f | %.3f, %.3f | %.3f, %.3f | %.3f, %.3f | %.2f |" % (*kind, len(rows[kind]), *mean), flush=True)
    means = np.exp(np.log(np.concatenate(list(rows.values()))).mean(0)) if rows else np.ones(3)
    return means[0] < 1 and means[2] < 1


def test(options):
    compared(runs.trained(Network(options.preset), options)[0], load(options.frames)[1])


def export(options):
    """Writes half floats, and for the tests what the network makes of one crop."""
    (net, steps), apart = runs.trained(Network(options.preset), options), load(options.frames)[1]
    if not compared(net, apart):
        raise SystemExit("not exported: the cross is better")
    net = net.half().float()
    recipe = {"preset": options.preset, "steps": steps, "rate": RATE, "seed": options.seed, "encoded samples": apart[0].samples.shape[0]}
    save_file({name: value.half().contiguous() for name, value in net.state_dict().items()},
              os.path.join(TOP, "src/neighbours/learned/learned.safetensors"), {"recipe": json.dumps(recipe)})
    samples = apart[0].samples[:, :, :16, :24].float()
    with torch.no_grad():
        scores, weights = net(samples)
    pixels = lambda planes: planes.permute(1, 2, 0).contiguous()
    vectors = {"scores": pixels(scores), "weights": pixels(weights)} | {f"sample.{k}": pixels(one) for k, one in enumerate(samples)}
    save_file(vectors, os.path.join(TOP, "tests/data/kernels-learned.safetensors"))


if __name__ == "__main__":
    preset = lambda parser: parser.add_argument("--preset", choices=list(WIDTHS), default="half")
    runs.command(__doc__, STEPS_OF_TRAINING, preset, train=train, test=test, export=export)
