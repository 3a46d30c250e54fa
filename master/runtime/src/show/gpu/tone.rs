//! Tone mapping as a compute shader: exposure, curve, sRGB. Codes differ by at most one from the processor's, where a
//! value lies on the border between two.

use bytemuck::{Pod, Zeroable};
use frame::Picture;
use frame::tone::{Image8, Operator, Tone};

use super::{Gpu, Kept};
use crate::display::encoded::ToneMapper;

/// On a graphics processor; on this processor from the first failure on.
pub struct GpuToneMapper {
    gpu: Gpu,
    kernel: wgpu::ComputePipeline,
    parameters: Kept,
    radiance: Kept,
    codes: Kept,
    back: Kept,
    failed: bool,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Parameters {
    width: u32,
    height: u32,
    curve: u32,
    scale: f32,
}

impl GpuToneMapper {
    /// Makes the shader ready.
    pub fn new(gpu: Gpu) -> Self {
        let [kernel] = gpu.kernels(include_str!("tone.wgsl"), ["develop"]);
        let [parameters, radiance, codes, back] = [(); 4].map(|()| Kept::default());
        Self { gpu, kernel, parameters, radiance, codes, back, failed: false }
    }

    fn try_tone_map(&mut self, tone: &Tone, picture: &Picture) -> Result<Image8, String> {
        let curve = match tone.operator {
            Operator::None => 0,
            Operator::Reinhard => 1,
            Operator::Aces => 2,
            Operator::Agx => 3,
        };
        let Picture { width, height, .. } = *picture;
        let parameters = Parameters { width, height, curve, scale: tone.exposure.scale(picture) };
        let parameters = self.gpu.input(&mut self.parameters, bytemuck::bytes_of(&parameters))?;
        let radiance = self.gpu.input(&mut self.radiance, bytemuck::cast_slice(&picture.pixels))?;
        let codes = self.gpu.room(&mut self.codes, 4 * picture.pixels.len() as u64)?;
        let buffers = [(0, &parameters), (1, &radiance), (2, &codes)];
        let bytes = self.gpu.run(&[(&self.kernel, &buffers)], [width, height], &codes, &mut self.back)?;
        let pixels = bytes.chunks_exact(4).map(|code| [code[0], code[1], code[2]]).collect();
        Ok(Image8 { width, height, pixels })
    }
}

impl ToneMapper for GpuToneMapper {
    fn tone_map(&mut self, tone: &Tone, picture: &Picture) -> Image8 {
        if !self.failed && !picture.pixels.is_empty() {
            match self.try_tone_map(tone, picture) {
                Ok(image) => return image,
                Err(reason) => {
                    tracing::warn!("tone mapping goes on without the graphics processor: {reason}");
                    self.failed = true;
                }
            }
        }
        tone.develop(picture)
    }
}

#[cfg(test)]
mod tests {
    use frame::tone::Exposure;
    use glam::Vec3;

    use super::super::tests::any;
    use super::*;

    #[test]
    fn codes_are_those_of_the_processor_within_one() {
        let Some(gpu) = any() else { return };
        let mut tone_mapper = GpuToneMapper::new(gpu);
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, f32::MAX, f32::MIN_POSITIVE, 0.0, -0.0];
        // Twenty stops in every channel against the others, and everything that is no proper number.
        let value = |i: u32| match i {
            0..8 => odd[i as usize],
            _ => ((i - 8) as f32 / 13.0 - 13.0).exp2(),
        };
        let picture = Picture::from_fn(271, 272, |x, y| Vec3::new(value(x), value(y), value((x + 3 * y) % 271)));
        for operator in [Operator::None, Operator::Reinhard, Operator::Aces, Operator::Agx] {
            for stops in [-3.0, 0.0, 1.5, 100.0, -100.0] {
                let tone = Tone { exposure: Exposure::Fixed(stops), operator };
                let (here, there) = (tone.develop(&picture), tone_mapper.try_tone_map(&tone, &picture).unwrap());
                assert_eq!((there.width, there.height), (271, 272));
                let pairs = || here.bytes().iter().zip(there.bytes());
                let worst = pairs().map(|(a, b)| a.abs_diff(*b)).max();
                let others = pairs().filter(|(a, b)| a != b).count() as f64 / here.bytes().len() as f64;
                assert!(worst <= Some(1), "{operator:?} {stops}: {worst:?}");
                assert!(others < 0.002, "{operator:?} {stops}: {others}");
            }
        }
    }
}
