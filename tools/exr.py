"""Image files as arrays, for the tools of this folder. Needs the Python packages numpy and OpenImageIO."""
import numpy as np
import OpenImageIO as oiio


def names(path):
    """Names of the channels of a file."""
    return list(oiio.ImageBuf(str(path)).spec().channelnames)


def channels(path, wanted):
    """Channels by name, as an array of rows, columns and channels in single precision."""
    image = oiio.ImageBuf(str(path))
    there = image.spec().channelnames
    return image.get_pixels(oiio.FLOAT)[:, :, [there.index(name) for name in wanted]]


def rgb(path):
    """The colour, in double precision."""
    return channels(path, "RGB").astype(np.float64)


def everything(path):
    """All channels in double precision, by name."""
    wanted = names(path)
    pixels = channels(path, wanted).astype(np.float64)
    return {name: pixels[:, :, k] for k, name in enumerate(wanted)}


def write(path, picture, kind=oiio.FLOAT):
    """Writes an RGB image; formats of eight bits take values in [0, 1] and `kind=exr.EIGHT_BIT`."""
    out = oiio.ImageBuf(oiio.ImageSpec(picture.shape[1], picture.shape[0], 3, kind))
    out.set_pixels(oiio.ROI(), np.ascontiguousarray(picture, dtype=np.float32))
    out.write(str(path))


EIGHT_BIT = oiio.UINT8
