"""EXR files as arrays, for the tools of this folder. Needs the Python packages numpy and OpenImageIO."""
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


def attribute(path, name):
    """A header attribute as a text; empty where there is none."""
    return oiio.ImageBuf(str(path)).spec().get_string_attribute(name)
