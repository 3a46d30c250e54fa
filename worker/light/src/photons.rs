//! The caustic photon map C_k: photons in a hashed grid of cell 2r, a query makes 8 look-ups (IGI-4).

use glam::Vec3;
use scenes::Rgb;

/// Flux that arrived at a diffuse surface through a chain of specular ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photon {
    /// Where it arrived.
    pub position: Vec3,
    /// Interpolated normal there, without relief, on the side it arrived from.
    pub normal: Vec3,
    /// Unit direction back to where it came from.
    pub from: Vec3,
    /// Its share of the set's flux, W; corrected for the shading normal, less what rays find of it ([`crate::caustics`]), and
    /// more where part of its disc is no surface ([`crate::footprint`]).
    pub flux: Rgb,
    /// Sharp lobes and frosted glass where it lies show it to the eye: its light has no surface that rays could meet, and
    /// came by mirrors and clear glass alone. Of other light, rays that are followed there find all.
    pub shines_on: bool,
}

impl Photon {
    /// It lights a place of its surface, being no further away than the radius.
    pub fn reaches(&self, place: Vec3, radius: f32) -> bool {
        self.position.distance_squared(place) <= radius * radius
    }
}

/// Two normals of places close together, for one surface that bends: photons on another one light nothing there.
pub fn same_surface(a: Vec3, b: Vec3) -> bool {
    a.dot(b) > SAME_SURFACE
}

/// Photons of one light set, ordered by grid cell.
#[derive(Clone, Debug, Default)]
pub struct PhotonMap {
    radius: f32,
    photons: Vec<Photon>,
    /// Hash of each photon's cell, parallel to `photons`: other cells may share its bucket.
    cells: Vec<u64>,
    /// `buckets[b]..buckets[b + 1]` are the photons of bucket b. A power of two and one.
    buckets: Vec<u32>,
    /// Least and greatest coordinates of all photons.
    corners: [Vec3; 2],
}

/// Photons whose normal differs by more than this from the receiver's lie on another surface.
const SAME_SURFACE: f32 = 0.5;

impl PhotonMap {
    /// Sorts photons into the grid; their order within a cell stays, so sums are repeatable.
    pub fn new(photons: Vec<Photon>, radius: f32) -> Self {
        if photons.is_empty() || radius <= 0.0 {
            return Self::default();
        }
        let bucket_count = photons.len().next_power_of_two();
        let cells: Vec<u64> = photons.iter().map(|p| cell_hash(cell_of(p.position, radius, 0.0))).collect();
        let mut order: Vec<u32> = (0..photons.len() as u32).collect();
        let bucket = |i: u32| cells[i as usize] as usize & (bucket_count - 1);
        order.sort_by_key(|i| bucket(*i));
        let mut buckets = vec![0; bucket_count + 1];
        for i in &order {
            buckets[bucket(*i) + 1] += 1;
        }
        for b in 0..bucket_count {
            buckets[b + 1] += buckets[b];
        }
        Self {
            radius,
            photons: order.iter().map(|i| photons[*i as usize]).collect(),
            cells: order.iter().map(|i| cells[*i as usize]).collect(),
            buckets,
            corners: photons.iter().fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], p| {
                [low.min(p.position), high.max(p.position)]
            }),
        }
    }

    /// Nothing arrived.
    pub fn is_empty(&self) -> bool {
        self.photons.is_empty()
    }

    /// Number of photons kept.
    pub fn len(&self) -> usize {
        self.photons.len()
    }

    /// What points between two corners may find of it: for many points close together, most of which are
    /// far from any photon. They find what the whole map would tell them, to the bit.
    pub fn around(&self, low: Vec3, high: Vec3) -> Nearby<'_> {
        let mut nearby = Nearby { map: self, corners: [Vec3::INFINITY, Vec3::NEG_INFINITY] };
        let reach = self.radius * self.radius;
        // Rounding is monotone: no point is closer to a photon than its box, computed like this.
        let far = |from: Vec3, to: Vec3| (low - to).max(from - high).max(Vec3::ZERO).length_squared() > reach;
        if self.photons.is_empty() || far(self.corners[0], self.corners[1]) {
            return nearby;
        }
        for photon in self.photons.iter().filter(|photon| !far(photon.position, photon.position)) {
            nearby.corners[0] = nearby.corners[0].min(photon.position);
            nearby.corners[1] = nearby.corners[1].max(photon.position);
        }
        nearby
    }

    /// Irradiance at a point: `Σ Φ / πr²` over the photons within r on the same surface, each weighted.
    pub fn gather(&self, position: Vec3, normal: Vec3, weight: impl Fn(&Photon) -> Rgb) -> Rgb {
        Nearby { map: self, corners: self.corners }.gather(position, normal, weight)
    }

    fn look_up(&self, position: Vec3, normal: Vec3, weight: impl Fn(&Photon) -> Rgb) -> Rgb {
        let reach = self.radius * self.radius;
        let mut flux = Vec3::ZERO;
        for cell in eight_hashes(cell_of(position, self.radius, -f64::from(self.radius))) {
            let bucket = cell as usize & (self.buckets.len() - 2);
            for i in self.buckets[bucket] as usize..self.buckets[bucket + 1] as usize {
                let photon = &self.photons[i];
                let is_near = self.cells[i] == cell && photon.reaches(position, self.radius);
                if is_near && same_surface(photon.normal, normal) {
                    flux += photon.flux * weight(photon);
                }
            }
        }
        flux / (std::f32::consts::PI * reach)
    }
}

/// The photons of a map that points in some box may find.
#[derive(Clone, Copy, Debug)]
pub struct Nearby<'a> {
    map: &'a PhotonMap,
    /// Least and greatest coordinates of them.
    corners: [Vec3; 2],
}

impl Nearby<'_> {
    /// There are none.
    pub fn is_empty(&self) -> bool {
        self.map.photons.is_empty() || self.corners[0].x > self.corners[1].x
    }

    /// Irradiance at a point: `Σ Φ / πr²` over the photons within r on the same surface.
    pub fn irradiance(&self, position: Vec3, normal: Vec3) -> Rgb {
        self.gather(position, normal, |_| Vec3::ONE)
    }

    /// Like [`Self::irradiance`], each photon weighted.
    pub fn gather(&self, position: Vec3, normal: Vec3, weight: impl Fn(&Photon) -> Rgb) -> Rgb {
        if self.is_empty() {
            return Vec3::ZERO;
        }
        // As in [`PhotonMap::around`]: no photon is closer than their box.
        let outside = (self.corners[0] - position).max(position - self.corners[1]).max(Vec3::ZERO);
        if outside.length_squared() > self.map.radius * self.map.radius {
            return Vec3::ZERO;
        }
        self.map.look_up(position, normal, weight)
    }
}

/// The cell of edge 2r that a point, moved by `shift` along all axes, lies in. In f64 and i64: tiny
/// radii far out must not wrap.
fn cell_of(position: Vec3, radius: f32, shift: f64) -> [i64; 3] {
    let scale = 0.5 / f64::from(radius);
    let floor = |x: f64| x as i64 - i64::from(x < (x as i64) as f64);
    let [x, y, z] = [position.x, position.y, position.z];
    [
        floor((f64::from(x) + shift) * scale),
        floor((f64::from(y) + shift) * scale),
        floor((f64::from(z) + shift) * scale),
    ]
}

fn cell_hash([x, y, z]: [i64; 3]) -> u64 {
    hash_on(hash_on(hash_on(0x9e37_79b9_7f4a_7c15, x), y), z)
}

/// splitmix64's finaliser over one more coordinate.
fn hash_on(hash: u64, part: i64) -> u64 {
    let hash = (hash ^ part as u64).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let hash = (hash ^ hash >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    hash ^ hash >> 31
}

/// Hashes of a cell and its neighbours on the upper sides; x runs fastest.
fn eight_hashes([x, y, z]: [i64; 3]) -> [u64; 8] {
    let near = |part: i64| [part, part.wrapping_add(1)];
    let mut hashes = [0; 8];
    for (i, x) in near(x).into_iter().enumerate() {
        let along_x = hash_on(0x9e37_79b9_7f4a_7c15, x);
        for (j, y) in near(y).into_iter().enumerate() {
            let along_y = hash_on(along_x, y);
            for (k, z) in near(z).into_iter().enumerate() {
                hashes[i + 2 * j + 4 * k] = hash_on(along_y, z);
            }
        }
    }
    hashes
}

/// Radius of round `i` (from 0): `r_i² = r_1² Γ(i+α) / (Γ(1+α) Γ(i+1))` with α = 2/3, as the product
/// `r²_{i+1} = r²_i (i+α)/(i+1)` (Knaus & Zwicker 2011). A function of the round alone, so that
/// stateless workers obey it.
pub fn radius_of_round(first: f32, round: u32) -> f32 {
    const ALPHA: f64 = 2.0 / 3.0;
    // The product telescopes into Gamma functions; round + 1 is their 1-based iteration.
    let i = f64::from(round) + 1.0;
    let log_ratio = libm::lgamma(i + ALPHA) - libm::lgamma(1.0 + ALPHA) - libm::lgamma(i + 1.0);
    first * libm::exp(0.5 * log_ratio) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_look_ups_find_what_brute_force_finds() {
        let random = |i: u32, salt: u32| crate::sample::mix(i * 4 + salt) as f32 / 4_294_967_296.0;
        for (scale, offset) in [(1.0_f32, 0.0_f32), (1e-3, -5e-4), (1e4, -5e3), (1.0, 3e5)] {
            let point =
                |i: u32| Vec3::new(random(i, 0), random(i, 1), 0.05 * random(i, 2)) * scale + Vec3::splat(offset);
            let photons: Vec<Photon> = (0..3000)
                .map(|i| Photon {
                    position: point(i),
                    normal: Vec3::Z,
                    from: Vec3::Z,
                    flux: Vec3::splat(random(i, 3)),
                    shines_on: false,
                })
                .collect();
            for radius in [0.05 * scale, 1e-9 * scale] {
                let map = PhotonMap::new(photons.clone(), radius);
                for i in 5000..5200 {
                    let at = if i % 2 == 0 { point(i) } else { photons[i as usize - 5000].position };
                    let brute: f32 = photons
                        .iter()
                        .filter(|p| p.position.distance_squared(at) <= radius * radius)
                        .map(|p| p.flux.x)
                        .sum::<f32>()
                        / (std::f32::consts::PI * radius * radius);
                    let found = map.gather(at, Vec3::Z, |_| Vec3::ONE).x;
                    assert!((found - brute).abs() <= 1e-5 * brute.max(1e-20), "{found} against {brute}");
                    let size = Vec3::splat(0.04 * scale);
                    let nearby = map.around(at - size * random(i, 1), at + size * random(i, 2));
                    assert_eq!(nearby.irradiance(at, Vec3::Z).x, found);
                }
            }
        }
    }

    #[test]
    fn the_radius_follows_knaus_and_zwicker() {
        let mut r2 = radius_of_round(2.0, 0).powi(2);
        assert!((r2 - 4.0).abs() < 1e-5);
        for i in 1..200_u32 {
            r2 *= (i as f32 + 2.0 / 3.0) / (i as f32 + 1.0);
            let closed = radius_of_round(2.0, i).powi(2);
            assert!((closed / r2 - 1.0).abs() < 1e-4, "round {i}: {closed} against {r2}");
        }
    }
}
