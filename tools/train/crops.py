"""Random crops of frames with differences, transposed and mirrored, their colours permuted, at random.

A frame is one tensor, channels first, of parts that a layout names in their order with their numbers of channels. Parts whose names
begin with dx or dy belong to differences in that direction; `features` begin with the albedo.
"""
import torch

SWAPPED = {"dx": "dy", "dy": "dx", "dx_sigma": "dy_sigma", "dy_sigma": "dx_sigma"}


def split(whole, layout):
    """The parts of a frame by their names."""
    return dict(zip(layout, whole.split(list(layout.values()), -3)))


def turned(parts, transposed, mirrored, colours):
    """Parts transposed and mirrored, their colours permuted. Transposition swaps differences; mirrored, the difference to the right
    was one to the left, of the pixel beside."""
    made = {}
    for name in parts:
        part = parts[SWAPPED.get(name, name) if transposed else name]
        if name == "features":
            part = torch.cat([part[:, colours], part[:, 3:]], 1)
        elif part.shape[1] == 3:
            part = part[:, colours]
        part = part.transpose(-1, -2) if transposed else part
        part = part.flip(-1) if mirrored else part
        if mirrored and name.startswith("dx"):
            part = torch.roll(part, -1, -1) * (-1 if name == "dx" else 1)
        made[name] = part
    return made


def batch(data, layout, rng, size, count):
    """Parts of `count` crops of `size` pixels a side, all turned alike."""
    def crop():
        whole = data[rng.integers(len(data))]
        y, x = (rng.integers(side - size + 1) for side in whole.shape[-2:])
        return whole[:, y:y + size, x:x + size]
    parts = split(torch.stack([crop() for _ in range(count)]).float(), layout)
    return turned(parts, rng.random() < 0.5, rng.random() < 0.5, torch.from_numpy(rng.permutation(3)).to(data[0].device))
