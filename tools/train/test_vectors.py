"""Layers and a network as PyTorch computes them, for the tests of inference: nn.safetensors and gradnet-printed.safetensors.

    python tools/train/test_vectors.py tests/data

Of every layer NAME: NAME.weight and NAME.bias as PyTorch has them, NAME.input and NAME.output as (height, width, channels). Of a
small `gradnet` with the inputs as printed: its weights, the inputs of both encoders, and the output.
"""
import os
import sys

import torch
from safetensors.torch import save_file
from torch import nn

from encoders import GradNet
from gradnet import SHAPES


def main(folder):
    save(layers(), os.path.join(folder, "nn.safetensors"))
    save(printed(), os.path.join(folder, "gradnet-printed.safetensors"))


def save(arrays, path):
    save_file({name: value.contiguous() for name, value in arrays.items()}, path)


def printed():
    torch.manual_seed(2)
    net = GradNet(*SHAPES["paper"], width=2, near=False)
    given = [torch.rand(1, channels, 24, 40) for channels in SHAPES["paper"][0]]
    with torch.no_grad():
        made = net(*given)
    pixels = lambda planes: planes[0].permute(1, 2, 0)
    vectors = {"data": pixels(given[0]), "gradient": pixels(given[1]), "output": pixels(made)}
    return {name: value.detach() for name, value in net.state_dict().items()} | vectors


def layers():
    torch.manual_seed(1)
    made_of = {
        "conv3": nn.Conv2d(5, 19, 3, padding=1),
        "dilated": nn.Conv2d(16, 16, 3, padding=3, dilation=3),
        "dense": nn.Conv2d(7, 33, 1),
        "halve": nn.Conv2d(5, 19, 3, stride=2, padding=1),
        "double": nn.ConvTranspose2d(6, 17, 4, stride=2, padding=1),
        "pool": nn.MaxPool2d(2),
        "nearest": nn.Upsample(scale_factor=2, mode="nearest"),
        "bilinear": nn.Upsample(scale_factor=2, mode="bilinear", align_corners=False),
    }
    saved = {}
    for name, layer in made_of.items():
        inputs = getattr(layer, "in_channels", 3)
        size = (8, 6) if name in ("pool", "halve") else (9, 15)
        given = torch.randn(1, inputs, *size)
        with torch.no_grad():
            made = layer(given)
            if hasattr(layer, "weight"):
                made = nn.functional.leaky_relu(made, 0.1)
        saved |= {f"{name}.{key}": value.detach() for key, value in layer.named_parameters()}
        saved |= {f"{name}.input": given[0].permute(1, 2, 0), f"{name}.output": made[0].permute(1, 2, 0)}
    return saved


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
