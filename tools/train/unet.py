"""U-Nets as src/nn/unet.rs has them: 3x3 convolutions with leaky ReLU, halved by maxima, doubled by repetition."""
import torch
from torch import nn
from torch.nn import functional as F

SLOPE = 0.01


def act(x):
    return F.leaky_relu(x, SLOPE)


class UNet(nn.Module):
    """`down` are the channels of the levels on the way down, `up` those on the way up again."""

    def __init__(self, inputs, outputs, down, up):
        super().__init__()
        convolution = lambda i, o: nn.Conv2d(i, o, 3, padding=1)
        self.first = convolution(inputs, down[0])
        self.down = nn.ModuleList([convolution(i, o) for i, o in zip(down[:1] + down, down)])
        self.middle = convolution(down[-1], down[-1])
        below = [down[-1]] + up
        self.up = nn.ModuleList([convolution(b + s, o) for b, s, o in zip(below, down[-2::-1], up)])
        self.last = convolution(up[-1], up[-1])
        self.out = nn.Conv2d(up[-1], outputs, 1)

    def forward(self, x):
        x, skips = act(self.first(x)), []
        for level, layer in enumerate(self.down):
            x = act(layer(x if level == 0 else F.max_pool2d(x, 2)))
            skips.append(x)
        x = act(self.middle(skips.pop()))
        for layer in self.up:
            x = act(layer(torch.cat([F.interpolate(x, scale_factor=2, mode="nearest"), skips.pop()], 1)))
        return self.out(act(self.last(x)))
