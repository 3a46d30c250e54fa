// The discontinuity buffer and how it fades: as frame/src/parts/discontinuity.rs and fade.rs.

struct Parameters {
    width: u32,
    height: u32,
    stride: u32,
    margin: u32,
    planes: u32,
    columns: u32,
    rows: u32,
    judged: u32,
    by_planes: u32,
    cosine: f32,
    distance: f32,
    share_a: f32,
    share_b: f32,
    noise_at_most: f32,
}

@group(0) @binding(0) var<storage, read> parameters: Parameters;
// Offset and weight: first along a row, then down a column.
@group(0) @binding(1) var<storage, read> taps: array<vec2<f32>>;
// Rows of planes, see Guide.
@group(0) @binding(2) var<storage, read> means: array<f32>;
// A pixel: change of radiance (3), square of the change of irradiance, its noise, change of each half's irradiance (2),
// square of what stays in the window's mean of the change, its noise.
@group(0) @binding(3) var<storage, read_write> changes: array<f32>;
@group(0) @binding(4) var<storage, read_write> picture: array<f32>;

const RADIANCE = 0u;
const REFLECTANCE = 3u;
const NORMAL = 6u;
const DISTANCE = 9u;
const IRRADIANCE_A = 10u;
const IRRADIANCE_B = 13u;
const POSITION = 16u;
const TOLERANCE = 19u;
const CHANGES = 9u;

const REACH = 3;
const KEPT = 0.07;
const SURE = 3.0;

fn value(plane: u32, x: u32, y: u32) -> f32 {
    return means[(y * parameters.planes + plane) * parameters.stride + parameters.margin + x];
}

fn values(plane: u32, x: u32, y: u32) -> vec3<f32> {
    return vec3(value(plane, x, y), value(plane + 1u, x, y), value(plane + 2u, x, y));
}

// Where there is no surface, normals are no numbers; distances are 0 there, which shaders can ask about.
fn is_surface(x: u32, y: u32) -> bool {
    return value(DISTANCE, x, y) > 0.0;
}

fn is_same(x: u32, y: u32, u: u32, v: u32, offset: f32) -> bool {
    if !is_surface(x, y) || !is_surface(u, v) {
        return false;
    }
    let n = values(NORMAL, x, y);
    let m = values(NORMAL, u, v);
    if n.x * m.x + n.y * m.y + n.z * m.z < parameters.cosine {
        return false;
    }
    if parameters.by_planes == 0u {
        let mine = value(DISTANCE, x, y);
        return abs(mine - value(DISTANCE, u, v)) <= parameters.distance * mine;
    }
    let towards = values(POSITION, u, v) - values(POSITION, x, y);
    let limit = value(TOLERANCE, x, y) * offset;
    let in_mine = n.x * towards.x + n.y * towards.y + n.z * towards.z;
    let in_theirs = m.x * towards.x + m.y * towards.y + m.z * towards.z;
    return abs(in_mine) <= limit && abs(in_theirs) <= limit;
}

@compute @workgroup_size(64)
fn smooth_irradiance(@builtin(global_invocation_id) id: vec3<u32>) {
    let x = id.x;
    let y = id.y;
    if x >= parameters.width {
        return;
    }
    var sum_a = vec3(0.0);
    var sum_b = vec3(0.0);
    var known = vec3(0.0);
    for (var row = 0u; row < parameters.rows; row++) {
        let down = taps[parameters.columns + row];
        let v = i32(y) + i32(down.x);
        if v < 0 || v >= i32(parameters.height) {
            continue;
        }
        for (var column = 0u; column < parameters.columns; column++) {
            let along = taps[column];
            let u = i32(x) + i32(along.x);
            if u < 0 || u >= i32(parameters.width) {
                continue;
            }
            let is_here = along.x == 0.0 && down.x == 0.0;
            let offset = sqrt(along.x * along.x + down.x * down.x);
            if !is_here && !is_same(x, y, u32(u), u32(v), offset) {
                continue;
            }
            let reflects = values(REFLECTANCE, u32(u), u32(v)) > vec3(0.0);
            let weight = select(vec3(0.0), vec3(along.y * down.y), reflects);
            sum_a += weight * values(IRRADIANCE_A, u32(u), u32(v));
            sum_b += weight * values(IRRADIANCE_B, u32(u), u32(v));
            known += weight;
        }
    }
    let scale = select(vec3(0.0), 1.0 / known, known > vec3(0.0));
    let change_a = sum_a * scale - values(IRRADIANCE_A, x, y);
    var both = change_a;
    var square = 0.0;
    var noise = 0.0;
    var half_a = 0.0;
    var half_b = 0.0;
    if parameters.judged != 0u {
        let change_b = sum_b * scale - values(IRRADIANCE_B, x, y);
        both = parameters.share_a * change_a + parameters.share_b * change_b;
        // Irradiance on what is black is not known.
        let visible = select(vec3(0.0), vec3(1.0), values(REFLECTANCE, x, y) > vec3(0.0));
        let difference = visible * (change_a - change_b);
        square = dot(visible * both, both);
        noise = parameters.share_a * parameters.share_b * dot(difference, difference);
        half_a = dot(visible, change_a);
        half_b = dot(visible, change_b);
    }
    let at = CHANGES * (y * parameters.width + x);
    let change = both * values(REFLECTANCE, x, y);
    changes[at] = change.x;
    changes[at + 1u] = change.y;
    changes[at + 2u] = change.z;
    changes[at + 3u] = square;
    changes[at + 4u] = noise;
    changes[at + 5u] = half_a;
    changes[at + 6u] = half_b;
}

@compute @workgroup_size(64)
fn blur(@builtin(global_invocation_id) id: vec3<u32>) {
    let x = id.x;
    let y = id.y;
    if x >= parameters.width {
        return;
    }
    var mean_a = 0.0;
    var mean_b = 0.0;
    var area_down = 0.0;
    var area_along = 0.0;
    for (var row = 0u; row < parameters.rows; row++) {
        let down = taps[parameters.columns + row];
        area_down += down.y;
        area_along = 0.0;
        let v = i32(y) + i32(down.x);
        for (var column = 0u; column < parameters.columns; column++) {
            let along = taps[column];
            area_along += along.y;
            let u = i32(x) + i32(along.x);
            if v < 0 || v >= i32(parameters.height) || u < 0 || u >= i32(parameters.width) {
                continue;
            }
            let at = CHANGES * (u32(v) * parameters.width + u32(u));
            mean_a += along.y * down.y * changes[at + 5u];
            mean_b += along.y * down.y * changes[at + 6u];
        }
    }
    mean_a /= area_along * area_down;
    mean_b /= area_along * area_down;
    let both = parameters.share_a * mean_a + parameters.share_b * mean_b;
    let difference = mean_a - mean_b;
    let at = CHANGES * (y * parameters.width + x);
    changes[at + 7u] = both * both / 3.0;
    changes[at + 8u] = parameters.share_a * parameters.share_b * difference * difference / 3.0;
}

@compute @workgroup_size(64)
fn fade(@builtin(global_invocation_id) id: vec3<u32>) {
    let x = id.x;
    let y = id.y;
    if x >= parameters.width {
        return;
    }
    var weight = 1.0;
    if parameters.judged != 0u {
        var square = 0.0;
        var noise = 0.0;
        var blurred = 0.0;
        var blurred_noise = 0.0;
        for (var v = max(i32(y) - REACH, 0); v <= min(i32(y) + REACH, i32(parameters.height) - 1); v++) {
            for (var u = max(i32(x) - REACH, 0); u <= min(i32(x) + REACH, i32(parameters.width) - 1); u++) {
                let at = CHANGES * (u32(v) * parameters.width + u32(u));
                square += changes[at + 3u];
                noise += changes[at + 4u];
                blurred += changes[at + 7u];
                blurred_noise += changes[at + 8u];
            }
        }
        blurred = max(blurred - SURE * blurred_noise, 0.0) / KEPT;
        noise = max(noise, min(square - blurred, parameters.noise_at_most * noise));
        if blurred > 0.0 {
            weight = noise / (noise + blurred);
        }
    }
    let pixel = y * parameters.width + x;
    let at = CHANGES * pixel;
    let radiance = values(RADIANCE, x, y);
    picture[3u * pixel] = radiance.x + weight * changes[at];
    picture[3u * pixel + 1u] = radiance.y + weight * changes[at + 1u];
    picture[3u * pixel + 2u] = radiance.z + weight * changes[at + 2u];
}
