//! Embree as types that only allow the right order: [`Device`] → [`SceneBuilder`] → [`Committed`].
//!
//! Geometry is added to a builder, and committing consumes it; only a committed scene can be traced:
//!
//! ```compile_fail
//! # use fluxion::ffi::embree::{Device, Ray};
//! let builder = Device::new(1)?.scene();
//! builder.intersect(&Ray::default()); // error: nothing is traced before commit
//! # Ok::<(), fluxion::error::Error>(())
//! ```
//! ```compile_fail
//! # use fluxion::ffi::embree::Device;
//! let mut builder = Device::new(1)?.scene();
//! let scene = builder.commit()?;
//! builder.add_spheres(vec![]); // error: nothing is added after commit
//! # Ok::<(), fluxion::error::Error>(())
//! ```
//!
//! Buffers are shared with Embree without a copy; the committed scene keeps them alive.
#![allow(unsafe_code)]

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::sync::{Arc, Mutex};

use super::raw::embree as raw;
use crate::error::{Error, Result};
use crate::sync::lock;

/// B-splines or straight pieces.
pub use raw::FluxionCurveKind as CurveKind;
/// The first intersection of a ray.
pub use raw::FluxionHit as Hit;
/// A disk or a cylinder.
pub use raw::FluxionQuadric as Quadric;
pub use raw::FluxionQuadricKind as QuadricKind;
/// A ray; `t` counts in units of the direction's length, which need not be one.
pub use raw::FluxionRay as Ray;

/// First intersections of sixteen rays.
pub use raw::FluxionHits as Hits;
/// Sixteen rays, coordinate by coordinate.
pub use raw::FluxionRays as Rays;

/// Messages of Embree's error callback, kept until the call that caused them has returned.
type Reported = Mutex<Option<String>>;

/// RTC_ERROR_OUT_OF_MEMORY.
const OUT_OF_MEMORY: c_int = 4;

/// A handle that is released once, after everything built from it.
struct DeviceHandle {
    raw: *mut c_void,
    /// Boxed: Embree holds its address.
    reported: Box<Reported>,
}

// SAFETY: Embree's device and scene functions may be called from any thread; the reported error is behind a mutex.
unsafe impl Send for DeviceHandle {}
// SAFETY: as above.
unsafe impl Sync for DeviceHandle {}

impl DeviceHandle {
    fn check(&self) -> Result<()> {
        let mut reported = lock(&self.reported);
        reported.take().map_or(Ok(()), |message| Err(Error::backend("embree", message)))
    }
}

impl Drop for DeviceHandle {
    fn drop(&mut self) {
        // SAFETY: `raw` came from fluxion_device_new and is released exactly once.
        unsafe { raw::fluxion_device_release(self.raw) }
    }
}

unsafe extern "C" fn remember(user: *mut c_void, code: c_int, message: *const c_char) {
    // SAFETY: Embree passes back the address of the reported error given at creation, and a NUL-terminated string.
    let (reported, message) = unsafe { (&*user.cast::<Reported>(), CStr::from_ptr(message)) };
    let mut slot = lock(reported);
    let message = message.to_string_lossy();
    // Embree's own message says only that something failed.
    let memory = if code == OUT_OF_MEMORY { ": out of memory" } else { "" };
    slot.get_or_insert_with(|| format!("{message}{memory} (error code {code})"));
}

/// An Embree device: its threads and its error channel.
pub struct Device(Arc<DeviceHandle>);

impl Device {
    /// A device that builds with `threads` threads (0: all). The environment variable `FLUXION_EMBREE` may hold more of its
    /// configuration, as `isa=avx2`.
    pub fn new(threads: usize) -> Result<Self> {
        let more = std::env::var("FLUXION_EMBREE").unwrap_or_default();
        Self::with_config(&format!("threads={threads},{more}"))
    }

    /// A device with a configuration string in Embree's own syntax.
    pub fn with_config(config: &str) -> Result<Self> {
        let config = CString::new(config).map_err(|_| Error::backend("embree", "configuration holds a NUL byte"))?;
        let reported = Box::new(Mutex::new(None));
        let user = std::ptr::from_ref::<Reported>(&reported).cast_mut().cast();
        // SAFETY: the string lives through the call; the reported error is boxed and outlives the device.
        let raw = unsafe { raw::fluxion_device_new(config.as_ptr(), Some(remember), user) };
        if raw.is_null() {
            let message = reported.lock().ok().and_then(|mut slot| slot.take());
            return Err(Error::backend("embree", message.unwrap_or_else(|| "out of memory".into())));
        }
        let device = Self(Arc::new(DeviceHandle { raw, reported }));
        device.0.check()?;
        Ok(device)
    }

    /// Embree's version: major, minor, patch.
    pub fn version(&self) -> (u32, u32, u32) {
        // SAFETY: the device is alive.
        let version = unsafe { raw::fluxion_embree_version(self.0.raw) }.unsigned_abs();
        (version / 10000, version / 100 % 100, version % 100)
    }

    /// An empty scene to fill.
    pub fn scene(&self) -> SceneBuilder {
        let device = Arc::clone(&self.0);
        // SAFETY: the device is alive, and the builder keeps it so.
        let (raw, packet_width) =
            unsafe { (raw::fluxion_scene_new(device.raw), raw::fluxion_packet_width(device.raw)) };
        SceneBuilder(SceneHandle { raw, packet_width, buffers: Vec::new(), device })
    }
}

/// Buffers that a scene's geometry refers to.
enum Buffer {
    Triangles { _vertices: Arc<PaddedVertices>, _indices: Arc<Vec<[u32; 3]>> },
    Spheres { _spheres: Vec<[f32; 4]> },
    Quadric { _quadric: Box<Quadric> },
    Curves { _curves: Arc<CurveData> },
    Instance { _child: Arc<Committed> },
}

impl Hit {
    /// The instance that was entered, if the surface is in one.
    pub fn instance(&self) -> Option<u32> {
        (self.instance != raw::FLUXION_NO_INSTANCE).then_some(self.instance)
    }
}

impl Hits {
    /// First intersection of a ray, if any.
    #[inline]
    pub fn get(&self, lane: usize) -> Option<Hit> {
        (self.geometry[lane] != raw::FLUXION_NO_GEOMETRY).then(|| Hit {
            t: self.t[lane],
            u: self.u[lane],
            v: self.v[lane],
            geometry: self.geometry[lane],
            primitive: self.primitive[lane],
            instance: self.instance[lane],
        })
    }
}

/// Round curves as segments of control points.
pub struct CurveData {
    /// B-splines or straight pieces.
    pub kind: CurveKind,
    /// Positions and radii.
    pub points: Vec<[f32; 4]>,
    /// Number of the first point of every segment.
    pub starts: Vec<u32>,
    /// Bit 1 for the first segment of a curve, and bit 2 for the last.
    pub ends: Vec<u8>,
}

impl CurveData {
    /// Number of points of a segment.
    pub fn segment_length(&self) -> usize {
        if self.kind == CurveKind::FLUXION_BSPLINE { 4 } else { 2 }
    }
}

struct SceneHandle {
    raw: *mut c_void,
    packet_width: c_int,
    buffers: Vec<Buffer>,
    device: Arc<DeviceHandle>,
}

// SAFETY: a committed scene is only read, which Embree allows from any number of threads.
unsafe impl Send for SceneHandle {}
// SAFETY: as above.
unsafe impl Sync for SceneHandle {}

impl Drop for SceneHandle {
    fn drop(&mut self) {
        // SAFETY: released once; the buffers and the device are dropped after this.
        unsafe { raw::fluxion_scene_release(self.raw) }
    }
}

/// Vertex positions followed by one more float, which Embree's 16-byte loads may read.
pub struct PaddedVertices {
    floats: Vec<f32>,
}

impl PaddedVertices {
    /// Flattens `vertices` and adds the padding.
    pub fn new(vertices: impl ExactSizeIterator<Item = [f32; 3]>) -> Self {
        let mut floats = Vec::with_capacity(vertices.len() * 3 + 1);
        vertices.for_each(|vertex| floats.extend_from_slice(&vertex));
        floats.push(0.0);
        Self { floats }
    }

    /// Number of vertices.
    pub fn len(&self) -> usize {
        self.floats.len() / 3
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Position of vertex `index`.
    pub fn get(&self, index: u32) -> [f32; 3] {
        let at = index as usize * 3;
        [self.floats[at], self.floats[at + 1], self.floats[at + 2]]
    }
}

/// A scene that is still being filled.
pub struct SceneBuilder(SceneHandle);

impl SceneBuilder {
    /// Adds a triangle mesh and returns its geometry number. Every index must be below the vertex count.
    pub fn add_triangles(&mut self, vertices: &Arc<PaddedVertices>, indices: &Arc<Vec<[u32; 3]>>) -> Result<u32> {
        if indices.iter().flatten().any(|&index| index as usize >= vertices.len()) {
            return Err(Error::backend("embree", "a triangle names a vertex that does not exist"));
        }
        // SAFETY: both buffers have the stated lengths, the vertices are padded, every index is in range, and
        // `self.0.buffers` keeps them alive and unmoved (they are behind Arcs) until the scene is released.
        let id = unsafe {
            raw::fluxion_scene_add_triangles(
                self.0.device.raw,
                self.0.raw,
                vertices.floats.as_ptr(),
                vertices.len(),
                indices.as_ptr().cast(),
                indices.len(),
            )
        };
        let kept = Buffer::Triangles { _vertices: Arc::clone(vertices), _indices: Arc::clone(indices) };
        self.0.buffers.push(kept);
        self.0.device.check()?;
        Ok(id)
    }

    /// Adds spheres given as centre and radius, and returns their common geometry number.
    pub fn add_spheres(&mut self, spheres: Vec<[f32; 4]>) -> Result<u32> {
        // SAFETY: the buffer has the stated length, and its heap block lives in `self.0.buffers`.
        let id = unsafe {
            raw::fluxion_scene_add_spheres(self.0.device.raw, self.0.raw, spheres.as_ptr().cast(), spheres.len())
        };
        self.0.buffers.push(Buffer::Spheres { _spheres: spheres });
        self.0.device.check()?;
        Ok(id)
    }

    /// Adds a disk or a cylinder and returns its geometry number.
    pub fn add_quadric(&mut self, quadric: Quadric) -> Result<u32> {
        let quadric = Box::new(quadric);
        // SAFETY: the quadric is boxed and lives in `self.0.buffers` until the scene is released.
        let id = unsafe { raw::fluxion_scene_add_quadric(self.0.device.raw, self.0.raw, &*quadric) };
        self.0.buffers.push(Buffer::Quadric { _quadric: quadric });
        self.0.device.check()?;
        Ok(id)
    }

    /// Adds round curves and returns their common geometry number. Every segment must be within the control points.
    pub fn add_curves(&mut self, curves: &Arc<CurveData>) -> Result<u32> {
        let CurveData { kind, points, starts, ends } = &**curves;
        let length = curves.segment_length();
        if ends.len() != starts.len() || starts.iter().any(|&start| start as usize + length > points.len()) {
            return Err(Error::backend("embree", "a segment of a curve names a point that does not exist"));
        }
        // SAFETY: the buffers have the stated lengths, every segment is within them, and `self.0.buffers` keeps them alive and
        // unmoved until the scene is released.
        let id = unsafe {
            raw::fluxion_scene_add_curves(
                self.0.device.raw,
                self.0.raw,
                *kind,
                points.as_ptr().cast(),
                points.len(),
                starts.as_ptr(),
                ends.as_ptr(),
                starts.len(),
            )
        };
        self.0.buffers.push(Buffer::Curves { _curves: Arc::clone(curves) });
        self.0.device.check()?;
        Ok(id)
    }

    /// Adds another scene, placed by the columns of a matrix, and returns the instance's number.
    pub fn add_instance(&mut self, child: &Arc<Committed>, to_world: [f32; 16]) -> Result<u32> {
        if !Arc::ptr_eq(&child.0.device, &self.0.device) {
            return Err(Error::backend("embree", "an instance of a scene of another device"));
        }
        // SAFETY: the child is committed, of the same device, and kept alive in `self.0.buffers`; the matrix is
        // copied during the call.
        let id =
            unsafe { raw::fluxion_scene_add_instance(self.0.device.raw, self.0.raw, child.0.raw, to_world.as_ptr()) };
        self.0.buffers.push(Buffer::Instance { _child: Arc::clone(child) });
        self.0.device.check()?;
        Ok(id)
    }

    /// Builds the hierarchy.
    pub fn commit(self) -> Result<Committed> {
        // SAFETY: the scene is alive and nobody else has it.
        unsafe { raw::fluxion_scene_commit(self.0.raw) }
        self.0.device.check()?;
        Ok(Committed(self.0))
    }
}

/// A scene that can be traced, from any number of threads.
pub struct Committed(SceneHandle);

impl Committed {
    /// The first surface along the ray between `t_near` and `t_far`.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut hit = Hit::default();
        // SAFETY: the scene is committed; both pointers are valid for the call.
        unsafe { raw::fluxion_intersect(self.0.raw, ray, &mut hit) }.then_some(hit)
    }

    /// Whether anything lies on the ray between `t_near` and `t_far`.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        // SAFETY: as above.
        unsafe { raw::fluxion_occluded(self.0.raw, ray) }
    }

    /// The first surfaces along the active ones of sixteen rays. `coherent`: they start and run close together.
    #[inline]
    pub fn intersect_packet(&self, rays: &Rays, coherent: bool) -> Hits {
        let mut hits = std::mem::MaybeUninit::uninit();
        // SAFETY: the scene is committed; both pointers are valid for the call, which writes every field.
        unsafe {
            raw::fluxion_intersect_packet(self.0.raw, self.0.packet_width, rays, coherent, hits.as_mut_ptr());
            hits.assume_init()
        }
    }

    /// Occlusion of sixteen rays: all bits of a word are set or none.
    #[inline]
    pub fn occluded_packet(&self, rays: &Rays) -> [u32; 16] {
        let mut blocked = [0; 16];
        // SAFETY: as above; there is room for every word.
        unsafe { raw::fluxion_occluded_packet(self.0.raw, self.0.packet_width, rays, blocked.as_mut_ptr()) }
        blocked
    }
}

#[cfg(test)]
mod tests;
