//! Open Image Denoise by its C interface, version 2 (`OpenImageDenoise/oidn.h`): the one room of the master that calls what
//! the compiler has not seen.
//!
//! What keeps it sound: functions have the types that the header of version 2 gives them, and libraries of other versions
//! are refused before any other call. No pointer of ours outlives the call that it is given to, but one: that of the flag
//! that stops a filter, which lives as long as the filter. The library is never closed, since its threads may still run in
//! it. Every handle is owned by one [`Device`], is released once, after all that was made of it, and goes to one thread at a
//! time.

use std::ffi::{CStr, OsStr, c_char, c_int, c_void};
use std::ptr::{self, NonNull};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use libloading::Library;

type Handle = *mut c_void;
type Monitor = unsafe extern "C" fn(user: *mut c_void, share: f64) -> bool;

/// The functions that are used, by their names in the header.
#[derive(Clone, Copy)]
struct Functions {
    new_device: unsafe extern "C" fn(c_int) -> Handle,
    set_device_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    commit_device: unsafe extern "C" fn(Handle),
    device_int: unsafe extern "C" fn(Handle, *const c_char) -> c_int,
    device_error: unsafe extern "C" fn(Handle, *mut *const c_char) -> c_int,
    release_device: unsafe extern "C" fn(Handle),
    new_buffer: unsafe extern "C" fn(Handle, usize) -> Handle,
    write_buffer: unsafe extern "C" fn(Handle, usize, usize, *const c_void),
    read_buffer: unsafe extern "C" fn(Handle, usize, usize, *mut c_void),
    release_buffer: unsafe extern "C" fn(Handle),
    new_filter: unsafe extern "C" fn(Handle, *const c_char) -> Handle,
    set_filter_image: unsafe extern "C" fn(Handle, *const c_char, Handle, c_int, usize, usize, usize, usize, usize),
    set_filter_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    set_filter_monitor: unsafe extern "C" fn(Handle, Monitor, *mut c_void),
    commit_filter: unsafe extern "C" fn(Handle),
    execute_filter: unsafe extern "C" fn(Handle),
    release_filter: unsafe extern "C" fn(Handle),
}

/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;
/// `OIDN_ERROR_NONE`, `OIDN_ERROR_CANCELLED`.
const NO_ERROR: c_int = 0;
const CANCELLED: c_int = 6;
/// The version that the header describes, times 10,000; one more is another.
const VERSIONS: std::ops::Range<c_int> = 20_000..30_000;

/// Where it is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Wherever the library finds it fastest: a graphics processor, if it can use one.
    Fastest,
    /// On this processor: the same picture gives the same bits.
    Processor,
}

/// Why there is no picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// Somebody wanted it to stop.
    Stopped,
    /// In the library's words.
    Failed(String),
}

/// A device of the library, with what was last made for a size of pictures.
pub struct Device {
    functions: Functions,
    handle: NonNull<c_void>,
    /// Major, minor, patch.
    version: [c_int; 3],
    prepared: Option<Prepared>,
    stop: Arc<AtomicBool>,
}

/// Filter and buffers for pictures of one size.
struct Prepared {
    size: [usize; 2],
    filter: Handle,
    /// In the order of [`IMAGES`].
    buffers: [Handle; 4],
}

/// What the filter reads, and what it writes.
const IMAGES: [&CStr; 4] = [c"color", c"albedo", c"normal", c"output"];

impl Prepared {
    /// The library had memory for all of it.
    fn is_whole(&self) -> bool {
        !self.filter.is_null() && self.buffers.iter().all(|buffer| !buffer.is_null())
    }
}

// SAFETY: the library may be called from any thread, and a `Device` is used by one at a time, for all calls need it mutably
// or own it.
unsafe impl Send for Device {}

impl Device {
    /// Opens the library of this name or path, and a device of it.
    ///
    /// # Errors
    /// In words: it is not there, is another library or version, or has no such device.
    pub fn open(library: &OsStr, place: Place) -> Result<Self, String> {
        // SAFETY: the person who runs this program has named the library, or the system knows it as Open Image Denoise,
        // whose initialisers may run at any time.
        let library = unsafe { Library::new(library) }.map_err(|error| in_words(&error))?;
        let functions = Functions::of(&library).map_err(|error| in_words(&error))?;
        // Its threads may still be there when this program ends.
        std::mem::forget(library);
        let kind = match place {
            Place::Fastest => 0,
            Place::Processor => 1,
        };
        // SAFETY: the argument is one of `OIDNDeviceType`.
        let handle = NonNull::new(unsafe { (functions.new_device)(kind) });
        let Some(handle) = handle else { return Err(functions.error(ptr::null_mut()).1) };
        let stop = Arc::new(AtomicBool::new(false));
        let mut device = Self { functions, handle, version: [0; 3], prepared: None, stop };
        // SAFETY: the handle is a device, and the name ends in a 0.
        let version = unsafe { (functions.device_int)(handle.as_ptr(), c"version".as_ptr()) };
        if !VERSIONS.contains(&version) {
            return Err(format!("version 2 is needed, and this says {version}"));
        }
        device.version = [version / 10_000, version / 100 % 100, version % 100];
        // SAFETY: as above. Threads that are nailed to cores would be in the way of workers.
        unsafe {
            (functions.set_device_bool)(handle.as_ptr(), c"setAffinity".as_ptr(), false);
            (functions.commit_device)(handle.as_ptr());
        }
        match functions.error(handle.as_ptr()) {
            // A device without that switch is no processor.
            (NO_ERROR, _) => Ok(device),
            (_, reason) => Err(reason),
        }
    }

    /// Major, minor, patch.
    pub fn version(&self) -> [c_int; 3] {
        self.version
    }

    /// Setting it stops the picture that is being denoised, and no other.
    pub fn stop(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.stop)
    }

    /// Denoises high-dynamic-range `colour` by `albedo` and `normal`: three values a pixel, row by row.
    ///
    /// # Errors
    /// The library's, or that it was stopped. The next picture may succeed all the same.
    ///
    /// # Panics
    /// An image has another size.
    pub fn denoise(&mut self, [width, height]: [usize; 2], inputs: [&[f32]; 3]) -> Result<Vec<f32>, Trouble> {
        let len = width * height * 3;
        assert!(inputs.iter().all(|input| input.len() == len), "all images have {width}x{height} pixels");
        self.stop.store(false, Ordering::Relaxed);
        let Functions { write_buffer, read_buffer, execute_filter, .. } = self.functions;
        self.prepare([width, height])?;
        let Some(Prepared { filter, buffers, .. }) = &self.prepared else { return Err(Trouble::Stopped) };
        let bytes = len * size_of::<f32>();
        for (input, buffer) in inputs.iter().zip(buffers) {
            // SAFETY: the buffer was made with `bytes` bytes, and the slice has as many, which are read during the call.
            unsafe { write_buffer(*buffer, 0, bytes, input.as_ptr().cast()) };
        }
        // SAFETY: the filter is committed, and so are its images, which are as large as it was told.
        unsafe { execute_filter(*filter) };
        let mut output = vec![0.0_f32; len];
        // SAFETY: as for writing; the vector has `bytes` bytes, of which any may be a float's.
        unsafe { read_buffer(buffers[3], 0, bytes, output.as_mut_ptr().cast()) };
        match self.functions.error(self.handle.as_ptr()) {
            (NO_ERROR, _) => Ok(output),
            (CANCELLED, _) => Err(Trouble::Stopped),
            (_, reason) => Err(self.failed(reason)),
        }
    }

    /// Makes filter and buffers for pictures of this size, if they are not there: that takes as long as some pictures.
    fn prepare(&mut self, size: [usize; 2]) -> Result<(), Trouble> {
        if self.prepared.as_ref().is_some_and(|prepared| prepared.size == size) {
            return Ok(());
        }
        self.forget();
        let (functions, device, [width, height]) = (self.functions, self.handle.as_ptr(), size);
        let bytes = width * height * 3 * size_of::<f32>();
        // SAFETY: the device is there, names end in 0, formats and sizes are those of the buffers, which are null (an error,
        // looked for below) or `bytes` long. The monitor reads the flag, which the device owns and which is dropped after
        // the filter; it is an `AtomicBool`, so other threads may write it meanwhile.
        let prepared = unsafe {
            let filter = (functions.new_filter)(device, c"RT".as_ptr());
            let buffers = IMAGES.map(|_| (functions.new_buffer)(device, bytes));
            let prepared = Prepared { size, filter, buffers };
            if prepared.is_whole() {
                for (name, buffer) in IMAGES.iter().zip(buffers) {
                    (functions.set_filter_image)(filter, name.as_ptr(), buffer, FLOAT3, width, height, 0, 0, 0);
                }
                (functions.set_filter_bool)(filter, c"hdr".as_ptr(), true);
                (functions.set_filter_monitor)(filter, may_go_on, Arc::as_ptr(&self.stop).cast_mut().cast());
                (functions.commit_filter)(filter);
            }
            prepared
        };
        let is_whole = prepared.is_whole();
        self.prepared = Some(prepared);
        match functions.error(device) {
            (NO_ERROR, _) if is_whole => Ok(()),
            (_, reason) => Err(self.failed(reason)),
        }
    }

    fn failed(&mut self, reason: String) -> Trouble {
        self.forget();
        Trouble::Failed(reason)
    }

    fn forget(&mut self) {
        let Some(Prepared { filter, buffers, .. }) = self.prepared.take() else { return };
        let functions = self.functions;
        // SAFETY: each is null or was made by `prepare`, and is not used again.
        unsafe {
            if !filter.is_null() {
                (functions.release_filter)(filter);
            }
            buffers.iter().filter(|buffer| !buffer.is_null()).for_each(|buffer| (functions.release_buffer)(*buffer));
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        self.forget();
        // SAFETY: it was made by `open`, and all that was made of it has just been released.
        unsafe { (self.functions.release_device)(self.handle.as_ptr()) };
    }
}

/// The system's words say most, and stand behind the error.
fn in_words(error: &libloading::Error) -> String {
    std::error::Error::source(error).map_or_else(|| error.to_string(), ToString::to_string)
}

/// What the library asks now and then.
unsafe extern "C" fn may_go_on(stop: *mut c_void, _share: f64) -> bool {
    // SAFETY: `prepare` gave it the device's flag, which outlives the filter.
    let stop = unsafe { &*stop.cast::<AtomicBool>() };
    !stop.load(Ordering::Relaxed)
}

impl Functions {
    fn of(library: &Library) -> Result<Self, libloading::Error> {
        // SAFETY: each name stands in the header of version 2 with the type of the field. Another version may lack a name,
        // which is an error, but has given none another type so far; only `oidnNewDevice`, `oidnGetDeviceInt` and
        // `oidnGetDeviceError` are called before the version is known.
        unsafe {
            Ok(Self {
                new_device: *library.get("oidnNewDevice")?,
                set_device_bool: *library.get("oidnSetDeviceBool")?,
                commit_device: *library.get("oidnCommitDevice")?,
                device_int: *library.get("oidnGetDeviceInt")?,
                device_error: *library.get("oidnGetDeviceError")?,
                release_device: *library.get("oidnReleaseDevice")?,
                new_buffer: *library.get("oidnNewBuffer")?,
                write_buffer: *library.get("oidnWriteBuffer")?,
                read_buffer: *library.get("oidnReadBuffer")?,
                release_buffer: *library.get("oidnReleaseBuffer")?,
                new_filter: *library.get("oidnNewFilter")?,
                set_filter_image: *library.get("oidnSetFilterImage")?,
                set_filter_bool: *library.get("oidnSetFilterBool")?,
                set_filter_monitor: *library.get("oidnSetFilterProgressMonitorFunction")?,
                commit_filter: *library.get("oidnCommitFilter")?,
                execute_filter: *library.get("oidnExecuteFilter")?,
                release_filter: *library.get("oidnReleaseFilter")?,
            })
        }
    }

    /// The first error since this was asked last, and what the library says of it.
    fn error(&self, device: Handle) -> (c_int, String) {
        let mut words = ptr::null();
        // SAFETY: the handle is a device, or null for what went wrong without one; the words are null or end in a 0, and
        // stay as they are until this is asked again.
        let (code, words) = unsafe {
            let code = (self.device_error)(device, &raw mut words);
            (code, if words.is_null() { None } else { Some(CStr::from_ptr(words).to_string_lossy().into_owned()) })
        };
        (code, words.unwrap_or_else(|| format!("error {code}")))
    }
}
