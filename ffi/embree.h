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

/* Barycentric u and v weigh the second and the third vertex; for other shapes they are unused.
 * `instance` is the identifier of the instance that was entered, or FLUXION_NO_INSTANCE. */
#define FLUXION_NO_INSTANCE 0xffffffffu

typedef struct FluxionHit {
  float t;
  float u;
  float v;
  uint32_t geometry;
  uint32_t primitive;
  uint32_t instance;
} FluxionHit;

/* Sixteen rays from `t_near` 0 on, coordinate by coordinate, and what they meet; `active` has all bits of a ray's
 * word or none. The geometry of a ray that meets nothing is FLUXION_NO_GEOMETRY; inactive rays have no hit. */
#define FLUXION_PACKET 16
#define FLUXION_NO_GEOMETRY 0xffffffffu

typedef struct FluxionRays {
  float origin[3][FLUXION_PACKET];
  float direction[3][FLUXION_PACKET];
  float t_far[FLUXION_PACKET];
  uint32_t active[FLUXION_PACKET];
} FluxionRays;

typedef struct FluxionHits {
  float t[FLUXION_PACKET];
  float u[FLUXION_PACKET];
  float v[FLUXION_PACKET];
  uint32_t geometry[FLUXION_PACKET];
  uint32_t primitive[FLUXION_PACKET];
  uint32_t instance[FLUXION_PACKET];
} FluxionHits;

typedef enum FluxionQuadricKind {
  FLUXION_DISK,    /* x² + y² <= 1 in the plane z = 0 */
  FLUXION_CYLINDER /* x² + y² = 1 for z in [0, 1], open at both ends */
} FluxionQuadricKind;

/* `to_object` holds the columns x, y, z and translation; the box is the world's. */
typedef struct FluxionQuadric {
  FluxionQuadricKind kind;
  float to_object[12];
  float lower[3];
  float upper[3];
} FluxionQuadric;

typedef enum FluxionCurveKind { FLUXION_BSPLINE, FLUXION_LINEAR } FluxionCurveKind;

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
/* The quadric must outlive the scene. */
uint32_t fluxion_scene_add_quadric(void *device, void *scene, const FluxionQuadric *quadric);
/* `points` holds count * 4 floats: position and radius; `starts` the first point of every segment, which takes four of a B-spline
 * and two of a straight piece. `ends` has bit 1 for the first segment of a curve and bit 2 for the last; it must outlive the scene,
 * as the others. Only the outside is there, and no caps. */
uint32_t fluxion_scene_add_curves(void *device, void *scene, FluxionCurveKind kind, const float *points,
                                  size_t point_count, const uint32_t *starts, const uint8_t *ends,
                                  size_t segment_count);
/* Another, committed scene of the same device, placed by 16 floats column by column. */
uint32_t fluxion_scene_add_instance(void *device, void *scene, void *child, const float to_world[16]);
void fluxion_scene_commit(void *scene);
void fluxion_scene_release(void *scene);

bool fluxion_intersect(void *scene, const FluxionRay *ray, FluxionHit *hit);
bool fluxion_occluded(void *scene, const FluxionRay *ray);
/* The largest number of rays, 4, 8 or 16, that the device traces as one packet; packets are traced in parts of it. */
int fluxion_packet_width(void *device);
/* `coherent`: the rays start close together and run side by side, as those of a camera. */
void fluxion_intersect_packet(void *scene, int width, const FluxionRays *rays, bool coherent, FluxionHits *hits);
/* `blocked` gets all bits of a blocked ray's word. */
void fluxion_occluded_packet(void *scene, int width, const FluxionRays *rays, uint32_t blocked[FLUXION_PACKET]);

#ifdef __cplusplus
}
#endif
#endif
