/* The part of Embree that Fluxion uses, the same for Embree 3.13 and 4.x.
 *
 * Rays and hits are our own structures: the layout of RTCRayHit differs between Embree releases, and copying
 * one costs nothing beside a traversal. Functions that build report failure through the error callback. */
#ifndef FLUXION_EMBREE_H
#define FLUXION_EMBREE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct FluxionRay {
  float origin[3];
  float t_near;
  float direction[3];
  float t_far;
} FluxionRay;

/* Barycentric u and v weigh the second and the third vertex; for spheres they are unused.
 * `normal` is not normalised. */
typedef struct FluxionHit {
  float t;
  float u;
  float v;
  uint32_t geometry;
  uint32_t primitive;
  float normal[3];
} FluxionHit;

typedef void (*FluxionErrorFunction)(void *user, int code, const char *message);

void *fluxion_device_new(const char *config, FluxionErrorFunction function, void *user);
void fluxion_device_release(void *device);
int fluxion_embree_version(void *device);

void *fluxion_scene_new(void *device);
/* Buffers are shared: they must outlive the scene. `vertices` holds count * 3 floats and four readable bytes
 * behind them; `indices` holds count * 3. Both return the identifier that hits carry. */
uint32_t fluxion_scene_add_triangles(void *device, void *scene, const float *vertices, size_t vertex_count,
                                     const uint32_t *indices, size_t triangle_count);
/* `spheres` holds count * 4 floats: centre and radius. */
uint32_t fluxion_scene_add_spheres(void *device, void *scene, const float *spheres, size_t count);
void fluxion_scene_commit(void *scene);
void fluxion_scene_bounds(void *scene, float lower[3], float upper[3]);
void fluxion_scene_release(void *scene);

bool fluxion_intersect(void *scene, const FluxionRay *ray, FluxionHit *hit);
bool fluxion_occluded(void *scene, const FluxionRay *ray);

#ifdef __cplusplus
}
#endif
#endif
