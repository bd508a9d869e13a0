"""The network of the allocator `learned`: says by a pilot how many samples each pixel needs.

    python tools/train/sampling.py train FRAMES --run runs/sampling
    python tools/train/sampling.py test FRAMES --run runs/sampling
    python tools/train/sampling.py export FRAMES --run runs/sampling

FRAMES is a folder of `fluxion dataset --spp 8,16,32,64,128 --layers features,gradients --target l2`; ten of every hundred scenes are kept
apart for tests. A frame of any sample counts is put together of groups of samples of 8, 16, 32 and 64, and goes through control variates;
what a further sample changes is taken to be the distance to the target over the number of samples (Kuznetsov et al. 2018). `export` writes
src/adaptive/learned/learned.safetensors if the gate holds: on the scenes kept apart less error than even samples.
"""
import json
import os

import numpy as np
import torch
from safetensors.torch import save_file
from torch import nn
from torch.nn import functional as F

import frames
import kernels
import runs
from frames import planes
from kernels import COUNT, EPSILON, ITERATIONS, LEAST, SIMILARITY, TEST_ITERATIONS, shifted, shown, smape, solved
from ssim import ms_ssim
from steps import STEPS

# Samples of the pilot, those of every snapshot, and the most that a pixel gets.
PILOT, SNAPSHOTS = 8, (8, 16, 32, 64, 128)
MOST = SNAPSHOTS[-1] - PILOT
# Means of the samples to allocate; half of them are allocated evenly, as in src/adaptive/allocate.rs.
BUDGETS, TEST_BUDGET, EVEN = (16, 24, 32, 40), 40, 0.5
CHANNELS, WIDTH, DILATIONS = 16, 32, (1, 2, 1)
# Bound of the logarithm of a need.
LONGEST = 3.0
RADIUS, NARROW = 3, 1
RATE, STEPS_OF_TRAINING = 1e-3, 4000
# Share of steps without features, and without differences, so that methods which record neither are served.
WITHOUT = 0.25
FLOOR = 1e-6
# Steps that differences lead across.
FORWARD = ((1, 0), (0, 1))


class Network(nn.Module):
    def __init__(self):
        super().__init__()
        inputs = (CHANNELS,) + (WIDTH,) * (len(DILATIONS) - 1)
        for k, (i, dilation) in enumerate(zip(inputs, DILATIONS)):
            setattr(self, f"layer{k}", nn.Conv2d(i, WIDTH, 3, padding=dilation, dilation=dilation))
        self.add_module(f"layer{len(DILATIONS)}", nn.Conv2d(WIDTH, 1, 1))

    def forward(self, inputs):
        """Logarithms of needs."""
        x = inputs[None]
        for k in range(len(DILATIONS)):
            x = F.leaky_relu(getattr(self, f"layer{k}")(x), 0.01)
        return LONGEST * torch.tanh(getattr(self, f"layer{len(DILATIONS)}")(x)[0, 0] / LONGEST)


def box_mean(image, radius):
    """Means of squares, mirrored at the border."""
    return F.avg_pool2d(F.pad(image[None], (radius,) * 4, mode="reflect"), 2 * radius + 1, 1)[0]


def inputs_of(pilot):
    """What the network sees of a frame, in the order of src/adaptive/learned/mod.rs."""
    single = PILOT ** 0.5
    deviation = lambda name, channels: single * planes(pilot.get(name + "_sigma", channels))
    of_colour = (single * planes(pilot.radiance("sigma"))).mean(0, keepdim=True)
    depth = planes(pilot.get("depth", "Z"))
    middle = max(float(depth.median()), 1e-9)
    edges = sum(single * planes(pilot.radiance(name + "_sigma")) for name in ("dx", "dy")).mean(0, keepdim=True) / 2
    return torch.cat([
        torch.log1p(planes(pilot.image("")).clamp(min=0)), torch.log1p(of_colour), torch.log1p(box_mean(of_colour, RADIUS)),
        planes(pilot.get("albedo", "RGB")), planes(pilot.get("normal", "XYZ")), deviation("albedo", "RGB").mean(0, keepdim=True),
        deviation("normal", "XYZ").mean(0, keepdim=True), deviation("depth", "Z") / (depth + middle), depth / (depth + middle),
        torch.log1p(edges)])


def known(inputs, features, edges):
    """Inputs of a frame that has features, or differences, or not."""
    of_features, of_edges = [features] * (CHANNELS - 6), [edges]
    return inputs * torch.tensor([True] * 5 + of_features + of_edges)[:, None, None]


class Groups:
    """Groups of samples of a scene, independent of each other: colours and forward differences, the pilot's first, (groups, 9, height, width)."""

    def __init__(self, snapshots):
        pilot, last = snapshots[0], snapshots[-1]
        scaled = lambda frame, name: planes(frame.get(name, "RGB")) * pilot.scale
        direct = lambda frame: scaled(frame, "direct")
        means = [torch.cat([scaled(frame, "") - direct(frame), scaled(frame, "dx"), scaled(frame, "dy")]) for frame in snapshots]
        self.groups = torch.stack([means[0], *(2 * b - a for a, b in zip(means, means[1:]))])
        self.shape, self.name = self.groups.shape[-2:], pilot.name
        self.inputs = inputs_of(pilot)
        self.target = planes(pilot.target + pilot.direct) - direct(last)
        ahead = [shifted(self.target, step) - self.target for step in FORWARD]
        self.limit = torch.cat([self.target, *ahead])
        variance = lambda name: SNAPSHOTS[-1] * (scaled(last, name) ** 2).mean(0, keepdim=True)
        self.variance = box_mean(torch.cat([variance("sigma"), variance("dx_sigma"), variance("dy_sigma")]), NARROW) + FLOOR
        self.even = {}

    def finite(self):
        return all(torch.isfinite(part).all() for part in (self.groups, self.target, self.variance, self.inputs))

    def shares(self, samples, rng):
        """Shares of the groups in pixels of so many samples beyond the pilot, in groups of eight; and the samples with the pilot's."""
        dither = torch.from_numpy(rng.random(samples.shape, np.float32))
        eights = (samples / PILOT + dither).floor().clamp(0, MOST // PILOT).long()
        of_group = [torch.full_like(eights, PILOT), *((eights >> k & 1) * (PILOT << k) for k in range(len(self.groups) - 1))]
        total = sum(of_group)
        return torch.stack(of_group) / total, total

    def solved(self, samples, rng, iterations):
        """The image of so many samples; its gradient is that of the expected change."""
        shares, total = self.shares(samples.detach(), rng)
        # A difference has the samples of both ends.
        both = lambda values: [values, *((values + shifted(values, step)) / 2 for step in FORWARD)]
        of_part = lambda values, k: values[..., 3 * k:3 * k + 3, :, :]
        counts, parts = both(PILOT + samples[None]), []
        for k, (share, number, count) in enumerate(zip(both(shares), both(total[None].float()), counts)):
            made = (share[:, None] * of_part(self.groups, k)).sum(0)
            parts.append(made + (of_part(self.limit, k) - made) / number * (count - count.detach()))
        colour, right, down = parts
        with torch.no_grad():
            own, *of_edges = (variance[None] / count for variance, count in zip(self.variance, counts))
            none, far = torch.zeros_like(own), lambda step: shifted(own, step)
            across = {step: 1 / (far(step) + edge) for step, edge in zip(FORWARD, of_edges)}
            across |= {back(step): 1 / (far(back(step)) + shifted(edge, back(step)) + FLOOR) for step, edge in zip(FORWARD, of_edges)}
            weights = torch.cat([1 / own, *(across.get(step, none) for step in STEPS)])
        by_step = dict(zip(FORWARD, (right, down))) | {back(step): -shifted(edge, back(step)) for step, edge in zip(FORWARD, (right, down))}
        edges = torch.stack([by_step.get(step, torch.zeros_like(colour)) for step in STEPS])
        return solved(colour, edges, kernels.on_cross().expand(COUNT, *self.shape), weights, iterations)


def back(step):
    return -step[0], -step[1]


def allocated(need, budget):
    """Samples of every pixel beyond the pilot, `budget` in the mean, so that all of them are as nearly proportional to the needs as
    src/adaptive/allocate.rs makes them."""
    share = lambda level: (level * need - PILOT).clamp(EVEN * budget, MOST)
    with torch.no_grad():
        low, high = 0.0, 1e4
        for _ in range(40):
            middle = (low + high) / 2
            low, high = (middle, high) if share(middle).mean() < budget else (low, middle)
    made = share(high)
    return made * (budget / made.mean())


def error(image, target):
    scale = kernels.exposure(target)
    similar = ms_ssim(shown(image, scale)[None], shown(target, scale)[None])
    return smape(image * scale, target * scale) + SIMILARITY * (1 - similar)


def load(folders):
    """Scenes to train on, and those kept apart."""
    everything = {}
    for frame in frames.load(folders):
        everything.setdefault(frame.name, []).append(frame)
    made = [Groups(snapshots) for snapshots in everything.values() if len(snapshots) == len(SNAPSHOTS)]
    made = [groups for groups in made if groups.finite()]
    return [g for g in made if not runs.is_apart(g.name)], [g for g in made if runs.is_apart(g.name)]


def even_error(groups, budget):
    """Error of even samples, which is looked for once."""
    if budget not in groups.even:
        with torch.no_grad():
            even = torch.full(groups.shape, float(budget))
            groups.even[budget] = float(error(groups.solved(even, np.random.default_rng(0), ITERATIONS), groups.target))
    return groups.even[budget]


def train(options):
    training, apart = load(options.frames)
    print(f"{len(training)} scenes to train on, {len(apart)} apart", flush=True)
    torch.manual_seed(options.seed)
    net = Network()

    def loss(rng):
        groups, budget = training[rng.integers(len(training))], BUDGETS[rng.integers(len(BUDGETS))]
        need = torch.exp(net(known(groups.inputs, *(bool(there) for there in rng.random(2) >= WITHOUT))))
        made = groups.solved(allocated(need, budget), rng, ITERATIONS)
        return error(made, groups.target) / (even_error(groups, budget) + LEAST)

    runs.descend(net, loss, RATE, options, longest=1.0, factors=runs.cosine(options.steps))


def by_variance(groups):
    """The need that the allocator `variance` sees."""
    colour = torch.expm1(groups.inputs[:3]).mean(0, keepdim=True)
    relative = torch.expm1(groups.inputs[3:4]) / torch.sqrt(colour ** 2 + (0.2 * colour.mean()) ** 2)
    return box_mean(relative, RADIUS)[0]


def compared(net, apart):
    """SMAPE and relMSE on the scenes kept apart over those of even samples: of needs by variance, and of the network. True if
    both are less with the network."""
    there = [(True, True), (True, False), (False, True), (False, False)]
    rows = []
    with torch.no_grad():
        for groups in apart:
            def errors(need):
                found = []
                for seed in range(4):
                    image = groups.solved(allocated(need, TEST_BUDGET), np.random.default_rng(seed), TEST_ITERATIONS)
                    scale = kernels.exposure(groups.target)
                    square = ((image - groups.target) ** 2 / (groups.target ** 2 + EPSILON)).mean()
                    found.append([float(smape(image * scale, groups.target * scale)), float(square)])
                return np.mean(found, 0)
            needs = [torch.ones(groups.shape), by_variance(groups), *(torch.exp(net(known(groups.inputs, *known_parts))) for known_parts in there)]
            made = [errors(need) for need in needs]
            rows.append(np.concatenate([row / made[0] for row in made[1:]]))
    means = np.exp(np.log(np.array(rows)).mean(0))
    print("| needs | SMAPE | relMSE |\n|---|---|---|")
    for k, name in enumerate(("by variance", "learned", "learned, without differences", "learned, without features", "learned, without both")):
        print("| %s | %.3f | %.3f |" % (name, *means[2 * k:2 * k + 2]), flush=True)
    return max(means[2:4]) < 1


def test(options):
    compared(runs.trained(Network(), options)[0], load(options.frames)[1])


def export(options):
    """Writes half floats, and for the tests what the network makes of one crop."""
    (net, steps), apart = runs.trained(Network(), options), load(options.frames)[1]
    if not compared(net, apart):
        raise SystemExit("not exported: even samples are better")
    net = net.half().float()
    recipe = {"steps": steps, "rate": RATE, "seed": options.seed}
    save_file({name: value.half().contiguous() for name, value in net.state_dict().items()},
              os.path.join(kernels.TOP, "src/adaptive/learned/learned.safetensors"), {"recipe": json.dumps(recipe)})
    inputs = apart[0].inputs[:, :16, :24]
    with torch.no_grad():
        output = net(inputs)
    vectors = {"input": inputs.permute(1, 2, 0).contiguous(), "output": output[..., None].contiguous()}
    save_file(vectors, os.path.join(kernels.TOP, "tests/data/sampling.safetensors"))


if __name__ == "__main__":
    runs.command(__doc__, STEPS_OF_TRAINING, train=train, test=test, export=export)
