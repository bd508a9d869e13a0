"""Structural similarity over several scales (Wang et al. 2003)."""
import torch
from torch.nn import functional as F

RADIUS, SIGMA = 5, 1.5
LIMITS = (0.01 ** 2, 0.03 ** 2)
# Of the scales' exponents, finest first, those that a picture of 96 pixels a side has room for.
EXPONENTS = (0.0448, 0.2856, 0.3001, 0.2363)


def blurred(images):
    x = torch.arange(-RADIUS, RADIUS + 1, dtype=images.dtype)
    window = torch.exp(-x ** 2 / (2 * SIGMA ** 2))
    window = (window / window.sum()).expand(images.shape[1], 1, 1, -1)
    once = F.conv2d(images, window, groups=images.shape[1])
    return F.conv2d(once, window.transpose(-1, -2), groups=images.shape[1])


def ms_ssim(a, b):
    """Similarity of images in [0, 1], (batch, channels, height, width): one if they are equal."""
    product, total = 1.0, sum(EXPONENTS)
    for scale, exponent in enumerate(EXPONENTS):
        mean_a, mean_b, aa, bb, ab = blurred(torch.cat([a, b, a * a, b * b, a * b], 1)).chunk(5, 1)
        contrast = (2 * (ab - mean_a * mean_b) + LIMITS[1]) / (aa - mean_a ** 2 + bb - mean_b ** 2 + LIMITS[1])
        if scale == len(EXPONENTS) - 1:
            contrast = contrast * (2 * mean_a * mean_b + LIMITS[0]) / (mean_a ** 2 + mean_b ** 2 + LIMITS[0])
        product = product * contrast.mean().clamp(min=1e-3) ** (exponent / total)
        a, b = F.avg_pool2d(a, 2), F.avg_pool2d(b, 2)
    return product
