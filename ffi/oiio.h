/* Reading and writing images with OpenImageIO, behind a C interface that no C++ exception crosses.
 * Functions that can fail return false or null and leave a message in `error`, never an empty one. */
#ifndef FLUXION_OIIO_H
#define FLUXION_OIIO_H

#include <stdbool.h>
#include <stddef.h>

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
  /* Whether every sample is stored in eight bits. */
  bool eight_bit;
} FluxionImageSpec;

typedef struct FluxionAttribute {
  const char *name;
  const char *value;
} FluxionAttribute;

void *fluxion_image_open(const char *path, FluxionImageSpec *spec, FluxionError *error);
/* The strings belong to the open image. Null when there is no such channel or attribute. */
const char *fluxion_image_channel(void *image, int index);
const char *fluxion_image_attribute(void *image, const char *name);
/* Fills width * height * channels floats, rows from the top, channels interleaved. */
bool fluxion_image_read(void *image, float *pixels, FluxionError *error);
void fluxion_image_close(void *image);

/* `kind` is "float", "half" or "uint8"; `compression` may be null for the format's default. */
bool fluxion_image_write(const char *path, const FluxionImageSpec *spec, const char *const *channels,
                         const float *pixels, const char *kind, const char *compression,
                         const FluxionAttribute *attributes, size_t attribute_count, FluxionError *error);

#ifdef __cplusplus
}
#endif
#endif
