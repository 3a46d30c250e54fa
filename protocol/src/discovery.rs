//! How masters are found on a local network: by DNS-SD (RFC 6763) over multicast DNS.
//!
//! A master says where it is and which token it is for; it says nothing that lets anybody in. A worker
//! takes no notice on trust either: whoever it is led to must have the token's certificate.

use crate::identity::Fingerprint;

/// The type of the service.
pub const SERVICE: &str = "_igi._udp.local.";

/// What a master says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Notice {
    /// [`crate::message::VERSION`] that it speaks.
    pub version: u16,
    /// Of its certificate, as in its token.
    pub fingerprint: Fingerprint,
}

impl Notice {
    /// The TXT record: keys and values.
    pub fn text(&self) -> [(&'static str, String); 3] {
        let fingerprint = self.fingerprint.iter().map(|byte| format!("{byte:02x}")).collect();
        [("txtvers", "1".to_owned()), ("proto", self.version.to_string()), ("fp", fingerprint)]
    }

    /// Reads a TXT record, hostile as everything from the network; `None` if it is not one of ours.
    pub fn parse<'a>(value: impl Fn(&str) -> Option<&'a str>) -> Option<Self> {
        let digits = value("fp").filter(|digits| digits.len() == 32 && digits.is_ascii())?;
        let mut fingerprint = Fingerprint::default();
        for (byte, at) in fingerprint.iter_mut().zip((0..).step_by(2)) {
            *byte = u8::from_str_radix(&digits[at..at + 2], 16).ok()?;
        }
        let version = value("proto")?.parse().ok()?;
        (value("txtvers") == Some("1")).then_some(Self { version, fingerprint })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_notice_survives_the_network(version: u16, fingerprint: Fingerprint) {
            let notice = Notice { version, fingerprint };
            let text = notice.text();
            let value = |key: &str| text.iter().find(|(known, _)| *known == key).map(|(_, value)| value.as_str());
            prop_assert_eq!(Notice::parse(value), Some(notice));
        }

        #[test]
        fn no_text_panics(fp: String, proto: String) {
            let value = |key: &str| match key { "fp" => Some(&*fp), "proto" => Some(&*proto), _ => Some("1") };
            let _ = Notice::parse(value);
        }
    }

    #[test]
    fn what_is_not_ours_is_left_alone() {
        let zeros = "0".repeat(32);
        let parse = |fp: &str, proto: &str, txtvers: &str| {
            Notice::parse(|key| {
                Some(match key {
                    "fp" => fp,
                    "proto" => proto,
                    _ => txtvers,
                })
                .filter(|s| !s.is_empty())
            })
        };
        assert!(parse(&zeros, "2", "1").is_some());
        assert!(parse("", "2", "1").is_none() && parse(&zeros, "", "1").is_none() && parse(&zeros, "2", "").is_none());
        assert!(parse(&zeros[1..], "2", "1").is_none() && parse(&"g".repeat(32), "2", "1").is_none());
        assert!(parse(&"é".repeat(16), "2", "1").is_none() && parse(&zeros, "-1", "1").is_none());
    }
}
