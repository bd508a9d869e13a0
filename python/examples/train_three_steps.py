"""Trains a small network on a data set for three steps, to show how it is read.

    fluxion dataset scenes/*/scene.xml -o frames --size 128x128 --spp 4 --reference 256
    pip install fluxion-render torch
    python train_three_steps.py frames
"""

import sys

import fluxion
import numpy as np
import torch

LAYERS = ("color", "albedo", "normal")

network = torch.nn.Sequential(
    torch.nn.Conv2d(9, 16, 3, padding=1), torch.nn.ReLU(), torch.nn.Conv2d(16, 3, 3, padding=1)
)
optimizer = torch.optim.Adam(network.parameters(), lr=1e-3)
frames = fluxion.data.open(sys.argv[1])


def tensor(array):
    """An array of height, width and channels as a batch of one."""
    return torch.from_numpy(np.array(array, dtype=np.float32)).permute(2, 0, 1)[None]


for step in range(3):
    sample = frames[step % len(frames)]
    layers = sample.inputs(spp=sample.spp[0])
    inputs = torch.cat([tensor(layers[name]) for name in LAYERS], dim=1)
    target = tensor(sample.target())
    loss = torch.nn.functional.l1_loss(network(torch.log1p(inputs.clamp(min=0))), torch.log1p(target))
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    print(f"step {step + 1}: {sample.name}, loss {loss.item():.4f}")
