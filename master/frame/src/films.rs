//! What each lamp brings to a picture, apart: since light adds up, any mix of the lamps is a sum of these films, by a factor
//! each, and no ray has to be traced for it.
//!
//! A film is drawn with its lamps white and all others off, so that a factor for each channel makes any colour of it.

use std::collections::BTreeMap;

use rayon::prelude::*;
use scenes::{Change, Rgb, Scene, Shiner};

use crate::Picture;

/// The films of a view.
#[derive(Debug)]
pub struct Films {
    films: Vec<Film>,
}

/// What lamps that are dimmed together bring.
#[derive(Debug)]
struct Film {
    /// Each with the power that it was drawn with, in all channels.
    lamps: Vec<(Shiner, f32)>,
    /// Mean of all frames; `None` before the first.
    picture: Option<Picture>,
    frames: u32,
    /// Of the picture, over all pixels.
    mean: f32,
}

/// Frames that a film gets at a time, at most.
const FRAMES_AT_ONCE: u32 = 64;
/// What brings next to nothing gets frames as if it brought this share of the mean of all.
const FLOOR: f32 = 0.05;

impl Films {
    /// Nothing drawn yet. `lamps` are all that shine or are to be lit later, each with a power, not 0, that it is known by. With
    /// more than `most` films, those that `group` says the same of share one; if they are still too many, the last do.
    pub fn of(lamps: &[(Shiner, Rgb)], most: usize, group: impl Fn(Shiner) -> String) -> Self {
        let lamp = |(shiner, power): &(Shiner, Rgb)| (*shiner, power.max_element());
        let mut films: Vec<Vec<(Shiner, f32)>> = lamps.iter().map(|it| vec![lamp(it)]).collect();
        if films.len() > most {
            let mut places = BTreeMap::new();
            films.clear();
            for it in lamps {
                let place = *places.entry(group(it.0)).or_insert(films.len());
                if place == films.len() {
                    films.push(Vec::new());
                }
                films[place].push(lamp(it));
            }
        }
        let rest: Vec<_> = films.drain(most.clamp(1, films.len().max(1)).min(films.len())..).flatten().collect();
        if let Some(last) = films.last_mut() {
            last.extend(rest);
        }
        let film = |lamps| Film { lamps, picture: None, frames: 0, mean: 0.0 };
        Self { films: films.into_iter().map(film).collect() }
    }

    /// How many films have a frame, and how many there are.
    pub fn drawn(&self) -> [usize; 2] {
        [self.films.iter().filter(|film| film.frames > 0).count(), self.films.len()]
    }

    /// Frames of a film.
    pub fn frames_of(&self, film: usize) -> u32 {
        self.films[film].frames
    }

    /// Frames of all films together.
    pub fn frames_in_all(&self) -> u32 {
        self.films.iter().map(|film| film.frames).sum()
    }

    /// Frames of the film that has the fewest.
    pub fn frames(&self) -> u32 {
        self.films.iter().map(|film| film.frames).min().unwrap_or(0)
    }

    /// Which film to draw next, and how many frames of it: each one once, and then the one whose noise counts most, since what a
    /// lamp brings to the mix is its noise as well. `None`: all have `limit` frames.
    pub fn next(&self, scene: &Scene, limit: u32) -> Option<(usize, u32)> {
        let mean = self.films.iter().map(|film| film.brings(scene)).sum::<f32>() / self.films.len().max(1) as f32;
        let counts = |film: &Film| match film.frames {
            0 => f32::INFINITY,
            frames => film.brings(scene).max(FLOOR * mean) / frames as f32,
        };
        let mut open: Vec<_> = self.films.iter().enumerate().filter(|(_, film)| film.frames < limit).collect();
        // Of equals the first.
        open.reverse();
        let (number, film) = open.into_iter().max_by(|(_, a), (_, b)| counts(a).total_cmp(&counts(b)))?;
        Some((number, film.frames.clamp(1, FRAMES_AT_ONCE).min(limit - film.frames)))
    }

    /// The changes to a scene by which a film's lamps alone shine, white.
    pub fn alone(&self, film: usize, scene: &Scene) -> Vec<Change> {
        let lamps = &self.films[film].lamps;
        let wanted = |shiner: Shiner| {
            let lamp = lamps.iter().find(|(lamp, _)| *lamp == shiner);
            lamp.map_or(Rgb::ZERO, |(_, power)| Rgb::splat(*power))
        };
        let all = scene.shiners().into_iter();
        let other = all.filter(|shiner| scene.power(*shiner).is_some_and(|power| power != wanted(*shiner)));
        other.filter_map(|shiner| scene.powered(shiner, wanted(shiner))).collect()
    }

    /// More frames of a film, as their mean.
    pub fn add(&mut self, film: usize, picture: Picture, frames: u32) {
        let film = &mut self.films[film];
        let share = frames as f32 / (film.frames + frames).max(1) as f32;
        film.frames += frames;
        match &mut film.picture {
            Some(mean) => {
                let both = mean.pixels.par_iter_mut().zip(&picture.pixels);
                both.for_each(|(mean, new)| *mean += (*new - *mean) * share);
            }
            None => film.picture = Some(picture),
        }
        let pixels = film.picture.iter().flat_map(|picture| &picture.pixels);
        let sum: f64 = pixels.map(|pixel| f64::from(pixel.element_sum()) / 3.0).sum();
        film.mean = (sum / film.picture.as_ref().map_or(1, |picture| picture.pixels.len().max(1)) as f64) as f32;
    }

    /// What each film brings to the picture of a scene, as its lamps are, with one of the lamps; `None` as [`Self::mixed`].
    pub fn shares(&self, scene: &Scene) -> Option<Vec<(Shiner, Picture)>> {
        if !self.cover(scene) {
            return None;
        }
        let share = |film: &Film| {
            let (picture, factor) = (film.picture.as_ref()?, film.factor(scene)?);
            let pixels = picture.pixels.par_iter().map(|pixel| *pixel * factor).collect();
            Some((film.lamps.first()?.0, Picture { pixels, ..*picture }))
        };
        self.films.iter().map(share).collect()
    }

    /// All that shines in a scene has a film.
    pub fn cover(&self, scene: &Scene) -> bool {
        let has_film =
            |shiner: Shiner| self.films.iter().any(|film| film.lamps.iter().any(|(lamp, _)| *lamp == shiner));
        let mut shining = scene.shiners().into_iter().filter(|it| scene.power(*it).is_some_and(|it| it != Rgb::ZERO));
        shining.all(has_film)
    }

    /// The picture of a scene, as its lamps are; `None` if a film has no frame, or its lamps are not dimmed alike, or something
    /// shines that has no film.
    pub fn mixed(&self, scene: &Scene) -> Option<Picture> {
        if !self.cover(scene) {
            return None;
        }
        let parts = self.films.iter().map(|film| Some((film.picture.as_ref()?, film.factor(scene)?)));
        let parts: Vec<(&Picture, Rgb)> = parts.collect::<Option<_>>()?;
        let (first, _) = parts.first()?;
        let mut sum = Picture::black(first.width, first.height);
        sum.pixels.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, sum)| {
            for (picture, factor) in parts.iter().filter(|(_, factor)| *factor != Rgb::ZERO) {
                let pixels = &picture.pixels[chunk * CHUNK..][..sum.len()];
                sum.iter_mut().zip(pixels).for_each(|(sum, pixel)| *sum += *pixel * *factor);
            }
        });
        Some(sum)
    }
}

/// Pixels that are summed at a time: they stay in the nearest cache.
const CHUNK: usize = 1 << 10;

impl Film {
    /// By what it is multiplied for a scene's lamps; `None` if they are not dimmed alike.
    fn factor(&self, scene: &Scene) -> Option<Rgb> {
        let mut factors = self.lamps.iter().map(|(lamp, power)| Some(scene.power(*lamp)? / *power));
        let first = factors.next()??;
        let is_alike = |factor: Option<Rgb>| factor.is_some_and(|it| it.abs_diff_eq(first, SAME * first.max_element()));
        factors.all(is_alike).then_some(first)
    }

    /// What it brings to a scene's picture, about.
    fn brings(&self, scene: &Scene) -> f32 {
        self.factor(scene).map_or(1.0, Rgb::max_element) * self.mean
    }
}

/// Factors that differ by so little, as a share, differ by rounding.
const SAME: f32 = 1e-5;

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use scenes::{Environment, Light};

    use super::*;

    fn scene(powers: &[Vec3]) -> Scene {
        let light = |intensity: &Vec3| Light::Point { position: Vec3::ZERO, intensity: *intensity };
        let environment = Environment::Constant(Vec3::splat(0.5));
        Scene { lights: powers.iter().map(light).collect(), environment, ..Scene::default() }
    }

    fn lamps(scene: &Scene) -> Vec<(Shiner, Rgb)> {
        scene.shiners().into_iter().map(|shiner| (shiner, scene.power(shiner).unwrap())).collect()
    }

    /// Draws a film: its lamps, each by a number of its own, so that it is told who shone.
    fn drawn(films: &Films, film: usize, scene: &Scene) -> Picture {
        let mut alone = scene.clone();
        films.alone(film, scene).iter().for_each(|change| change.apply(&mut alone).unwrap());
        picture(&alone)
    }

    fn picture(scene: &Scene) -> Picture {
        let all = scene.shiners().into_iter().zip([1.0, 10.0, 100.0, 1000.0]);
        let light = all.map(|(shiner, place)| scene.power(shiner).unwrap() * place).sum::<Vec3>();
        Picture::from_fn(40, 30, |x, y| light * (1 + x + y) as f32)
    }

    fn all_drawn(scene: &Scene, most: usize) -> Films {
        let mut films = Films::of(&lamps(scene), most, |shiner| format!("{}", shiner == Shiner::Sky));
        while films.frames() == 0 {
            let (film, frames) = films.next(scene, 4).unwrap();
            assert_eq!(frames, 1, "each once at first");
            films.add(film, drawn(&films, film, scene), frames);
        }
        films
    }

    #[test]
    fn any_mix_is_the_picture_that_would_be_drawn() {
        let before = scene(&[Vec3::new(4.0, 2.0, 1.0), Vec3::ONE]);
        let films = all_drawn(&before, 9);
        assert_eq!(films.drawn(), [3, 3]);
        let close = |scene: &Scene| {
            let (mixed, drawn) = (films.mixed(scene).unwrap(), picture(scene));
            mixed.pixels.iter().zip(&drawn.pixels).all(|(a, b)| a.abs_diff_eq(*b, 1e-5 * b.max_element()))
        };
        assert!(close(&before));
        let shares = films.shares(&before).unwrap();
        assert_eq!(shares.iter().map(|(lamp, _)| *lamp).collect::<Vec<_>>(), before.shiners());
        let sum: Vec3 = shares.iter().map(|(_, share)| share.at(7, 3)).sum();
        assert!(sum.abs_diff_eq(picture(&before).at(7, 3), 1e-3), "{sum}");
        // Dimmed, of another colour, off.
        let mut after = scene(&[Vec3::new(0.0, 0.1, 3.0), Vec3::ZERO]);
        assert!(close(&after));
        after.environment = Environment::Constant(Vec3::ZERO);
        assert!(close(&after));
        after.lights.push(before.lights[0].clone());
        assert_eq!(films.mixed(&after), None, "a lamp without film");
        assert!(films.shares(&after).is_none());
    }

    #[test]
    fn lamps_that_share_a_film_are_dimmed_alike_or_not_mixed() {
        let films = all_drawn(&scene(&[Vec3::ONE, Vec3::splat(2.0)]), 2);
        assert_eq!(films.drawn(), [2, 2]);
        assert!(films.mixed(&scene(&[Vec3::X, Vec3::X * 2.0])).is_some());
        assert_eq!(films.mixed(&scene(&[Vec3::ONE, Vec3::ONE])), None);
        assert_eq!(all_drawn(&scene(&[Vec3::ONE; 3]), 1).drawn(), [1, 1]);
        assert_eq!(Films::of(&[], 5, |_| String::new()).next(&Scene::default(), 9), None);
    }

    #[test]
    fn frames_go_to_what_brings_most_and_in_the_end_to_all() {
        let bright = scene(&[Vec3::splat(100.0), Vec3::splat(0.01)]);
        let mut films = all_drawn(&bright, 9);
        let mut order = Vec::new();
        while let Some((film, frames)) = films.next(&bright, 8) {
            order.push(film);
            films.add(film, drawn(&films, film, &bright), frames);
        }
        assert_eq!(films.frames(), 8);
        assert!(order.starts_with(&[0]), "{order:?}");
    }
}
