//! The points of a tile, arranged so that shafts towards them are slim.
//!
//! Points on both sides of a depth edge would make one wide shaft through everything between them, so
//! they are first split into *clusters*, where that makes the boxes much smaller. Within a cluster
//! they are ordered so that each *group* of sixteen neighbours is compact. Done once a tile, used for
//! every virtual light.

use glam::Vec3;

use super::bounds::Aabb;

/// Points in one group: the widest vector there is.
pub(super) const GROUP: usize = 16;
/// Most points in one cluster: eight groups, tested against boxes at once.
pub(super) const CLUSTER: usize = 8 * GROUP;

/// A cluster is split where its halves have less than this of its surface together …
const SPLIT_AREA: f32 = 0.5;
/// … until there are so many, above what their number of points demands.
const CLUSTERS_MAX: usize = 12;

/// Points that are to be tested from many apexes.
pub struct Targets {
    /// In the order given.
    points: Vec<Vec3>,
    /// In clusters, each padded to whole groups with copies of one of its points.
    pub(super) arranged: [Vec<f32>; 3],
    /// Number of the point at each place; meaningless where padded.
    pub(super) numbers: Vec<u32>,
    pub(super) clusters: Vec<Cluster>,
    /// Bits of the points of each group, if there are at most 256 points.
    pub(super) bits: Vec<[u64; 4]>,
    /// Numbers of points that no shaft can take: not finite, or too far away.
    pub(super) odd: Vec<u32>,
}

/// Some points close together.
pub(super) struct Cluster {
    /// Of its first place; a multiple of [`GROUP`].
    pub start: usize,
    /// Points, at most [`CLUSTER`].
    pub count: usize,
    pub bounds: Aabb,
    /// Bounds of each group, as in [`super::tree::Node::faces`].
    pub groups: [[f32; 8]; 6],
}

impl Targets {
    /// Points farther out, or apexes, are tested one by one.
    pub(super) const FAR: f32 = (1u64 << 40) as f32;

    /// Arranges points; best are up to 256 of a picture tile, neighbours after one another: groups are made in
    /// the order given.
    pub fn new(points: impl IntoIterator<Item = Vec3>) -> Self {
        let points: Vec<Vec3> = points.into_iter().collect();
        let fits = |p: &u32| points[*p as usize].abs().cmplt(Vec3::splat(Self::FAR)).all();
        let (mut fitting, odd): (Vec<u32>, Vec<u32>) = (0..points.len() as u32).partition(fits);
        let mut targets = Self {
            arranged: Default::default(),
            numbers: Vec::with_capacity(points.len() + 64),
            clusters: Vec::new(),
            bits: Vec::new(),
            odd,
            points,
        };
        for (numbers, bounds) in clusters(&targets.points, &mut fitting) {
            targets.append(numbers, bounds);
        }
        targets
    }

    /// How many points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The points, in the order given.
    pub fn points(&self) -> &[Vec3] {
        &self.points
    }

    fn append(&mut self, numbers: &[u32], bounds: Aabb) {
        let point = |&number: &u32| self.points[number as usize];
        let mut cluster = Cluster { start: self.numbers.len(), count: numbers.len(), bounds, groups: [[0.0; 8]; 6] };
        for (group, members) in numbers.chunks(GROUP).enumerate() {
            let bounds = Aabb::of(members.iter().map(point));
            for axis in 0..3 {
                cluster.groups[axis][group] = bounds.min[axis];
                cluster.groups[3 + axis][group] = bounds.max[axis];
            }
            let padding = std::iter::repeat_n(&members[0], GROUP - members.len());
            for number in members.iter().chain(padding) {
                let point = self.points[*number as usize];
                for axis in 0..3 {
                    self.arranged[axis].push(point[axis]);
                }
                self.numbers.push(*number);
            }
            if self.points.len() <= 256 {
                let mut bits = [0; 4];
                members.iter().for_each(|&number| bits[number as usize / 64] |= 1 << (number % 64));
                self.bits.push(bits);
            }
        }
        self.clusters.push(cluster);
    }
}

impl Cluster {
    /// Which places of a group are points, not padding.
    #[inline(always)]
    pub fn members(&self, group: usize) -> u16 {
        let count = self.count.saturating_sub(group * GROUP).min(GROUP);
        ((1_u32 << count) - 1) as u16
    }
}

/// Splits points into clusters, which keep their order.
fn clusters<'a>(points: &[Vec3], numbers: &'a mut [u32]) -> Vec<(&'a mut [u32], Aabb)> {
    let bounds = bounds_of(points, numbers);
    let (mut open, mut done) = (vec![(numbers, bounds)], Vec::new());
    let mut set_aside = Vec::new();
    while let Some((numbers, bounds)) = open.pop() {
        let axis = longest_axis(&bounds);
        let middle = bounds.centre()[axis];
        let at = partition(numbers, &mut set_aside, |number| points[number as usize][axis] < middle);
        let halves = [&numbers[..at], &numbers[at..]].map(|half| bounds_of(points, half));
        let worthwhile = halves[0].half_area() + halves[1].half_area() < SPLIT_AREA * bounds.half_area()
            && open.len() + done.len() < CLUSTERS_MAX;
        if worthwhile || (numbers.len() > CLUSTER && at > 0 && at < numbers.len()) {
            let (low, high) = numbers.split_at_mut(at);
            open.extend([(high, halves[1]), (low, halves[0])]);
        } else if numbers.len() > CLUSTER {
            // All in one place.
            let (low, high) = numbers.split_at_mut(numbers.len() / 2);
            open.extend([(high, bounds), (low, bounds)]);
        } else if !numbers.is_empty() {
            done.push((numbers, bounds));
        }
    }
    done
}

/// Moves those that satisfy a condition to the front; both parts stay in order. How many do.
fn partition(numbers: &mut [u32], set_aside: &mut Vec<u32>, belongs: impl Fn(u32) -> bool) -> usize {
    set_aside.clear();
    let mut count = 0;
    for i in 0..numbers.len() {
        if belongs(numbers[i]) {
            numbers[count] = numbers[i];
            count += 1;
        } else {
            set_aside.push(numbers[i]);
        }
    }
    numbers[count..].copy_from_slice(set_aside);
    count
}

fn bounds_of(points: &[Vec3], numbers: &[u32]) -> Aabb {
    Aabb::of(numbers.iter().map(|number| points[*number as usize]))
}

fn longest_axis(bounds: &Aabb) -> usize {
    let d = bounds.diagonal();
    if d.x >= d.y && d.x >= d.z {
        0
    } else if d.y >= d.z {
        1
    } else {
        2
    }
}
