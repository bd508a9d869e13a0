/* Reading and writing images with OpenImageIO, behind a C interface that no C++ exception crosses.
 * Functions that can fail return false or null and leave a message in `error`, never an empty one. */
#ifndef FLUXION_OIIO_H
#define FLUXION_OIIO_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct FluxionError {
  char message[512];
} FluxionError;

typedef struct FluxionImageSpec {
  int width;
  int height;
  int channels;
  /* Upper left corner of the pixels that are there. */
  int x;
  int y;
  /* The whole picture, whose upper left corner is (0, 0); zero when the pixels that are there are all of it. */
  int full_width;
  int full_height;
  /* OpenImageIO's name of the file format. */
  char format[16];
  /* Name of the part; may be empty. */
  char part[256];
  /* Whether pixels are lists of samples at different depths, which cannot be read. */
  bool deep;
} FluxionImageSpec;

/* How the samples of a channel are stored. */
typedef enum FluxionSampleType {
  FLUXION_FLOAT,
  FLUXION_UINT8,
  FLUXION_UINT16,
  FLUXION_UINT32,
  FLUXION_OTHER
} FluxionSampleType;

typedef struct FluxionAttribute {
  const char *name;
  const char *value;
} FluxionAttribute;

/* More parts than this are taken for a damaged file. */
#define FLUXION_MAX_PARTS 1024

void *fluxion_image_open(const char *path, FluxionError *error);
/* Number of the parts of an open image: one, but for some exr files. */
int fluxion_image_parts(void *image);
/* Goes to a part, which what follows is about, and describes it. */
bool fluxion_image_part(void *image, int part, FluxionImageSpec *spec, FluxionError *error);
/* The strings belong to the open image. Null when there is no such channel or attribute. */
const char *fluxion_image_channel(void *image, int index);
const char *fluxion_image_attribute(void *image, const char *name);
FluxionSampleType fluxion_image_channel_type(void *image, int index);
/* Fill width * height * channels samples, rows from the top, channels interleaved. */
bool fluxion_image_read_floats(void *image, float *pixels, FluxionError *error);
bool fluxion_image_read_bytes(void *image, uint8_t *pixels, FluxionError *error);
void fluxion_image_close(void *image);

/* `kind` is "float", "half" or "uint8"; `compression` may be null for the format's default. */
bool fluxion_image_write(const char *path, const FluxionImageSpec *spec, const char *const *channels,
                         const float *pixels, const char *kind, const char *compression,
                         const FluxionAttribute *attributes, size_t attribute_count, FluxionError *error);

/* A cache of image files that keeps at most so many megabytes of tiles in memory. Null when it cannot be made. */
void *fluxion_texture_system_new(int megabytes);
void fluxion_texture_system_release(void *system);
/* A file of a system, which keeps it. Null on failure. */
void *fluxion_texture_open(void *system, const char *path, FluxionError *error);
/* The samples of one pixel of an open file, by its place in the file, from the first channel on. False when it cannot be read. */
bool fluxion_texture_texel(void *system, void *texture, int x, int y, int channels, float *samples);

#ifdef __cplusplus
}
#endif
#endif
