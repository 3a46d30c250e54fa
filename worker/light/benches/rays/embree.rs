//! Embree 3 or 4, found at run time, so that nothing of it is needed to build.
//!
//! Only what the comparison needs: single rays against triangles, standard (fast) mode, one thread.
//! The structures are those of `embree3/rtcore_ray.h` and `embree4/rtcore_ray.h`, which agree.

use std::ffi::{CStr, c_char, c_int, c_void};
use std::ptr;

use glam::Vec3;
use light::bvh::Ray;
use scenes::Scene;

const RTC_GEOMETRY_TYPE_TRIANGLE: u32 = 0;
const RTC_BUFFER_TYPE_INDEX: u32 = 0;
const RTC_BUFFER_TYPE_VERTEX: u32 = 1;
const RTC_FORMAT_UINT3: u32 = 0x5003;
const RTC_FORMAT_FLOAT3: u32 = 0x9003;
const NONE: u32 = u32::MAX;

type Handle = *mut c_void;
type NewDevice = unsafe extern "C" fn(*const c_char) -> Handle;

/// An Embree library and what is used of it.
pub struct Library {
    /// 3 or 4: they differ in how rays are passed.
    version: u32,
    device: Handle,
    symbols: Symbols,
}

/// A scene in Embree; lives for ever, as benches end soon.
pub struct PeerScene<'a> {
    library: &'a Library,
    scene: Handle,
}

struct Symbols {
    new_scene: unsafe extern "C" fn(Handle) -> Handle,
    new_geometry: unsafe extern "C" fn(Handle, u32) -> Handle,
    set_new_buffer: unsafe extern "C" fn(Handle, u32, u32, u32, usize, usize) -> *mut c_void,
    commit_geometry: unsafe extern "C" fn(Handle),
    attach_geometry: unsafe extern "C" fn(Handle, Handle) -> u32,
    commit_scene: unsafe extern "C" fn(Handle),
    /// Version 3: scene, context, ray. Version 4: scene, ray, arguments or null.
    occluded: unsafe extern "C" fn(Handle, *mut c_void, *mut c_void),
    intersect: unsafe extern "C" fn(Handle, *mut c_void, *mut c_void),
}

#[repr(C, align(16))]
struct RtcRay {
    origin: [f32; 3],
    t_near: f32,
    direction: [f32; 3],
    time: f32,
    t_far: f32,
    mask: u32,
    id: u32,
    flags: u32,
}

#[repr(C, align(16))]
struct RtcRayHit {
    ray: RtcRay,
    normal: [f32; 3],
    u: f32,
    v: f32,
    primitive: u32,
    geometry: u32,
    instance: [u32; 4],
}

/// `RTCIntersectContext` of version 3, with room to spare for other builds.
#[repr(C)]
struct Context {
    flags: u32,
    filter: *mut c_void,
    instances: [u32; 16],
}

#[cfg(unix)]
unsafe extern "C" {
    fn dlopen(name: *const c_char, flags: c_int) -> *mut c_void;
    fn dlsym(library: *mut c_void, name: *const c_char) -> *mut c_void;
}

impl Library {
    /// The newest version there is, if any.
    #[cfg(unix)]
    pub fn open() -> Option<Self> {
        const RTLD_NOW: c_int = 2;
        [(4, c"libembree4.so.4"), (4, c"libembree4.so"), (3, c"libembree3.so.3"), (3, c"libembree3.so")]
            .into_iter()
            .find_map(|(version, name)| {
                // SAFETY: a constant name; loading Embree runs no code but its initialisers.
                let library = unsafe { dlopen(name.as_ptr(), RTLD_NOW) };
                // SAFETY: the library is one of Embree's, of that version.
                if library.is_null() { None } else { unsafe { Self::load(version, library) } }
            })
    }

    /// Not looked for on other systems.
    #[cfg(not(unix))]
    pub fn open() -> Option<Self> {
        None
    }

    /// # Safety
    /// `library` is a handle of Embree in that version.
    #[cfg(unix)]
    unsafe fn load(version: u32, library: *mut c_void) -> Option<Self> {
        // SAFETY: the types below are those of Embree's headers.
        let (new_device, symbols) = unsafe { Self::symbols(library)? };
        // SAFETY: a configuration string in Embree's syntax.
        let device = unsafe { new_device(c"threads=1".as_ptr()) };
        (!device.is_null()).then_some(Self { version, device, symbols })
    }

    /// # Safety
    /// `library` is a handle of Embree.
    #[cfg(unix)]
    unsafe fn symbols(library: *mut c_void) -> Option<(NewDevice, Symbols)> {
        // SAFETY: the fields have the types of Embree's headers.
        let symbols = unsafe {
            Symbols {
                new_scene: symbol(library, c"rtcNewScene")?,
                new_geometry: symbol(library, c"rtcNewGeometry")?,
                set_new_buffer: symbol(library, c"rtcSetNewGeometryBuffer")?,
                commit_geometry: symbol(library, c"rtcCommitGeometry")?,
                attach_geometry: symbol(library, c"rtcAttachGeometry")?,
                commit_scene: symbol(library, c"rtcCommitScene")?,
                occluded: symbol(library, c"rtcOccluded1")?,
                intersect: symbol(library, c"rtcIntersect1")?,
            }
        };
        // SAFETY: likewise.
        Some((unsafe { symbol(library, c"rtcNewDevice")? }, symbols))
    }

    /// Builds the visible objects as one geometry each, in scene space.
    pub fn scene(&self, scene: &Scene) -> PeerScene<'_> {
        let rtc = &self.symbols;
        // SAFETY: handles come from this library; each buffer is filled with exactly the number of
        // elements it was made for, before the geometry is committed.
        unsafe {
            let peer = (rtc.new_scene)(self.device);
            for object in scene.objects.iter().filter(|object| object.visible) {
                let mesh = &scene.meshes[object.mesh as usize];
                let geometry = (rtc.new_geometry)(self.device, RTC_GEOMETRY_TYPE_TRIANGLE);
                let count = mesh.positions.len();
                let vertices = (rtc.set_new_buffer)(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, count);
                for (i, &position) in mesh.positions.iter().enumerate() {
                    let position = object.scene_from_object.point(position).to_array();
                    vertices.cast::<[f32; 3]>().add(i).write(position);
                }
                let count = mesh.triangles.len();
                let indices = (rtc.set_new_buffer)(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, count);
                ptr::copy_nonoverlapping(mesh.triangles.as_ptr(), indices.cast(), count);
                (rtc.commit_geometry)(geometry);
                (rtc.attach_geometry)(peer, geometry);
            }
            (rtc.commit_scene)(peer);
            PeerScene { library: self, scene: peer }
        }
    }
}

impl PeerScene<'_> {
    /// Whether a ray hits anything; finds the closest hit for it.
    pub fn closest(&self, ray: &Ray) -> bool {
        let mut query = RtcRayHit {
            ray: rtc_ray(ray),
            normal: [0.0; 3],
            u: 0.0,
            v: 0.0,
            primitive: NONE,
            geometry: NONE,
            instance: [NONE; 4],
        };
        // SAFETY: the function takes an `RTCRayHit`.
        unsafe { self.ask(self.library.symbols.intersect, (&raw mut query).cast()) };
        query.geometry != NONE
    }

    /// Whether anything stands between two points.
    pub fn occluded(&self, from: Vec3, to: Vec3) -> bool {
        self.occluded_along(&Ray { origin: from, direction: to - from, t_max: 1.0 })
    }

    /// Whether a ray hits anything.
    pub fn occluded_along(&self, ray: &Ray) -> bool {
        let mut query = rtc_ray(ray);
        // SAFETY: the function takes an `RTCRay`.
        unsafe { self.ask(self.library.symbols.occluded, (&raw mut query).cast()) };
        query.t_far < 0.0
    }

    /// # Safety
    /// `query` is what `function` takes.
    unsafe fn ask(&self, function: unsafe extern "C" fn(Handle, *mut c_void, *mut c_void), query: *mut c_void) {
        let mut context = Context { flags: 0, filter: ptr::null_mut(), instances: [NONE; 16] };
        // SAFETY: the arguments of this version, in its order; the caller vouches for `query`.
        unsafe {
            match self.library.version {
                3 => function(self.scene, (&raw mut context).cast(), query),
                _ => function(self.scene, query, ptr::null_mut()),
            }
        }
    }
}

/// A function of a library.
///
/// # Safety
/// `library` is a live handle, and `F` the type of a pointer to the function of that name.
#[cfg(unix)]
unsafe fn symbol<F: Copy>(library: *mut c_void, name: &CStr) -> Option<F> {
    assert_eq!(size_of::<F>(), size_of::<*mut c_void>());
    // SAFETY: a live handle and a terminated name.
    let address = unsafe { dlsym(library, name.as_ptr()) };
    // SAFETY: a pointer to a function of type `F`.
    (!address.is_null()).then(|| unsafe { std::mem::transmute_copy::<*mut c_void, F>(&address) })
}

fn rtc_ray(ray: &Ray) -> RtcRay {
    RtcRay {
        origin: ray.origin.to_array(),
        t_near: 0.0,
        direction: ray.direction.to_array(),
        time: 0.0,
        t_far: ray.t_max,
        mask: u32::MAX,
        id: 0,
        flags: 0,
    }
}
