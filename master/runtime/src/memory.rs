//! How much memory there is: asked before a picture is begun that cannot be finished.

use scenes::Camera;

use crate::failure::Failure;

/// Memory that can be used without swapping, bytes; very much where that cannot be found out.
pub fn available_bytes() -> u64 {
    let meminfo = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"));
    let kib = line.and_then(|line| line.trim().trim_end_matches("kB").trim().parse::<u64>().ok());
    kib.map_or(u64::MAX, |kib| kib.saturating_mul(1024))
}

/// Memory that this process has in use, bytes; 0 where that cannot be found out.
pub fn resident_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kib = line.and_then(|line| line.trim().trim_end_matches("kB").trim().parse::<u64>().ok());
    kib.unwrap_or(0).saturating_mul(1024)
}

/// Refuses pictures without pixels, and those that need more memory than there is.
///
/// # Errors
/// [`Failure`] says what to do about it.
pub fn demand(needed: u64, camera: &Camera) -> Result<(), Failure> {
    let Camera { width, height, .. } = camera;
    if *width == 0 || *height == 0 {
        return Err(Failure::Scene(format!("the camera's picture has no pixels: {width}x{height}")));
    }
    let free = available_bytes();
    if needed > free {
        return Err(Failure::Usage(format!(
            "a picture of {width}x{height} needs about {} of memory, and {} are free: choose a smaller --size",
            described(needed),
            described(free)
        )));
    }
    Ok(())
}

/// For people.
pub fn described(bytes: u64) -> String {
    let gigabytes = bytes as f64 / 1e9;
    if gigabytes >= 1.0 { format!("{gigabytes:.1} GB") } else { format!("{:.0} MB", bytes as f64 / 1e6) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_some_memory() {
        assert!(available_bytes() > 1 << 20);
        assert!(resident_bytes() > 1 << 20 && resident_bytes() < u64::MAX >> 1);
        assert_eq!(described(12_345_678_901), "12.3 GB");
        assert_eq!(described(12_345_678), "12 MB");
    }
}
