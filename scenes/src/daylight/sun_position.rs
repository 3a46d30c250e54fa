//! Where the sun stands: the low-precision formulas of the Astronomical Almanac, as Michalsky 1988 ("The Astronomical
//! Almanac's algorithm for approximate solar position (1950–2050)", Solar Energy 40, 227) gives them. Good to 0.01° in these
//! years; what refraction lifts (0.6° at the horizon) is not in it.

use super::Angles;

/// A moment in universal time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Days since noon of 1 January 2000, universal time.
    days: f64,
}

impl Moment {
    /// A date of the Gregorian calendar, hours after its midnight, and how many hours its clock is ahead of universal time.
    /// `None` for no such date.
    pub fn new([year, month, day]: [i64; 3], hours: f64, ahead_hours: f64) -> Option<Self> {
        let is_leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
        let lengths = [31, if is_leap { 29 } else { 28 }, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
        let length = *lengths.get(usize::try_from(month - 1).ok()?)?;
        if !(1..=length).contains(&day) || !(1900..=2100).contains(&year) {
            return None;
        }
        // Days before the year, from 1 January 2000 on; then those before the month.
        let before = year - 1;
        let leaps = |year: i64| year / 4 - year / 100 + year / 400;
        let years = 365 * (year - 2000) + leaps(before) - leaps(1999);
        let months: i64 = lengths[..(month - 1) as usize].iter().sum();
        let midnight = (years + months + day - 1) as f64 - 0.5;
        Some(Self { days: midnight + (hours - ahead_hours) / 24.0 })
    }
}

/// The sun's place in the sky over a place on earth: degrees north and east.
pub fn sun_position(moment: Moment, latitude_deg: f64, longitude_deg: f64) -> Angles {
    let n = moment.days;
    // The ecliptic: mean longitude and anomaly, longitude, obliquity.
    let mean_longitude = 280.460 + 0.985_647_4 * n;
    let anomaly = (357.528 + 0.985_600_3 * n).to_radians();
    let longitude = (mean_longitude + 1.915 * libm::sin(anomaly) + 0.020 * libm::sin(2.0 * anomaly)).to_radians();
    let obliquity = (23.439 - 0.000_000_4 * n).to_radians();
    // The equator.
    let right_ascension = libm::atan2(libm::cos(obliquity) * libm::sin(longitude), libm::cos(longitude));
    let declination = libm::asin(libm::sin(obliquity) * libm::sin(longitude));
    // The horizon. Greenwich mean sidereal time: hours at 0 h, and how the day goes on.
    let universal_hours = 24.0 * (n + 0.5).rem_euclid(1.0);
    let sidereal_hours = 6.697_375 + 0.065_709_824_2 * n + universal_hours;
    let local = (15.0 * sidereal_hours + longitude_deg).to_radians();
    let hour_angle = local - right_ascension;
    let latitude = latitude_deg.to_radians();
    let (sin_l, cos_l) = (libm::sin(latitude), libm::cos(latitude));
    let (sin_d, cos_d) = (libm::sin(declination), libm::cos(declination));
    let (sin_h, cos_h) = (libm::sin(hour_angle), libm::cos(hour_angle));
    let up = sin_d * sin_l + cos_d * cos_l * cos_h;
    let (north, east) = (sin_d * cos_l - cos_d * sin_l * cos_h, -cos_d * sin_h);
    let level = (north * north + east * east).sqrt();
    Angles {
        altitude_deg: libm::atan2(up, level).to_degrees(),
        azimuth_deg: libm::atan2(east, north).to_degrees().rem_euclid(360.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(date: [i64; 3], hours: f64, ahead: f64, latitude: f64, longitude: f64) -> Angles {
        sun_position(Moment::new(date, hours, ahead).unwrap(), latitude, longitude)
    }

    /// Reda & Andreas 2008, "Solar Position Algorithm", table A5.1: 39.8720° before refraction, 194.3402°.
    #[test]
    fn the_sun_stands_where_the_exact_algorithm_puts_it() {
        let sun = at([2003, 10, 17], 12.0 + 30.5 / 60.0, -7.0, 39.742_476, -105.178_6);
        assert!((sun.altitude_deg - 39.872).abs() < 0.02, "{sun:?}");
        assert!((sun.azimuth_deg - 194.340).abs() < 0.02, "{sun:?}");
    }

    /// At solstice the sun stands in the zenith of a tropic at noon, and is as high in the north as it is low in the south.
    #[test]
    fn solstice_and_equinox() {
        // Solar noon in Greenwich: 12:01:50 on that day.
        let noon = 12.0 + 110.0 / 3600.0;
        let summer = at([2020, 6, 20], noon, 0.0, 23.4367, 0.0);
        assert!(summer.altitude_deg > 89.9, "{summer:?}");
        let low = at([2020, 6, 20], noon, 0.0, -40.0, 0.0);
        assert!((low.altitude_deg - (90.0 - 63.4367)).abs() < 0.05 && (low.azimuth_deg - 360.0).abs() < 0.5, "{low:?}");
        let morning = at([2020, 3, 20], 6.0 + 7.5 / 60.0, 0.0, 0.0, 0.0);
        assert!(morning.altitude_deg.abs() < 0.2 && (morning.azimuth_deg - 90.0).abs() < 0.2, "{morning:?}");
    }

    #[test]
    fn the_calendar_is_gregorian() {
        let days = |date| Moment::new(date, 12.0, 0.0).map(|moment| moment.days);
        assert_eq!((days([2000, 1, 1]), days([2000, 3, 1]), days([2001, 1, 1])), (Some(0.0), Some(60.0), Some(366.0)));
        assert_eq!((days([1999, 12, 31]), days([1900, 3, 1])), (Some(-1.0), Some(-36465.0)));
        for none in [[2001, 2, 29], [2000, 13, 1], [2000, 0, 1], [2000, 4, 31], [2000, 1, 0], [1800, 1, 1]] {
            assert_eq!(days(none), None, "{none:?}");
        }
    }
}
