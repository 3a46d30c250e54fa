//! Requests as questions: rays that one light set lights, sorted so that neighbours make slim shafts.

use std::collections::BTreeMap;

use protocol::question::{Address, Ask, BLOCK, Lit, Quality, Question, Ray, Rays, WorldState};
use scenes::Camera;

use super::cache::{Request, Requests};
use super::point::Origin;
use crate::parts::order::screen_key;

/// A batch on its way: for each question what it is about.
#[derive(Clone, Debug)]
pub(super) struct Batch {
    pub parts: Vec<Part>,
}

/// A question, and what is wanted of each of its rays.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub question: Question,
    pub camera: Camera,
    pub requests: Vec<Request>,
    pub origins: Vec<Origin>,
}

/// What all questions of a batch have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asking {
    pub world: WorldState,
    pub camera: Camera,
    pub seed: u64,
    pub quality: Quality,
    /// Counts batches.
    pub number: u32,
}

/// Rays of a question at most: a few milliseconds of a thread.
const RAYS_MAX: usize = 8 * BLOCK;
/// Light sets that workers are sure to keep.
const LIGHT_SETS: u32 = 54;

impl Asking {
    /// The light set and frame of a pixel's new sample. Neighbours have different ones, as far as a batch of `count` rays
    /// has some dozens for each; and all have others in the next batch. Not more are used than workers keep.
    fn light_of(&self, [x, y]: [u32; 2], count: usize) -> (u16, u32) {
        let sets = u32::from(self.quality.sets());
        let abreast = (count as u32 / BLOCK as u32).clamp(1, sets);
        let frames = (LIGHT_SETS / sets).max(1);
        let home = u32::from(self.quality.set_of(x, y, 0));
        // After as many batches as there are sets, every pixel has met each of one frame.
        let set = (home % abreast + self.number % sets) % sets;
        (set as u16, self.number / sets % frames)
    }

    /// The questions of a batch.
    pub fn batch(&self, requests: &Requests) -> Batch {
        type Group = (bool, u16, u32);
        let mut groups: BTreeMap<Group, Vec<(Request, Origin)>> = BTreeMap::new();
        for request in &requests.rays {
            let origin = request.repeats.unwrap_or_else(|| {
                let (set, frame) = self.light_of(request.pixel, requests.rays.len());
                Origin { address: Address { pixel: request.pixel, number: self.number }, set, frame, revision: 0 }
            });
            let origin = Origin { revision: self.world.revision, ..origin };
            groups.entry((request.predicted, origin.set, origin.frame)).or_default().push((*request, origin));
        }
        let mut parts = Vec::new();
        for ((predicted, set, frame), mut group) in groups {
            group.sort_by_cached_key(|(request, _)| screen_key(request.pixel));
            let camera = requests.predicted.filter(|_| predicted).unwrap_or(self.camera);
            for rays in group.chunks(RAYS_MAX) {
                let through = rays.iter().map(|(request, origin)| Ray { address: origin.address, aim: request.aim });
                let lit = Lit { set, frame, seed: self.seed, quality: self.quality };
                let ask = Ask::Rays(Rays { camera, view: None, through: through.collect(), lit });
                let question = Question { world: self.world, ask };
                let (requests, origins) = rays.iter().copied().unzip();
                parts.push(Part { question, camera, requests, origins });
            }
        }
        Batch { parts }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::methods::at_once::for_any_eye;

    fn requests(count: u32) -> Requests {
        let ray = |i: u32| Request {
            pixel: [i * 37 % 640, i * 91 % 480],
            point: None,
            aim: None,
            predicted: i.is_multiple_of(10),
            repeats: None,
        };
        let predicted = Some(Camera { fov_y_deg: 41.0, ..Camera::default() });
        Requests { rays: (0..count).map(ray).collect(), predicted }
    }

    fn asking(number: u32) -> Asking {
        let quality = for_any_eye(&Quality::default());
        Asking { world: WorldState::default(), camera: Camera::default(), seed: 5, quality, number }
    }

    fn rays(part: &Part) -> &Rays {
        let Ask::Rays(rays) = &part.question.ask else { panic!("rays are asked for") };
        rays
    }

    #[test]
    fn every_request_is_asked_once_by_the_camera_it_is_of() {
        let requests = requests(5000);
        let batch = asking(3).batch(&requests);
        let mut all: Vec<Request> = batch.parts.iter().flat_map(|part| part.requests.clone()).collect();
        let mut wanted = requests.rays.clone();
        let key = |request: &Request| (request.pixel, request.predicted);
        all.sort_by_key(key);
        wanted.sort_by_key(key);
        assert_eq!(all, wanted);
        for part in &batch.parts {
            let rays = rays(part);
            assert!(rays.through.len() <= RAYS_MAX && rays.lit.quality.check().is_ok() && !rays.lit.quality.importance);
            assert!(rays.lit.set < 9 && rays.view.is_none());
            for (ray, (request, origin)) in rays.through.iter().zip(part.requests.iter().zip(&part.origins)) {
                assert_eq!((ray.address, ray.aim), (origin.address, request.aim));
                assert_eq!(request.predicted, rays.camera.fov_y_deg == 41.0);
            }
        }
    }

    #[test]
    fn few_rays_share_a_light_set_and_in_the_end_every_pixel_meets_all_but_no_more_than_workers_keep() {
        let sets = |batch: &Batch| {
            let mut sets: Vec<(u16, u32)> =
                batch.parts.iter().map(|part| (rays(part).lit.set, rays(part).lit.frame)).collect();
            sets.sort_unstable();
            sets.dedup();
            sets
        };
        let few = asking(0).batch(&requests(100));
        assert_eq!(sets(&few).len(), 1);
        let many = asking(0).batch(&requests(5000));
        assert_eq!(sets(&many).len(), 9);
        let (mut all, mut of_pixel) = (Vec::new(), Vec::new());
        for number in 0..200 {
            of_pixel.push(asking(number).light_of([4, 4], 100));
            all.extend((0..9).map(|i| asking(number).light_of([i % 3, i / 3], 5000)));
        }
        for seen in [&mut all, &mut of_pixel] {
            seen.sort_unstable();
            seen.dedup();
            assert_eq!(seen.len(), LIGHT_SETS as usize - LIGHT_SETS as usize % 9, "{seen:?}");
        }
    }

    #[test]
    fn what_is_repeated_has_its_numbers_of_before() {
        let address = Address { pixel: [1, 2], number: 77 };
        let origin = Origin { address, set: 4, frame: 2, revision: 1 };
        let request = Request { pixel: [30, 40], point: None, aim: None, predicted: false, repeats: Some(origin) };
        let asking = Asking { world: WorldState { revision: 8, ..WorldState::default() }, ..asking(3) };
        let batch = asking.batch(&Requests { rays: vec![request], predicted: None });
        let part = &batch.parts[0];
        assert_eq!((rays(part).lit.set, rays(part).lit.frame, rays(part).through[0].address), (4, 2, address));
        assert_eq!(part.origins[0], Origin { revision: 8, ..origin });
    }
}
