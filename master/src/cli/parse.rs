//! Values on the command line.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::str::FromStr;
use std::time::Duration;

use clap::ValueEnum;
use frame::tone::{Exposure, Operator, STOPS_MAX};

/// Where viewers are let in if nothing is said: this machine only.
pub(super) const HTTP: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 8080);

/// `WxH`, both 1..=65535.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let [width, height] = pair(text, 1, 65_535)?;
        Ok(Self { width, height })
    }
}

/// `A..B` without B, or `A..=B` with it: the numbers of an animation's pictures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FramesRange(pub std::ops::Range<u32>);

/// Pictures that an animation has at most.
const FRAMES_MAX: u32 = 1_000_000;

impl FromStr for FramesRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("expected first..end with numbers up to {FRAMES_MAX}, such as 0..240 or 1..=240");
        let (first, end) = text.split_once("..").ok_or_else(wrong)?;
        let (end, with_last) = end.strip_prefix('=').map_or((end, 0), |last| (last, 1));
        let number = |text: &str| text.parse().ok().filter(|n| *n <= FRAMES_MAX).ok_or_else(wrong);
        let (first, end) = (number(first)?, number(end)? + with_last);
        if first < end { Ok(Self(first..end)) } else { Err(format!("there is no picture in {text}")) }
    }
}

/// `NxM` with both numbers in a range.
pub(super) fn pair(text: &str, least: u32, most: u32) -> Result<[u32; 2], String> {
    let wrong = || format!("expected two numbers from {least} to {most}, such as {}x{}", least.max(3), least.max(3));
    let (a, b) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    let number = |text: &str| text.parse().ok().filter(|n| (least..=most).contains(n)).ok_or_else(wrong);
    Ok([number(a)?, number(b)?])
}

/// A finite number.
pub(super) fn finite(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| "not a number".to_string())?;
    if number.is_finite() { Ok(number) } else { Err("must be a finite number".to_string()) }
}

/// A finite number from 0 on.
pub(super) fn from_zero(text: &str) -> Result<f64, String> {
    finite(text).and_then(|number| if number >= 0.0 { Ok(number) } else { Err("must not be negative".to_string()) })
}

/// `LAMP=F` or `LAMP=R,G,B`: a name, and factors from 0 on.
pub(super) fn dimmed(text: &str) -> Result<(String, [f32; 3]), String> {
    let wrong = || "expected a lamp and a factor, or three, such as `desk lamp=0.4` or sky=1,0.9,0.8".to_string();
    let (name, factors) = text.rsplit_once('=').ok_or_else(wrong)?;
    let factors: Result<Vec<f64>, String> = factors.split(',').map(|factor| from_zero(factor.trim())).collect();
    let factors = match factors.map_err(|_| wrong())?.as_slice() {
        [all] => [*all; 3],
        [red, green, blue] => [*red, *green, *blue],
        _ => return Err(wrong()),
    };
    Ok((name.to_string(), factors.map(|factor| factor as f32)))
}

/// Four finite numbers.
pub(super) fn corners(text: &str) -> Result<[f64; 4], String> {
    numbers(text, "expected two corners, such as 0,0,6,4")
}

/// Two numbers above 0, ascending.
pub(super) fn scale(text: &str) -> Result<[f64; 2], String> {
    let wrong = "expected two numbers above 0, the smaller first, such as 50,1000";
    let [low, high] = numbers(text, wrong)?;
    if 0.0 < low && low < high { Ok([low, high]) } else { Err(wrong.to_string()) }
}

fn numbers<const N: usize>(text: &str, wrong: &str) -> Result<[f64; N], String> {
    let numbers: Result<Vec<f64>, String> = text.split(',').map(|number| finite(number.trim())).collect();
    numbers.ok().and_then(|numbers| numbers.try_into().ok()).ok_or_else(|| wrong.to_string())
}

/// A finite number above 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| "not a number".to_string())?;
    if number.is_finite() && number > 0.0 { Ok(number) } else { Err("must be a finite number above 0".to_string()) }
}

/// Milliseconds that something is away.
pub(super) fn milliseconds(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| "not a number".to_string())?;
    if (0.0..=10_000.0).contains(&number) { Ok(number) } else { Err("must be from 0 to 10000".to_string()) }
}

/// `HOST:PORT`, as it was written.
pub(super) fn place(text: &str) -> Result<String, String> {
    let is_place = |(host, port): &(&str, &str)| {
        let is_word = host.chars().all(|c| c.is_ascii_alphanumeric() || "-._[]:%".contains(c));
        !host.is_empty() && is_word && port.parse::<u16>().is_ok_and(|port| port > 0)
    };
    let place = text.rsplit_once(':').filter(is_place);
    place.map(|_| text.to_owned()).ok_or_else(|| "expected HOST:PORT, such as master.example.org:7464".into())
}

/// A number from 0 to 1.
pub(super) fn share(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| "not a number".to_string())?;
    if (0.0..=1.0).contains(&number) {
        Ok(number)
    } else {
        Err("must be a number from 0 to 1, such as 0.01".to_string())
    }
}

/// A time with its unit: `90s`, `30m`, `12h`, `7d`.
pub(super) fn lifetime(text: &str) -> Result<Duration, String> {
    let units = [('s', 1), ('m', 60), ('h', 3600), ('d', 86_400)];
    let parse = || {
        let unit = text.chars().last()?;
        let seconds = units.iter().find(|(known, _)| *known == unit)?.1;
        let count: u64 = text[..text.len() - 1].parse().ok()?;
        count.checked_mul(seconds).filter(|seconds| (1..=LIFETIME_MAX).contains(seconds))
    };
    parse()
        .map(Duration::from_secs)
        .ok_or_else(|| "wants a time such as 90s, 30m, 12h or 7d, of at most ten years".into())
}

/// Longest life of a token that expires, seconds.
const LIFETIME_MAX: u64 = 3650 * 86_400;

/// Frames a second that can be aimed at.
pub(super) fn rate(text: &str) -> Result<f32, String> {
    use frame::live::pace::{RATE_MAX, RATE_MIN};
    let rate = text.parse().ok().filter(|rate| (RATE_MIN..=RATE_MAX).contains(rate));
    rate.ok_or_else(|| format!("expected a number from {RATE_MIN} to {RATE_MAX}"))
}

/// An estimator of the cases, or the machinery.
pub(super) fn method(text: &str) -> Result<cases::Method, String> {
    let all = cases::Method::ALL;
    let names = || all.map(cases::Method::name).join(", ");
    all.into_iter().find(|method| method.name() == text).ok_or_else(|| format!("expected one of {}", names()))
}

/// `embedded` or `embedded:N`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WorkersArg {
    /// Number of threads; `None`: one a core.
    pub embedded: Option<usize>,
}

impl FromStr for WorkersArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || "expected `embedded` or `embedded:N` with N from 1 to 1024".to_string();
        match text.strip_prefix("embedded").ok_or_else(wrong)?.strip_prefix(':') {
            None if text == "embedded" => Ok(Self { embedded: None }),
            Some(count) => {
                let count = count.parse().ok().filter(|n| (1..=1024).contains(n)).ok_or_else(wrong)?;
                Ok(Self { embedded: Some(count) })
            }
            None => Err(wrong()),
        }
    }
}

/// Stops or `auto`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExposureArg(pub Exposure);

impl FromStr for ExposureArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self(Exposure::Auto));
        }
        stops(text).map(|stops| Self(Exposure::Fixed(stops))).map_err(|wrong| format!("{wrong}, or `auto`"))
    }
}

/// An exposure.
pub(super) fn stops(text: &str) -> Result<f32, String> {
    let stops = text.parse().ok().filter(|stops: &f32| stops.abs() <= STOPS_MAX);
    stops.ok_or_else(|| format!("expected stops, -{STOPS_MAX} to {STOPS_MAX}"))
}

/// Tone curves by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ToneArg {
    /// Clip at white: shows what is below exactly, as the references' previews do.
    None,
    /// Reinhard 2002: keeps hues, low contrast.
    Reinhard,
    /// ACES, fitted: contrasty.
    Aces,
    /// AgX, fitted: bright colours fade to white as on film.
    Agx,
}

impl From<ToneArg> for Operator {
    fn from(tone: ToneArg) -> Self {
        match tone {
            ToneArg::None => Self::None,
            ToneArg::Reinhard => Self::Reinhard,
            ToneArg::Aces => Self::Aces,
            ToneArg::Agx => Self::Agx,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lifetimes_have_units_and_bounds() {
        let seconds = |text| lifetime(text).map(|time| time.as_secs()).ok();
        assert_eq!(["90s", "30m", "12h", "7d"].map(seconds), [Some(90), Some(1800), Some(43_200), Some(604_800)]);
        for wrong in ["", "d", "7", "0s", "-1d", "1w", "99999999999999999999d", "3651d", "1é"] {
            assert_eq!(seconds(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn sizes_are_two_numbers_above_0() {
        assert_eq!("640x480".parse(), Ok(Size { width: 640, height: 480 }));
        for wrong in ["", "640", "0x480", "640x0", "-1x4", "640x480x3", "65536x1", "x", "1.5x2"] {
            assert!(wrong.parse::<Size>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn ranges_of_pictures_are_as_in_rust() {
        assert_eq!("0..240".parse(), Ok(FramesRange(0..240)));
        assert_eq!("7..=9".parse(), Ok(FramesRange(7..10)));
        for wrong in ["", "5", "5..", "..5", "5..5", "6..=5", "-1..5", "0..99999999", "a..b", "0...5"] {
            assert!(wrong.parse::<FramesRange>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn workers_are_embedded() {
        assert_eq!("embedded".parse(), Ok(WorkersArg { embedded: None }));
        assert_eq!("embedded:3".parse(), Ok(WorkersArg { embedded: Some(3) }));
        for wrong in ["", "3", "embedded:", "embedded:0", "embedded3", "embedded:9999", "remote"] {
            assert!(wrong.parse::<WorkersArg>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn exposures_are_stops_or_auto() {
        assert_eq!("-1.5".parse(), Ok(ExposureArg(Exposure::Fixed(-1.5))));
        assert_eq!("auto".parse(), Ok(ExposureArg(Exposure::Auto)));
        for wrong in ["", "bright", "nan", "inf", "61"] {
            assert!(wrong.parse::<ExposureArg>().is_err() && stops(wrong).is_err(), "{wrong}");
        }
    }
}
