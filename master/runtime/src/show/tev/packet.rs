//! What tev is told: its protocol as bytes.
//!
//! A packet is its own length in bytes (u32), an operation (u8), and what that operation needs. Integers and floats are
//! little endian, a truth value is a byte, a text ends with a zero byte. [tev's README, "Over the Network", and the
//! functions `IpcPacket::set…` it points to.]

use glam::Vec3;

/// Operation `CreateImage`; what is of that name already is replaced.
const CREATE_IMAGE: u8 = 4;
/// Operation `UpdateImage`, third version: channels may be interleaved.
const UPDATE_IMAGE: u8 = 6;
const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// A rectangle of a picture, pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rect {
    pub x: u32,
    pub y: u32,
    pub width: u32,
    pub height: u32,
}

/// A black picture of that name. `grab_focus`: tev shows it, whatever it showed before.
pub(super) fn create_image(name: &str, [width, height]: [u32; 2], grab_focus: bool) -> Vec<u8> {
    let mut packet = Packet::new(CREATE_IMAGE, grab_focus, name);
    packet.number(width);
    packet.number(height);
    packet.channels();
    packet.finish()
}

/// Other pixels for a rectangle, row by row.
pub(super) fn update_image(name: &str, rect: Rect, pixels: impl Iterator<Item = Vec3>) -> Vec<u8> {
    let mut packet = Packet::new(UPDATE_IMAGE, false, name);
    packet.channels();
    [rect.x, rect.y, rect.width, rect.height].into_iter().for_each(|number| packet.number(number));
    let count = CHANNELS.len() as i64;
    let (offsets, strides) = (0..count, CHANNELS.iter().map(|_| count));
    offsets.chain(strides).for_each(|number| packet.0.extend(number.to_le_bytes()));
    packet.0.extend(pixels.flat_map(|pixel| pixel.to_array()).flat_map(f32::to_le_bytes));
    packet.finish()
}

struct Packet(Vec<u8>);

impl Packet {
    fn new(operation: u8, grab_focus: bool, name: &str) -> Self {
        let mut packet = Self(vec![0, 0, 0, 0, operation, u8::from(grab_focus)]);
        packet.text(name);
        packet
    }

    fn text(&mut self, text: &str) {
        self.0.extend(text.bytes().filter(|byte| *byte != 0));
        self.0.push(0);
    }

    fn number(&mut self, number: u32) {
        self.0.extend((number as i32).to_le_bytes());
    }

    fn channels(&mut self) {
        self.number(CHANNELS.len() as u32);
        CHANNELS.into_iter().for_each(|channel| self.text(channel));
    }

    fn finish(mut self) -> Vec<u8> {
        let length = self.0.len() as u32;
        self.0[..4].copy_from_slice(&length.to_le_bytes());
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_are_as_documented() {
        let mut expected = vec![31, 0, 0, 0, 4, 1];
        expected.extend(b"room\0");
        expected.extend([7, 0, 0, 0, 5, 0, 0, 0, 3, 0, 0, 0]);
        expected.extend(b"R\0G\0B\0");
        expected[0] = expected.len() as u8;
        assert_eq!(create_image("room", [7, 5], true), expected);

        let rect = Rect { x: 1, y: 2, width: 2, height: 1 };
        let packet = update_image("a", rect, [Vec3::new(1.0, 2.0, 3.0), Vec3::splat(4.0)].into_iter());
        let head = 4 + 1 + 1 + 2 + 4 + 6 + 16;
        assert_eq!(packet.len(), head + 3 * 8 + 3 * 8 + 2 * 3 * 4);
        assert_eq!(packet[head..head + 8], 0_i64.to_le_bytes());
        assert_eq!(packet[head + 24..head + 32], 3_i64.to_le_bytes());
        assert_eq!(packet[head + 48..head + 52], 1_f32.to_le_bytes());
    }
}
