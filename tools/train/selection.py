"""The k largest of some scores as probabilities that can be differentiated: a selection network whose comparators exchange their inputs
by degrees (Petersen et al. 2021, 2022).

    python tools/train/selection.py

compares it with a bitonic sorting network of the same comparators, and with a hard selection in the limit.
"""
import math

import torch


def sorted_pairs(wires):
    """Layers of comparators that sort the wires, a power of two of them, the largest first (Batcher 1968)."""
    layers, size = [], 2
    count = len(wires)
    while size <= count:
        # Halves of which one runs backwards are merged.
        layers.append([(wires[start + k], wires[start + size - 1 - k]) for start in range(0, count, size) for k in range(size // 2)])
        layers += halves(wires, size // 2)
        size *= 2
    return layers


def halves(wires, size):
    """Layers that sort runs of `size` bitonic wires."""
    layers, distance = [], size // 2
    while distance:
        layers.append([(wires[start + k], wires[start + k + distance])
                       for start in range(0, len(wires), 2 * distance) for k in range(distance)])
        distance //= 2
    return layers


def network(count, k):
    """Layers of comparators that bring the k largest of `count` scores to some wires, and these wires; k is a power of two that
    divides `count`. Groups of k are sorted, and of two sorted groups the k largest are kept until one is left."""
    groups = [list(range(start, start + k)) for start in range(0, count, k)]
    layers = together([sorted_pairs(group) for group in groups])
    while len(groups) > 1:
        pairs = [groups[i:i + 2] for i in range(0, len(groups) - 1, 2)]
        layers.append([(a, b) for upper, lower in pairs for a, b in zip(upper, reversed(lower))])
        groups = [upper for upper, _ in pairs] + groups[2 * len(pairs):]
        if len(groups) > 1:
            # What the group without a partner is sorted by already changes nothing.
            layers += together([halves(upper, k) for upper, _ in pairs])
    return layers, groups[0]


def together(networks):
    """Networks on different wires as one, layer by layer."""
    return [sum(layers, []) for layers in zip(*networks)]


class Selection:
    """Probabilities that each of `count` scores is among the k largest."""

    def __init__(self, count, k):
        layers, self.kept = network(count, k)
        self.layers = [tuple(torch.tensor(side) for side in zip(*layer)) for layer in layers]
        self.count = count

    def __call__(self, scores, stiffness):
        """Scores, (count, ...), as probabilities of the same shape, which add up to k. `stiffness` says how sharply two scores
        are told apart."""
        exchanged = []
        for a, b in self.layers:
            upper, lower = scores[a], scores[b]
            f = torch.atan(stiffness * (lower - upper)) / math.pi + 0.5
            exchanged.append(f)
            scores = scores.index_copy(0, a, upper + f * (lower - upper)).index_copy(0, b, lower + f * (upper - lower))
        chosen = torch.zeros_like(scores)
        chosen[self.kept] = 1
        for (a, b), f in zip(reversed(self.layers), reversed(exchanged)):
            upper, lower = chosen[a], chosen[b]
            chosen = chosen.index_copy(0, a, upper + f * (lower - upper)).index_copy(0, b, lower + f * (upper - lower))
        return chosen


def hard(scores, k):
    """Ones at the k largest scores, zeros elsewhere."""
    return torch.zeros_like(scores).scatter(0, scores.topk(k, 0).indices, 1)


class Sorting(Selection):
    """The same by sorting all scores, padded to a power of two by wires of least scores."""

    def __init__(self, count, k):
        self.padded = 1 << (count - 1).bit_length()
        self.layers = [tuple(torch.tensor(side) for side in zip(*layer)) for layer in sorted_pairs(list(range(self.padded)))]
        self.kept, self.count = list(range(k)), count

    def __call__(self, scores, stiffness):
        padding = torch.full((self.padded - self.count, *scores.shape[1:]), -1e3, dtype=scores.dtype)
        return super().__call__(torch.cat([scores, padding]), stiffness)[:self.count]


def check():
    torch.manual_seed(1)
    scores = torch.rand(24, 1000, dtype=torch.float64)
    few, all_of_them = Selection(24, 4), Sorting(24, 4)
    print("| stiffness | sum | selection, farthest from hard | sorting, farthest from hard | mean distance of both |\n|---|---|---|---|---|")
    for stiffness in (1, 100, 1e4, 1e7, 1e10):
        a, b, c = few(scores, stiffness), all_of_them(scores, stiffness), hard(scores, 4)
        print("| %.0e | %.6f | %.3f | %.3f | %.4f |" % (stiffness, a.sum(0).mean(), (a - c).abs().max(), (b - c).abs().max(),
                                                      (a - b).abs().mean()))
    assert (few(scores, 1e10) - hard(scores, 4)).abs().max() < 1e-3 and (few(scores, 1.0).sum(0) - 4).abs().max() < 1e-9
    print("comparators: %d to select, %d to sort" % (sum(len(a) for a, _ in few.layers), sum(len(a) for a, _ in all_of_them.layers)))
    small = torch.rand(24, 3, dtype=torch.float64, requires_grad=True)
    torch.autograd.gradcheck(lambda x: few(x, 5.0), small)


if __name__ == "__main__":
    check()
