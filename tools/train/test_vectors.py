"""Layers of networks as PyTorch computes them, for the tests of inference: tests/data/nn.safetensors.

    python tools/train/test_vectors.py tests/data/nn.safetensors

For every layer NAME: NAME.weight and NAME.bias as PyTorch has them, NAME.input and NAME.output as (height, width, channels).
"""
import sys

import torch
from safetensors.torch import save_file
from torch import nn


def main(path):
    torch.manual_seed(1)
    layers = {
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
    for name, layer in layers.items():
        inputs = getattr(layer, "in_channels", 3)
        size = (8, 6) if name in ("pool", "halve") else (9, 15)
        given = torch.randn(1, inputs, *size)
        with torch.no_grad():
            made = layer(given)
            if hasattr(layer, "weight"):
                made = nn.functional.leaky_relu(made, 0.1)
        saved |= {f"{name}.{key}": value.detach() for key, value in layer.named_parameters()}
        saved |= {f"{name}.input": given[0].permute(1, 2, 0), f"{name}.output": made[0].permute(1, 2, 0)}
    save_file({name: value.contiguous() for name, value in saved.items()}, path)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
