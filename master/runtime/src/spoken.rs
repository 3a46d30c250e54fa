//! Numbers in letters.

/// A count.
pub fn short(count: u64) -> String {
    let (scale, unit) = match count {
        0..10_000 => return count.to_string(),
        10_000..10_000_000 => (1e3, "k"),
        10_000_000..10_000_000_000 => (1e6, "M"),
        _ => (1e9, "G"),
    };
    format!("{:.1} {unit}", count as f64 / scale)
}

/// A time that something will take.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.ceil() as u64;
    match whole {
        0..120 => format!("{whole} s"),
        120..7200 => format!("{} min", whole.div_ceil(60)),
        _ => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
    }
}

/// Bytes as digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::{duration, short};

    #[test]
    fn counts_are_short() {
        assert_eq!([0, 9999, 12_345, 123_456_789].map(short), ["0", "9999", "12.3 k", "123.5 M"]);
    }

    #[test]
    fn durations_are_short() {
        assert_eq!([0.2, 119.0, 150.0, 7260.0].map(duration), ["1 s", "119 s", "3 min", "2 h 1 min"]);
    }
}
