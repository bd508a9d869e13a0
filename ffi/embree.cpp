#include "embree.h"

#if FLUXION_EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <cmath>
#include <cstring>
#include <limits>
#include <new>

namespace {

/* Keeps the caller's function beside its user pointer, so that ours can have Embree's own signature. */
struct Listener {
  FluxionErrorFunction function;
  void *user;
};

struct Device {
  RTCDevice device;
  Listener listener;
};

void forward_error(void *user, RTCError code, const char *message) {
  const Listener *listener = static_cast<const Listener *>(user);
  listener->function(listener->user, static_cast<int>(code), message ? message : "");
}

RTCDevice device_of(void *device) { return static_cast<Device *>(device)->device; }

RTCScene scene_of(void *scene) { return static_cast<RTCScene>(scene); }

uint32_t attach(void *scene, RTCGeometry geometry) {
  rtcCommitGeometry(geometry);
  const uint32_t id = rtcAttachGeometry(scene_of(scene), geometry);
  rtcReleaseGeometry(geometry);
  return id;
}

void quadric_bounds(const RTCBoundsFunctionArguments *args) {
  const FluxionQuadric *self = static_cast<const FluxionQuadric *>(args->geometryUserPtr);
  args->bounds_o->lower_x = self->lower[0];
  args->bounds_o->lower_y = self->lower[1];
  args->bounds_o->lower_z = self->lower[2];
  args->bounds_o->upper_x = self->upper[0];
  args->bounds_o->upper_y = self->upper[1];
  args->bounds_o->upper_z = self->upper[2];
}

void to_object(const FluxionQuadric *self, const double v[3], double w, double result[3]) {
  const float *m = self->to_object;
  for (int i = 0; i < 3; ++i) result[i] = m[i] * v[0] + m[3 + i] * v[1] + m[6 + i] * v[2] + m[9 + i] * w;
}

/* The nearest meeting of a ray with a quadric between `near` and `far`, in units of the direction; `far` if there is
 * none. Doubles: the roots of a distant cylinder cancel in floats. */
double quadric_meet(const FluxionQuadric *self, const double origin[3], const double direction[3], double near,
                           double far) {
  double o[3], d[3];
  to_object(self, origin, 1.0, o);
  to_object(self, direction, 0.0, d);
  if (self->kind == FLUXION_DISK) {
    const double t = -o[2] / d[2], x = o[0] + d[0] * t, y = o[1] + d[1] * t;
    return t > near && t < far && x * x + y * y <= 1.0 ? t : far;
  }
  const double a = d[0] * d[0] + d[1] * d[1], b = o[0] * d[0] + o[1] * d[1], c = o[0] * o[0] + o[1] * o[1] - 1.0;
  const double discriminant = b * b - a * c;
  if (!(a > 0.0 && discriminant >= 0.0)) return far;
  const double q = -(b + std::copysign(std::sqrt(discriminant), b));
  double roots[2] = {q / a, q != 0.0 ? c / q : q / a};
  if (roots[0] > roots[1]) {
    const double larger = roots[0];
    roots[0] = roots[1];
    roots[1] = larger;
  }
  for (int i = 0; i < 2; ++i) {
    const double z = o[2] + d[2] * roots[i];
    if (roots[i] > near && roots[i] < far && z >= 0.0 && z <= 1.0) return roots[i];
  }
  return far;
}

double quadric_meet_lane(const FluxionQuadric *self, RTCRayN *ray, unsigned n, unsigned i) {
  const double origin[3] = {RTCRayN_org_x(ray, n, i), RTCRayN_org_y(ray, n, i), RTCRayN_org_z(ray, n, i)};
  const double direction[3] = {RTCRayN_dir_x(ray, n, i), RTCRayN_dir_y(ray, n, i), RTCRayN_dir_z(ray, n, i)};
  return quadric_meet(self, origin, direction, RTCRayN_tnear(ray, n, i), RTCRayN_tfar(ray, n, i));
}

void quadric_intersect(const RTCIntersectFunctionNArguments *args) {
  RTCRayN *ray = RTCRayHitN_RayN(args->rayhit, args->N);
  RTCHitN *hit = RTCRayHitN_HitN(args->rayhit, args->N);
  for (unsigned i = 0; i < args->N; ++i) {
    if (!args->valid[i]) continue;
    const double t = quadric_meet_lane(static_cast<const FluxionQuadric *>(args->geometryUserPtr), ray, args->N, i);
    if (!(t < RTCRayN_tfar(ray, args->N, i))) continue;
    RTCRayN_tfar(ray, args->N, i) = (float)t;
    RTCHitN_u(hit, args->N, i) = 0.0f;
    RTCHitN_v(hit, args->N, i) = 0.0f;
    RTCHitN_Ng_x(hit, args->N, i) = 0.0f;
    RTCHitN_Ng_y(hit, args->N, i) = 0.0f;
    RTCHitN_Ng_z(hit, args->N, i) = 0.0f;
    RTCHitN_geomID(hit, args->N, i) = args->geomID;
    RTCHitN_primID(hit, args->N, i) = args->primID;
    RTCHitN_instID(hit, args->N, i, 0) = args->context->instID[0];
  }
}

void quadric_occluded(const RTCOccludedFunctionNArguments *args) {
  for (unsigned i = 0; i < args->N; ++i) {
    if (!args->valid[i]) continue;
    const double t = quadric_meet_lane(static_cast<const FluxionQuadric *>(args->geometryUserPtr), args->ray, args->N, i);
    if (t < RTCRayN_tfar(args->ray, args->N, i)) RTCRayN_tfar(args->ray, args->N, i) = -std::numeric_limits<float>::infinity();
  }
}

RTCRay to_rtc(const FluxionRay *ray) {
  RTCRay r;
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

/* Rejects hits from inside of a curve and on its caps, where `u` is that of an end. */
void curve_filter(const RTCFilterFunctionNArguments *args) {
  const uint8_t *ends = static_cast<const uint8_t *>(args->geometryUserPtr);
  const unsigned n = args->N;
  for (unsigned i = 0; i < n; ++i) {
    if (!args->valid[i]) continue;
    const float leaving = RTCRayN_dir_x(args->ray, n, i) * RTCHitN_Ng_x(args->hit, n, i) +
                          RTCRayN_dir_y(args->ray, n, i) * RTCHitN_Ng_y(args->hit, n, i) +
                          RTCRayN_dir_z(args->ray, n, i) * RTCHitN_Ng_z(args->hit, n, i);
    const float u = RTCHitN_u(args->hit, n, i);
    const uint8_t end = ends[RTCHitN_primID(args->hit, n, i)];
    const bool cap = (u <= 0.0f && (end & 1)) || (u >= 1.0f && (end & 2));
    if (leaving >= 0.0f || cap) args->valid[i] = 0;
  }
}

/* Embree's packets of N rays. */
template <int N> struct Packet;

#define FLUXION_PACKET_OF(N)                            \
  template <> struct Packet<N> {                        \
    using Ray = RTCRay##N;                              \
    using RayHit = RTCRayHit##N;                        \
    static constexpr auto intersect = rtcIntersect##N;  \
    static constexpr auto occluded = rtcOccluded##N;    \
  };
FLUXION_PACKET_OF(4)
FLUXION_PACKET_OF(8)
FLUXION_PACKET_OF(16)
#undef FLUXION_PACKET_OF

template <class T, int N> void copy(T (&to)[N], const T *from) { std::memcpy(to, from, sizeof to); }

template <class T, int N> void copy(T *to, const T (&from)[N]) { std::memcpy(to, from, sizeof from); }

/* Copies N rays from `first` on; returns whether any is active. The interval of inactive ones is empty: where Embree has
 * no packets of this width of its own, it ignores `valid`. */
template <int N> bool to_rtc(const FluxionRays *rays, int first, typename Packet<N>::Ray *r, int (&valid)[N]) {
  copy(r->org_x, rays->origin[0] + first);
  copy(r->org_y, rays->origin[1] + first);
  copy(r->org_z, rays->origin[2] + first);
  copy(r->dir_x, rays->direction[0] + first);
  copy(r->dir_y, rays->direction[1] + first);
  copy(r->dir_z, rays->direction[2] + first);
  const uint32_t *active = rays->active + first;
  const float *t_far = rays->t_far + first;
  uint32_t any = 0;
  for (int i = 0; i < N; ++i) {
    any |= active[i];
    valid[i] = static_cast<int>(active[i]);
    r->tnear[i] = active[i] ? 0.0f : std::numeric_limits<float>::infinity();
    r->tfar[i] = active[i] ? t_far[i] : -std::numeric_limits<float>::infinity();
    r->time[i] = 0.0f;
    r->mask[i] = 0xffffffffu;
    r->id[i] = 0;
    r->flags[i] = 0;
  }
  return any != 0;
}

template <int N> void intersect(RTCScene scene, const FluxionRays *rays, bool coherent, FluxionHits *hits) {
#if FLUXION_EMBREE_MAJOR >= 4
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  if (coherent) arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  if (coherent) context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
#endif
  for (int first = 0; first < FLUXION_PACKET; first += N) {
    typename Packet<N>::RayHit query;
    alignas(4 * N) int valid[N];
    const bool any = to_rtc<N>(rays, first, &query.ray, valid);
    /* What rays that meet nothing leave there is copied, too. */
    std::memset(&query.hit, 0, sizeof query.hit);
    for (int i = 0; i < N; ++i) {
      query.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      query.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    if (any) {
#if FLUXION_EMBREE_MAJOR >= 4
      Packet<N>::intersect(valid, scene, &query, &arguments);
#else
      Packet<N>::intersect(valid, scene, &context, &query);
#endif
    }
    copy(hits->t + first, query.ray.tfar);
    copy(hits->u + first, query.hit.u);
    copy(hits->v + first, query.hit.v);
    copy(hits->geometry + first, query.hit.geomID);
    copy(hits->primitive + first, query.hit.primID);
    copy(hits->instance + first, query.hit.instID[0]);
  }
}

template <int N> void occluded(RTCScene scene, const FluxionRays *rays, uint32_t *blocked) {
#if FLUXION_EMBREE_MAJOR < 4
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
#endif
  for (int first = 0; first < FLUXION_PACKET; first += N) {
    typename Packet<N>::Ray query;
    alignas(4 * N) int valid[N];
    if (to_rtc<N>(rays, first, &query, valid)) {
#if FLUXION_EMBREE_MAJOR >= 4
      Packet<N>::occluded(valid, scene, &query, nullptr);
#else
      Packet<N>::occluded(valid, scene, &context, &query);
#endif
    }
    for (int i = 0; i < N; ++i) blocked[first + i] = valid[i] && query.tfar[i] < 0.0f ? 0xffffffffu : 0;
  }
}

}  // namespace

void *fluxion_device_new(const char *config, FluxionErrorFunction function, void *user) {
  Device *self = new (std::nothrow) Device;
  if (!self) return nullptr;
  self->listener.function = function;
  self->listener.user = user;
  self->device = rtcNewDevice(config);
  if (!self->device) {
    function(user, (int)rtcGetDeviceError(nullptr), "no Embree device could be made");
    delete self;
    return NULL;
  }
  rtcSetDeviceErrorFunction(self->device, forward_error, &self->listener);
  return self;
}

void fluxion_device_release(void *device) {
  Device *self = static_cast<Device *>(device);
  rtcReleaseDevice(self->device);
  delete self;
}

int fluxion_embree_version(void *device) {
  return (int)rtcGetDeviceProperty(device_of(device), RTC_DEVICE_PROPERTY_VERSION);
}

void *fluxion_scene_new(void *device) { return rtcNewScene(device_of(device)); }

uint32_t fluxion_scene_add_triangles(void *device, void *scene, const float *vertices, size_t vertex_count,
                                     const uint32_t *indices, size_t triangle_count) {
  RTCGeometry geometry = rtcNewGeometry(device_of(device), RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, vertices, 0, 12, vertex_count);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, indices, 0, 12, triangle_count);
  return attach(scene, geometry);
}

uint32_t fluxion_scene_add_spheres(void *device, void *scene, const float *spheres, size_t count) {
  RTCGeometry geometry = rtcNewGeometry(device_of(device), RTC_GEOMETRY_TYPE_SPHERE_POINT);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, spheres, 0, 16, count);
  return attach(scene, geometry);
}

uint32_t fluxion_scene_add_quadric(void *device, void *scene, const FluxionQuadric *quadric) {
  RTCGeometry geometry = rtcNewGeometry(device_of(device), RTC_GEOMETRY_TYPE_USER);
  rtcSetGeometryUserPrimitiveCount(geometry, 1);
  rtcSetGeometryUserData(geometry, const_cast<FluxionQuadric *>(quadric));
  rtcSetGeometryBoundsFunction(geometry, quadric_bounds, nullptr);
  rtcSetGeometryIntersectFunction(geometry, quadric_intersect);
  rtcSetGeometryOccludedFunction(geometry, quadric_occluded);
  return attach(scene, geometry);
}

uint32_t fluxion_scene_add_curves(void *device, void *scene, FluxionCurveKind kind, const float *points,
                                  size_t point_count, const uint32_t *starts, const uint8_t *ends,
                                  size_t segment_count) {
  const RTCGeometryType type =
      kind == FLUXION_BSPLINE ? RTC_GEOMETRY_TYPE_ROUND_BSPLINE_CURVE : RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE;
  RTCGeometry geometry = rtcNewGeometry(device_of(device), type);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, points, 0, 16, point_count);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, starts, 0, 4, segment_count);
  if (kind == FLUXION_LINEAR) {
    uint8_t *flags = static_cast<uint8_t *>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_FLAGS, 0, RTC_FORMAT_UCHAR, 1, segment_count));
    for (size_t i = 0; flags && i < segment_count; ++i) {
      flags[i] = static_cast<uint8_t>((ends[i] & 1 ? 0 : RTC_CURVE_FLAG_NEIGHBOR_LEFT) |
                                      (ends[i] & 2 ? 0 : RTC_CURVE_FLAG_NEIGHBOR_RIGHT));
    }
  }
  rtcSetGeometryUserData(geometry, const_cast<uint8_t *>(ends));
  rtcSetGeometryIntersectFilterFunction(geometry, curve_filter);
  rtcSetGeometryOccludedFilterFunction(geometry, curve_filter);
  return attach(scene, geometry);
}

uint32_t fluxion_scene_add_instance(void *device, void *scene, void *child, const float to_world[16]) {
  RTCGeometry geometry = rtcNewGeometry(device_of(device), RTC_GEOMETRY_TYPE_INSTANCE);
  rtcSetGeometryInstancedScene(geometry, scene_of(child));
  rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, to_world);
  return attach(scene, geometry);
}

void fluxion_scene_commit(void *scene) { rtcCommitScene(scene_of(scene)); }

void fluxion_scene_release(void *scene) { rtcReleaseScene(scene_of(scene)); }

bool fluxion_intersect(void *scene, const FluxionRay *ray, FluxionHit *hit) {
  RTCRayHit query;
  query.ray = to_rtc(ray);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#if FLUXION_EMBREE_MAJOR >= 4
  rtcIntersect1(scene_of(scene), &query, nullptr);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene_of(scene), &context, &query);
#endif
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
  hit->t = query.ray.tfar;
  hit->u = query.hit.u;
  hit->v = query.hit.v;
  hit->geometry = query.hit.geomID;
  hit->primitive = query.hit.primID;
  hit->instance = query.hit.instID[0];
  return true;
}

bool fluxion_occluded(void *scene, const FluxionRay *ray) {
  RTCRay query = to_rtc(ray);
#if FLUXION_EMBREE_MAJOR >= 4
  rtcOccluded1(scene_of(scene), &query, nullptr);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene_of(scene), &context, &query);
#endif
  /* Embree marks an occluded ray with a far end of minus infinity. */
  return query.tfar < 0.0f;
}

int fluxion_packet_width(void *device) {
  if (rtcGetDeviceProperty(device_of(device), RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)) return 16;
  return rtcGetDeviceProperty(device_of(device), RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) ? 8 : 4;
}

void fluxion_intersect_packet(void *scene, int width, const FluxionRays *rays, bool coherent, FluxionHits *hits) {
  switch (width) {
    case 16: return intersect<16>(scene_of(scene), rays, coherent, hits);
    case 8: return intersect<8>(scene_of(scene), rays, coherent, hits);
    default: return intersect<4>(scene_of(scene), rays, coherent, hits);
  }
}

void fluxion_occluded_packet(void *scene, int width, const FluxionRays *rays, uint32_t blocked[FLUXION_PACKET]) {
  switch (width) {
    case 16: return occluded<16>(scene_of(scene), rays, blocked);
    case 8: return occluded<8>(scene_of(scene), rays, blocked);
    default: return occluded<4>(scene_of(scene), rays, blocked);
  }
}
