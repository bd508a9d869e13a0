"""Pictures of several panels."""
import numpy as np

GAP = 4


def shown(image):
    """Values in [0, 1] by sRGB's curve."""
    image = np.clip(image, 0, 1)
    return np.where(image <= 0.0031308, 12.92 * image, 1.055 * image ** (1 / 2.4) - 0.055)


def enlarged(image, factor=2):
    """Every pixel so many times as wide and high."""
    return image.repeat(factor, 0).repeat(factor, 1)


def beside(panels):
    return joined(panels, 1)


def below(panels):
    return joined(panels, 0)


def joined(panels, axis):
    """Panels along an axis, with white between them."""
    shape = list(panels[0].shape)
    shape[axis] = GAP
    gap = np.ones(shape)
    return np.concatenate([part for panel in panels for part in (panel, gap)][:-1], axis)
