// Exposure, tone curve, sRGB: as frame/src/tone, of which the constants are.

struct Parameters {
    width: u32,
    height: u32,
    curve: u32,
    scale: f32,
}

@group(0) @binding(0) var<storage, read> parameters: Parameters;
// Bits of 32-bit floats: shaders may take for granted that there is no NaN.
@group(0) @binding(1) var<storage, read> radiance: array<u32>;
// Red, green, blue from the lowest byte on.
@group(0) @binding(2) var<storage, read_write> codes: array<u32>;

const BRIGHTEST: f32 = 1e9;
const REINHARD_WHITE: f32 = 4.0;

const ACES_FROM_REC709 = mat3x3<f32>(
    vec3(0.59719, 0.076, 0.0284), vec3(0.35458, 0.90834, 0.13383), vec3(0.04823, 0.01566, 0.83777));
const REC709_FROM_ACES = mat3x3<f32>(
    vec3(1.60475, -0.10208, -0.00327), vec3(-0.53108, 1.10813, -0.07276), vec3(-0.07367, -0.00605, 1.07602));
const AGX_INSET = mat3x3<f32>(
    vec3(0.8424791, 0.042328242, 0.042375655), vec3(0.0784336, 0.8784686, 0.0784336), vec3(0.079223745, 0.07916613, 0.879143));
const AGX_OUTSET = mat3x3<f32>(
    vec3(1.196879, -0.05289685, -0.052971635), vec3(-0.09802088, 1.1519031, -0.09804345), vec3(-0.09902974, -0.09896118, 1.1510737));
const AGX_LOWEST_STOP: f32 = -12.47393;
const AGX_HIGHEST_STOP: f32 = 4.026069;

// What is no number is black; what is infinite is very bright.
fn exposed(bits: u32) -> f32 {
    if bits > 0x7f800000u {
        // Negative, or no number.
        return 0.0;
    }
    if bits == 0x7f800000u {
        return BRIGHTEST;
    }
    let value = bitcast<f32>(bits);
    return select(value * parameters.scale, BRIGHTEST, value > BRIGHTEST / parameters.scale);
}

fn reinhard(colour: vec3<f32>) -> vec3<f32> {
    let l = dot(colour, vec3(0.2126, 0.7152, 0.0722));
    return colour * ((1.0 + l / (REINHARD_WHITE * REINHARD_WHITE)) / (1.0 + l));
}

fn aces(colour: vec3<f32>) -> vec3<f32> {
    let v = ACES_FROM_REC709 * colour;
    let low = v * (v + 0.0245786) - 0.000090537;
    let high = v * (0.983729 * v + 0.432951) + 0.238081;
    return REC709_FROM_ACES * (low / high);
}

fn agx(colour: vec3<f32>) -> vec3<f32> {
    let stops = log2(max(AGX_INSET * colour, vec3(1.17549435e-38)));
    let x = clamp((stops - AGX_LOWEST_STOP) / (AGX_HIGHEST_STOP - AGX_LOWEST_STOP), vec3(0.0), vec3(1.0));
    let x2 = x * x;
    let x4 = x2 * x2;
    let curve = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
    return AGX_OUTSET * curve;
}

fn srgb(value: vec3<f32>) -> vec3<f32> {
    let v = clamp(value, vec3(0.0), vec3(1.0));
    let curved = 1.055 * pow(max(v, vec3(1e-9)), vec3(1.0 / 2.4)) - 0.055;
    return select(curved, 12.92 * v, v <= vec3(0.0031308));
}

@compute @workgroup_size(64)
fn develop(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= parameters.width {
        return;
    }
    let pixel = id.y * parameters.width + id.x;
    let colour = vec3(exposed(radiance[3u * pixel]), exposed(radiance[3u * pixel + 1u]), exposed(radiance[3u * pixel + 2u]));
    var shown: vec3<f32>;
    switch parameters.curve {
        case 1u: { shown = srgb(reinhard(colour)); }
        case 2u: { shown = srgb(aces(colour)); }
        // AgX ends in display values: its curve is the display's encoding as well.
        case 3u: { shown = clamp(agx(colour), vec3(0.0), vec3(1.0)); }
        default: { shown = srgb(colour); }
    }
    let code = vec3<u32>(shown * 255.0 + 0.5);
    codes[pixel] = code.x | (code.y << 8u) | (code.z << 16u);
}
