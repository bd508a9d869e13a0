"""Errors of images by how far they are from the sampled colours, as src/reconstruct/residual.rs has them; channels first."""
from torch.nn import functional as F

RADIUS = 7
# Squared residuals beyond the noise may be this share of it before an image counts as biased; more where few samples, fewer
# than this number, say little about the noise.
TRUST, FEW = 0.5, 16
LEAST_ERROR, LEAST_NOISE = 0.02, 1e-9


def box(image, radius):
    """Means over windows, mirrored beyond the border without repeating it."""
    padded = F.pad(image[None], (radius,) * 4, mode="reflect")
    return F.avg_pool2d(padded, 2 * radius + 1, 1)[0]


def squared_error(colour, variance, image):
    """Squared distances from the colours less their variance, means over the channels and windows."""
    return box(((image - colour) ** 2).mean(0, keepdim=True) - variance, RADIUS)


def estimated_error(colour, variance, image):
    return squared_error(colour, variance, image).maximum(LEAST_ERROR * box(variance, RADIUS))


def trust(noise, error, spp):
    """How far images can be trusted by their squared errors beyond the noise around."""
    return (TRUST * (1 + FEW / spp) * noise / error.clamp(min=1e-12)).clamp(max=1)
