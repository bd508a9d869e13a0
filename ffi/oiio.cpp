#include "oiio.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <OpenImageIO/texture.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <memory>
#include <string>

namespace {

struct OpenImage {
  std::unique_ptr<OIIO::ImageInput> input;
  std::string attribute;
  int part = 0;
};

void fail(FluxionError *error, const std::string &message, const char *otherwise) {
  const std::string text = message.empty() ? otherwise : message;
  std::strncpy(error->message, text.c_str(), sizeof error->message - 1);
  error->message[sizeof error->message - 1] = 0;
}

OIIO::TypeDesc type_of(const char *kind) {
  if (std::strcmp(kind, "half") == 0) return OIIO::TypeDesc::HALF;
  if (std::strcmp(kind, "uint8") == 0) return OIIO::TypeDesc::UINT8;
  return OIIO::TypeDesc::FLOAT;
}

bool read_samples(void *handle, OIIO::TypeDesc type, void *pixels, FluxionError *error) try {
  auto *image = static_cast<OpenImage *>(handle);
  const int channels = image->input->spec().nchannels;
  if (image->input->read_image(image->part, 0, 0, channels, type, pixels)) return true;
  fail(error, image->input->geterror(), "the pixels could not be read: the file may be truncated");
  return false;
} catch (const std::exception &exception) {
  fail(error, exception.what(), "reading the image failed");
  return false;
} catch (...) {
  fail(error, "", "reading the image failed");
  return false;
}

}  // namespace

extern "C" void *fluxion_image_open(const char *path, FluxionError *error) try {
  auto image = std::make_unique<OpenImage>();
  // Colours as they are stored: by default they would be multiplied by alpha.
  OIIO::ImageSpec config;
  config.attribute("oiio:UnassociatedAlpha", 1);
  image->input = OIIO::ImageInput::open(path, &config);
  if (!image->input) {
    fail(error, OIIO::geterror(), "the file is missing or of an unknown format");
    return nullptr;
  }
  return image.release();
} catch (const std::exception &exception) {
  fail(error, exception.what(), "opening the image failed");
  return nullptr;
} catch (...) {
  fail(error, "", "opening the image failed");
  return nullptr;
}

extern "C" int fluxion_image_parts(void *handle) try {
  auto *image = static_cast<OpenImage *>(handle);
  // Pages and icons of other formats are pictures of their own.
  if (std::strcmp(image->input->format_name(), "openexr") != 0) return 1;
  const int parts = image->input->spec().get_int_attribute("oiio:subimages", 1);
  return parts < 1 ? 1 : parts > FLUXION_MAX_PARTS ? FLUXION_MAX_PARTS : parts;
} catch (...) {
  return 1;
}

extern "C" bool fluxion_image_part(void *handle, int part, FluxionImageSpec *spec, FluxionError *error) try {
  auto *image = static_cast<OpenImage *>(handle);
  if (!image->input->seek_subimage(part, 0)) {
    fail(error, image->input->geterror(), "a part of the file cannot be read");
    return false;
  }
  image->part = part;
  const OIIO::ImageSpec &found = image->input->spec();
  if (found.depth > 1) {
    fail(error, "", "volumes are not supported");
    return false;
  }
  // A reader makes room for a tile as large as the header claims.
  const double tile = static_cast<double>(found.tile_width) * found.tile_height * found.nchannels;
  const double image_samples = static_cast<double>(found.width) * found.height * found.nchannels;
  if (tile > 16777216.0 && tile > image_samples) {
    fail(error, "", "the header claims tiles that are larger than the image");
    return false;
  }
  spec->width = found.width;
  spec->height = found.height;
  spec->channels = found.nchannels;
  spec->x = found.x;
  spec->y = found.y;
  spec->deep = found.deep;
  const bool whole = found.x == found.full_x && found.y == found.full_y && found.width == found.full_width &&
                     found.height == found.full_height;
  if (!whole) {
    spec->full_width = found.full_width;
    spec->full_height = found.full_height;
  }
  std::strncpy(spec->format, image->input->format_name(), sizeof spec->format - 1);
  const std::string name = found.get_string_attribute("oiio:subimagename");
  std::strncpy(spec->part, name.c_str(), sizeof spec->part - 1);
  return true;
} catch (const std::exception &exception) {
  fail(error, exception.what(), "a part of the file cannot be read");
  return false;
} catch (...) {
  fail(error, "", "a part of the file cannot be read");
  return false;
}

extern "C" const char *fluxion_image_channel(void *handle, int index) {
  const auto &names = static_cast<OpenImage *>(handle)->input->spec().channelnames;
  return index >= 0 && static_cast<size_t>(index) < names.size() ? names[index].c_str() : nullptr;
}

extern "C" FluxionSampleType fluxion_image_channel_type(void *handle, int index) {
  const OIIO::ImageSpec &spec = static_cast<OpenImage *>(handle)->input->spec();
  const OIIO::TypeDesc type = spec.channelformat(index);
  if (type == OIIO::TypeDesc::UINT8) return FLUXION_UINT8;
  if (type == OIIO::TypeDesc::UINT16) return FLUXION_UINT16;
  if (type == OIIO::TypeDesc::UINT32) return FLUXION_UINT32;
  return type.is_floating_point() ? FLUXION_FLOAT : FLUXION_OTHER;
}

extern "C" const char *fluxion_image_attribute(void *handle, const char *name) try {
  auto *image = static_cast<OpenImage *>(handle);
  const OIIO::ParamValue *value = image->input->spec().find_attribute(name);
  if (!value) return nullptr;
  image->attribute = value->get_string();
  return image->attribute.c_str();
} catch (...) {
  return nullptr;
}

extern "C" bool fluxion_image_read_floats(void *handle, float *pixels, FluxionError *error) {
  return read_samples(handle, OIIO::TypeDesc::FLOAT, pixels, error);
}

extern "C" bool fluxion_image_read_bytes(void *handle, uint8_t *pixels, FluxionError *error) {
  return read_samples(handle, OIIO::TypeDesc::UINT8, pixels, error);
}

extern "C" void fluxion_image_close(void *handle) { delete static_cast<OpenImage *>(handle); }

extern "C" bool fluxion_image_write(const char *path, const FluxionImageSpec *wanted, const char *const *channels,
                                    const float *pixels, const char *kind, const char *compression,
                                    const FluxionAttribute *attributes, size_t attribute_count,
                                    FluxionError *error) try {
  auto output = OIIO::ImageOutput::create(path);
  if (!output) {
    fail(error, OIIO::geterror(), "no writer for this file name's extension");
    return false;
  }
  OIIO::ImageSpec spec(wanted->width, wanted->height, wanted->channels, type_of(kind));
  for (int i = 0; i < wanted->channels; ++i) spec.channelnames[i] = channels[i];
  for (int i = 0; i < wanted->channels; ++i) {
    if (spec.channelnames[i] == "A") spec.alpha_channel = i;
  }
  // Eight-bit formats have colours without their alpha, and are given them so.
  if (spec.alpha_channel >= 0 && spec.format == OIIO::TypeDesc::UINT8) spec.attribute("oiio:UnassociatedAlpha", 1);
  if (wanted->full_width > 0) {
    spec.x = wanted->x;
    spec.y = wanted->y;
    spec.full_width = wanted->full_width;
    spec.full_height = wanted->full_height;
  }
  if (compression) spec.attribute("compression", compression);
  for (size_t i = 0; i < attribute_count; ++i) spec.attribute(attributes[i].name, attributes[i].value);
  /* Formats do not look at what comes of their last bytes: on a full disk they would leave a part of a file and call it
   * done. So the file is ours. libjpeg even ends the program when it cannot write: images of eight bits, which are
   * small, are made in memory. */
  std::unique_ptr<std::FILE, int (*)(std::FILE *)> file(std::fopen(path, "wb"), std::fclose);
  if (!file) {
    fail(error, std::strerror(errno), "");
    return false;
  }
  OIIO::Filesystem::IOFile direct(file.get(), OIIO::Filesystem::IOProxy::Write);
  OIIO::Filesystem::IOVecOutput memory;
  OIIO::Filesystem::IOProxy *proxy = &direct;
  if (spec.format == OIIO::TypeDesc::UINT8) proxy = &memory;
  if (!output->set_ioproxy(proxy)) {
    fail(error, output->geterror(), "this format cannot be written safely");
    return false;
  }
  if (!output->open(path, spec) || !output->write_image(OIIO::TypeDesc::FLOAT, pixels)) {
    fail(error, output->geterror(), "the file could not be written");
    return false;
  }
  if (!output->close()) {
    fail(error, output->geterror(), "the file could not be finished");
    return false;
  }
  errno = 0;
  const auto &bytes = memory.buffer();
  bool whole = std::fwrite(bytes.data(), 1, bytes.size(), file.get()) == bytes.size();
  whole = std::fflush(file.get()) == 0 && !std::ferror(file.get()) && whole;
  whole = std::fclose(file.release()) == 0 && whole;
  if (!whole) fail(error, errno ? std::strerror(errno) : "", "the end of the file could not be written");
  return whole;
} catch (const std::exception &exception) {
  fail(error, exception.what(), "writing the image failed");
  return false;
} catch (...) {
  fail(error, "", "writing the image failed");
  return false;
}

extern "C" void *fluxion_texture_system_new(int megabytes) try {
  OIIO::TextureSystem *system = OIIO::TextureSystem::create(false);
  if (!system) return nullptr;
  system->attribute("max_memory_MB", static_cast<float>(megabytes));
  // Files in scanlines are cut into tiles as they are read.
  system->attribute("autotile", 64);
  system->attribute("automip", 0);
  system->attribute("unassociatedalpha", 1);
  return system;
} catch (...) {
  return nullptr;
}

extern "C" void fluxion_texture_system_release(void *system) {
  OIIO::TextureSystem::destroy(static_cast<OIIO::TextureSystem *>(system));
}

extern "C" void *fluxion_texture_open(void *handle, const char *path, FluxionError *error) try {
  auto *system = static_cast<OIIO::TextureSystem *>(handle);
  auto *texture = system->get_texture_handle(OIIO::ustring(path));
  if (texture && system->good(texture)) return texture;
  fail(error, system->geterror(), "the file is missing or of an unknown format");
  return nullptr;
} catch (const std::exception &exception) {
  fail(error, exception.what(), "opening the texture failed");
  return nullptr;
} catch (...) {
  fail(error, "", "opening the texture failed");
  return nullptr;
}

extern "C" bool fluxion_texture_texel(void *handle, void *texture, int x, int y, int channels, float *samples) try {
  auto *system = static_cast<OIIO::TextureSystem *>(handle);
  OIIO::TextureOpt options;
  return system->get_texels(static_cast<OIIO::TextureSystem::TextureHandle *>(texture), nullptr, options, 0, x, x + 1, y,
                            y + 1, 0, 1, 0, channels, OIIO::TypeDesc::FLOAT, samples);
} catch (...) {
  return false;
}
