#include "embree.h"

#if FLUXION_EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <stdlib.h>

static void forward_error(void *user, enum RTCError code, const char *message);

/* Keeps the caller's function beside its user pointer, so that ours can have Embree's own signature. */
typedef struct Listener {
  FluxionErrorFunction function;
  void *user;
} Listener;

typedef struct Device {
  RTCDevice device;
  Listener listener;
} Device;

static void forward_error(void *user, enum RTCError code, const char *message) {
  const Listener *listener = user;
  listener->function(listener->user, (int)code, message ? message : "");
}

void *fluxion_device_new(const char *config, FluxionErrorFunction function, void *user) {
  Device *self = malloc(sizeof *self);
  if (!self) return NULL;
  self->listener.function = function;
  self->listener.user = user;
  self->device = rtcNewDevice(config);
  if (!self->device) {
    function(user, (int)rtcGetDeviceError(NULL), "no Embree device could be made");
    free(self);
    return NULL;
  }
  rtcSetDeviceErrorFunction(self->device, forward_error, &self->listener);
  return self;
}

void fluxion_device_release(void *device) {
  Device *self = device;
  rtcReleaseDevice(self->device);
  free(self);
}

int fluxion_embree_version(void *device) {
  return (int)rtcGetDeviceProperty(((Device *)device)->device, RTC_DEVICE_PROPERTY_VERSION);
}

void *fluxion_scene_new(void *device) { return rtcNewScene(((Device *)device)->device); }

static uint32_t attach(RTCScene scene, RTCGeometry geometry) {
  rtcCommitGeometry(geometry);
  uint32_t id = rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
  return id;
}

uint32_t fluxion_scene_add_triangles(void *device, void *scene, const float *vertices, size_t vertex_count,
                                     const uint32_t *indices, size_t triangle_count) {
  RTCGeometry geometry = rtcNewGeometry(((Device *)device)->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, vertices, 0, 12, vertex_count);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, indices, 0, 12, triangle_count);
  return attach(scene, geometry);
}

uint32_t fluxion_scene_add_spheres(void *device, void *scene, const float *spheres, size_t count) {
  RTCGeometry geometry = rtcNewGeometry(((Device *)device)->device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, spheres, 0, 16, count);
  return attach(scene, geometry);
}

void fluxion_scene_commit(void *scene) { rtcCommitScene(scene); }

void fluxion_scene_bounds(void *scene, float lower[3], float upper[3]) {
  struct RTCBounds bounds;
  rtcGetSceneBounds(scene, &bounds);
  lower[0] = bounds.lower_x;
  lower[1] = bounds.lower_y;
  lower[2] = bounds.lower_z;
  upper[0] = bounds.upper_x;
  upper[1] = bounds.upper_y;
  upper[2] = bounds.upper_z;
}

void fluxion_scene_release(void *scene) { rtcReleaseScene(scene); }

static struct RTCRay to_rtc(const FluxionRay *ray) {
  struct RTCRay r;
  r.org_x = ray->origin[0];
  r.org_y = ray->origin[1];
  r.org_z = ray->origin[2];
  r.tnear = ray->t_near;
  r.dir_x = ray->direction[0];
  r.dir_y = ray->direction[1];
  r.dir_z = ray->direction[2];
  r.time = 0.0f;
  r.tfar = ray->t_far;
  r.mask = 0xffffffffu;
  r.id = 0;
  r.flags = 0;
  return r;
}

bool fluxion_intersect(void *scene, const FluxionRay *ray, FluxionHit *hit) {
  struct RTCRayHit query;
  query.ray = to_rtc(ray);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#if FLUXION_EMBREE_MAJOR >= 4
  rtcIntersect1(scene, &query, NULL);
#else
  struct RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene, &context, &query);
#endif
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
  hit->t = query.ray.tfar;
  hit->u = query.hit.u;
  hit->v = query.hit.v;
  hit->geometry = query.hit.geomID;
  hit->primitive = query.hit.primID;
  hit->normal[0] = query.hit.Ng_x;
  hit->normal[1] = query.hit.Ng_y;
  hit->normal[2] = query.hit.Ng_z;
  return true;
}

bool fluxion_occluded(void *scene, const FluxionRay *ray) {
  struct RTCRay query = to_rtc(ray);
#if FLUXION_EMBREE_MAJOR >= 4
  rtcOccluded1(scene, &query, NULL);
#else
  struct RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene, &context, &query);
#endif
  /* Embree marks an occluded ray with a far end of minus infinity. */
  return query.tfar < 0.0f;
}
