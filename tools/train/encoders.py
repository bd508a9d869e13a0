"""The network of Guo et al. (2019), and what networks of encoders for colours and differences are given; src/nn/gradnet.rs and
src/reconstruct/compressed.rs do the same. Radiance, in units of its typical luminance, is compressed."""
import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from frames import planes

DEVICE = "cuda" if torch.cuda.is_available() else "cpu"
MU = 16.0
WIDTH, BLOCKS, SLOPE = 12, 4, 0.01
HALF_MAX = 6e4
# Parts of a frame with their channels; the layout of a network has more.
SAMPLED = {"colour": 3, "dx": 3, "dy": 3, "features": 7}
NOISE = {"sigma": 1, "spp": 1, "dx_sigma": 1, "dy_sigma": 1}


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
    """Two encoders, residual blocks, a decoder with skips from both encoders, and from the inputs if `near`."""

    def __init__(self, inputs, outputs=3, width=WIDTH, near=True):
        super().__init__()
        levels = [width, 2 * width, 4 * width]
        encoder = lambda channels: nn.ModuleList([nn.Conv2d(i, o, 3, stride=2, padding=1) for i, o in zip([channels] + levels, levels)])
        self.data, self.gradient = encoder(inputs[0]), encoder(inputs[1])
        self.blocks = nn.ModuleList([Residual(8 * width) for _ in range(BLOCKS)])
        below = [8 * width] + levels[:0:-1]
        self.decoder = nn.ModuleList([nn.ConvTranspose2d(b + 2 * s, o, 4, stride=2, padding=1)
                                      for b, s, o in zip(below, levels[::-1], levels[::-1])])
        if near:
            self.near = nn.Conv2d(sum(inputs), width, 3, padding=1)
            self.last = nn.Conv2d(2 * width, width, 3, padding=1)
        self.out = nn.Conv2d(width, outputs, 3, padding=1)

    def forward(self, data, gradient):
        act = lambda x: F.leaky_relu(x, SLOPE)
        both, skips = torch.cat([data, gradient], 1), []
        for a, b in zip(self.data, self.gradient):
            data, gradient = act(a(data)), act(b(gradient))
            skips.append((data, gradient))
        x = torch.cat([data, gradient], 1)
        for block in self.blocks:
            x = block(x)
        for layer in self.decoder:
            x = act(layer(torch.cat([x, *skips.pop()], 1)))
        if hasattr(self, "near"):
            x = act(self.last(torch.cat([x, act(self.near(both))], 1)))
        return self.out(x)


def sampled(frame):
    """Colours, differences, features and noise of a frame, channels first, and its target."""
    depth = np.maximum(frame.get("depth", "Z"), 0)
    far = max(float(np.quantile(depth, 0.99)), 1e-9)
    features = torch.cat([planes(frame.get("albedo", "RGB")), planes((frame.get("normal", "XYZ") + 1) / 2),
                          planes(np.minimum(depth / far, 1))])
    noise = {name: compress(planes(frame.radiance(name)).mean(0, keepdim=True)) for name in ("sigma", "dx_sigma", "dy_sigma")}
    return {"colour": planes(frame.radiance("")), "dx": planes(frame.radiance("dx")), "dy": planes(frame.radiance("dy")),
            "features": features, "spp": torch.full_like(features[:1], frame.told_samples()), "target": planes(frame.target)} | noise


def whole(parts, layout):
    """One tensor of the parts of a layout, or none if a value is not finite."""
    made = torch.cat([parts[name] for name in layout])
    return made.clamp(-HALF_MAX, HALF_MAX).half() if torch.isfinite(made).all() else None


def given(parts, images=("colour",), more=()):
    """The inputs of both encoders: `images` before the features, `more` images after the noise."""
    compressed = lambda names: [compress(parts[name]) for name in names]
    noise = lambda *names: [parts[name] for name in names if name in parts]
    return (torch.cat([*compressed(images), parts["features"], *noise("sigma", "spp", "claimed"), *compressed(more)], -3),
            torch.cat([*compressed(("dx", "dy")), *noise("dx_sigma", "dy_sigma")], -3))


def padded(network, *inputs):
    """What a network makes of inputs without a batch, mirrored until their sides are multiples of eight."""
    height, width = inputs[0].shape[-2:]
    pad = lambda x: F.pad(x[None], (0, -width % 8, 0, -height % 8), mode="reflect")
    with torch.no_grad():
        return network(*(pad(x) for x in inputs))[0, :, :height, :width]


def step_x(image):
    return image[..., 1:] - image[..., :-1]


def step_y(image):
    return image[..., 1:, :] - image[..., :-1, :]


def fit(image, colour, dx=None, dy=None):
    """Distances of the compressed colours and of the compressed differences, which are the colours' own where none are given."""
    distance = lambda a, b: 3 * (compress(a) - compress(b)).abs().mean()
    dx = step_x(colour) if dx is None else dx
    dy = step_y(colour) if dy is None else dy
    return distance(image, colour), distance(step_x(image), dx) + distance(step_y(image), dy)
