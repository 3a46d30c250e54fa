//! What is drawn over the picture: the selection's box, arrows to drag it by, a ring to turn it by, and the lamps.

use eframe::egui::{Color32, Painter, Pos2, Rect, Stroke, StrokeKind, Vec2, vec2};
use glam::{Mat3, Vec3};
use scenes::{Camera, Change, Light, Transform};

use super::scene::SceneCopy;
use crate::display::message::ObjectInfo;

/// What is selected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Selection {
    /// An object, and which of its materials.
    Object { index: usize, material: Option<u32> },
    /// A piece of an object, and which of its materials.
    Piece { object: u32, piece: u32, material: Option<u32> },
    /// A lamp without surface.
    Light { index: usize },
}

/// Where the picture lies on the screen, and from where it was drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stage {
    pub camera: Camera,
    pub rect: Rect,
}

/// What can be grabbed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Grip {
    /// An arrow along an axis of the scene.
    Axis(usize),
    /// The ring.
    Turn,
    /// The square.
    Size,
    /// The middle.
    Free,
}

/// A grip in the hand.
pub(super) struct Grab {
    grip: Grip,
    selection: Selection,
    before: Before,
    stage: Stage,
    start: Pos2,
    pivot: Vec3,
    centre: Pos2,
    /// Length in the scene of a point of the screen, at the pivot.
    point: f32,
}

impl Selection {
    /// Whether it is the same, whichever material.
    pub fn is_same(self, other: Self) -> bool {
        self.of_material(None) == other.of_material(None)
    }

    /// The same with another material.
    pub fn of_material(self, material: Option<u32>) -> Self {
        match self {
            Self::Object { index, .. } => Self::Object { index, material },
            Self::Piece { object, piece, .. } => Self::Piece { object, piece, material },
            Self::Light { .. } => self,
        }
    }

    /// What is selected, if it is no lamp.
    pub fn object(self, scene: &SceneCopy) -> Option<ObjectInfo> {
        match self {
            Self::Object { index, .. } => scene.info.objects.get(index).cloned(),
            Self::Piece { object, piece, .. } => scene.piece_as_object(object, piece),
            Self::Light { .. } => None,
        }
    }

    /// The change that puts it there.
    fn put(self, scene: &SceneCopy, place: Transform) -> Option<Change> {
        match self {
            Self::Object { index, .. } => Some(Change::Transform { object: index as u32, scene_from_object: place }),
            Self::Piece { object, piece, .. } => {
                let whole_from_piece = scene.info.objects.get(object as usize)?.place.inverse().after(&place);
                Some(Change::PieceTransform { object, piece, whole_from_piece })
            }
            Self::Light { .. } => None,
        }
    }
}

enum Before {
    Place(Transform),
    Light(Light),
}

const AXES: [(Vec3, Color32); 3] = [
    (Vec3::X, Color32::from_rgb(255, 107, 107)),
    (Vec3::Y, Color32::from_rgb(123, 216, 143)),
    (Vec3::Z, Color32::from_rgb(108, 182, 255)),
];
const AMBER: Color32 = Color32::from_rgb(255, 180, 84);
/// Pairs of corners of a box: bit a of a corner is its side along axis a.
const EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];
/// Points of the screen.
const ARM: f32 = 78.0;
const RING: f32 = 0.62 * ARM;
const SQUARE: Vec2 = vec2(0.44 * ARM, 0.44 * ARM);
const REACH: f32 = 10.0;

impl Stage {
    /// Where a point of the scene is on the screen, and its depth; `None` behind the eye.
    pub fn screen(&self, point: Vec3) -> Option<(Pos2, f32)> {
        let (x, y, _) = self.camera.lens().project(point)?;
        let depth = (point - self.camera.origin).dot(self.forward());
        let share = vec2(x / self.camera.width as f32, y / self.camera.height as f32);
        (depth > 1e-6).then(|| (self.rect.min + share * self.rect.size(), depth))
    }

    /// The place in the picture, 0..=1, of a point of the screen.
    pub fn share(&self, at: Pos2) -> Vec2 {
        (at - self.rect.min) / self.rect.size()
    }

    /// Length in the scene of a point of the screen, at a depth.
    fn point(&self, depth: f32) -> f32 {
        let lens = self.camera.lens();
        lens.pixel() * self.camera.height as f32 / self.rect.height() * depth
    }

    fn forward(&self) -> Vec3 {
        (self.camera.target - self.camera.origin).normalize_or(Vec3::NEG_Z)
    }

    fn right(&self) -> Vec3 {
        self.forward().cross(self.camera.up).normalize_or(Vec3::X)
    }
}

/// The selection's grip under a point of the screen.
pub(super) fn grip_at(stage: &Stage, scene: &SceneCopy, selection: Option<Selection>, at: Pos2) -> Option<Grip> {
    let centre = selection.and_then(|selection| pivot(scene, selection)).and_then(|pivot| {
        let (centre, depth) = stage.screen(pivot)?;
        Some((pivot, centre, stage.point(depth)))
    });
    if let (Some(selection), Some((pivot, centre, point))) = (selection, centre) {
        let is_object = !matches!(selection, Selection::Light { .. });
        if centre.distance(at) <= REACH {
            return Some(Grip::Free);
        }
        if is_object && (centre + SQUARE).distance(at) <= REACH {
            return Some(Grip::Size);
        }
        let near = |axis: &usize| {
            let tip = stage.screen(pivot + AXES[*axis].0 * (ARM * point));
            tip.is_some_and(|(tip, _)| distance_to_segment(at, centre, tip) <= 0.8 * REACH)
        };
        if let Some(axis) = (0..3).find(near) {
            return Some(Grip::Axis(axis));
        }
        if is_object && (centre.distance(at) - RING).abs() <= 0.7 * REACH {
            return Some(Grip::Turn);
        }
    }
    None
}

/// The lamp whose marker is at a point of the screen, the nearest of several. A click selects it; drags are the
/// picture's, as everywhere beside it.
pub(super) fn lamp_at(stage: &Stage, scene: &SceneCopy, at: Pos2) -> Option<usize> {
    let away = |light: &Light| Some(position(light).and_then(|place| stage.screen(place))?.0.distance(at));
    let lamps = scene.info.lights.iter().enumerate().filter_map(|(index, light)| Some((index, away(light)?)));
    let near = lamps.filter(|(_, away)| *away <= REACH);
    near.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(index, _)| index)
}

/// Takes hold of the selection.
pub(super) fn grab(stage: Stage, scene: &SceneCopy, selection: Selection, grip: Grip, start: Pos2) -> Option<Grab> {
    let pivot = pivot(scene, selection)?;
    let (centre, depth) = stage.screen(pivot)?;
    let before = match selection {
        Selection::Object { .. } | Selection::Piece { .. } => Before::Place(selection.object(scene)?.place),
        Selection::Light { index } => Before::Light(scene.info.lights.get(index)?.clone()),
    };
    Some(Grab { grip, selection, before, stage, start, pivot, centre, point: stage.point(depth) })
}

impl Grab {
    /// What dragging it to a point of the screen does.
    pub fn drag_to(&self, scene: &SceneCopy, at: Pos2) -> Option<Change> {
        let drag = at - self.start;
        let (from, to) = (self.start - self.centre, at - self.centre);
        let up = self.stage.camera.up.normalize_or(Vec3::Y);
        let by = match self.grip {
            Grip::Turn => {
                // Seen from above, the picture's way round is the upright's; seen from below, the other.
                let sign = if up.dot(self.stage.forward()) > 0.0 { 1.0 } else { -1.0 };
                return self.around(scene, Mat3::from_axis_angle(up, sign * (to.angle() - from.angle())));
            }
            Grip::Size => {
                let factor = (to.length() / from.length().max(1.0)).max(0.05);
                return self.around(scene, Mat3::from_diagonal(Vec3::splat(factor)));
            }
            Grip::Axis(axis) => {
                let arm = AXES[axis].0 * (ARM * self.point);
                let (tip, _) = self.stage.screen(self.pivot + arm)?;
                let along = tip - self.centre;
                arm * (drag.dot(along) / along.length_sq().max(25.0))
            }
            Grip::Free => {
                let (right, forward) = (self.stage.right(), self.stage.forward());
                (right * drag.x + forward.cross(right) * drag.y) * self.point
            }
        };
        self.shifted(scene, by)
    }

    /// What is held, shifted in the scene.
    fn shifted(&self, scene: &SceneCopy, by: Vec3) -> Option<Change> {
        match (&self.before, self.selection) {
            (Before::Place(place), selection) => {
                selection.put(scene, Transform { translation: place.translation + by, ..*place })
            }
            (Before::Light(light), Selection::Light { index }) => {
                let mut value = light.clone();
                match &mut value {
                    Light::Point { position, .. }
                    | Light::Spot { position, .. }
                    | Light::Luminaire { position, .. } => {
                        *position += by;
                    }
                    Light::Directional { .. } => return None,
                }
                Some(Change::Light { light: index as u32, value })
            }
            _ => None,
        }
    }

    /// The object after a linear map about its pivot.
    fn around(&self, scene: &SceneCopy, map: Mat3) -> Option<Change> {
        let Before::Place(place) = &self.before else { return None };
        let translation = self.pivot + map * (place.translation - self.pivot);
        self.selection.put(scene, Transform { linear: map * place.linear, translation })
    }
}

/// A step of the selection.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    /// To the right, up and away in the picture; 1 is an eighth of an arm.
    Shift(Vec3),
    /// About the upright, radians.
    Turn(f32),
    /// By a factor.
    Size(f32),
}

/// What a step does to the selection.
pub(super) fn step(stage: Stage, scene: &SceneCopy, selection: Selection, step: Step) -> Option<Change> {
    let held = grab(stage, scene, selection, Grip::Free, Pos2::ZERO)?;
    match step {
        Step::Shift(way) => {
            let (right, forward) = (stage.right(), stage.forward());
            let by = right * way.x - forward.cross(right) * way.y + forward * way.z;
            held.shifted(scene, by * (ARM / 8.0 * held.point))
        }
        Step::Turn(angle) => held.around(scene, Mat3::from_axis_angle(stage.camera.up.normalize_or(Vec3::Y), angle)),
        Step::Size(factor) => held.around(scene, Mat3::from_diagonal(Vec3::splat(factor))),
    }
}

/// Draws lamps and, if it may be moved, the selection's grips.
pub(super) fn draw(painter: &Painter, stage: &Stage, scene: &SceneCopy, selection: Option<Selection>, may_move: bool) {
    for (index, light) in scene.info.lights.iter().enumerate() {
        let Some((at, _)) = position(light).and_then(|at| stage.screen(at)) else { continue };
        let chosen = selection == Some(Selection::Light { index });
        let colour = if chosen { Color32::WHITE } else { AMBER };
        painter.circle(at, 8.0, colour.gamma_multiply(0.35), Stroke::new(2.0, colour));
    }
    let Some(selection) = selection else { return };
    if let Some(corners) = selection.object(scene).and_then(|object| object.corners()) {
        let seen = corners.map(|corner| stage.screen(corner));
        for [a, b] in EDGES {
            if let (Some((a, _)), Some((b, _))) = (seen[a], seen[b]) {
                painter.line_segment([a, b], Stroke::new(1.2, AMBER));
            }
        }
    }
    let Some(pivot) = pivot(scene, selection).filter(|_| may_move) else { return };
    let Some((centre, depth)) = stage.screen(pivot) else { return };
    if !matches!(selection, Selection::Light { .. }) {
        painter.circle_stroke(centre, RING, Stroke::new(2.5, AMBER.gamma_multiply(0.8)));
        painter.rect_filled(Rect::from_center_size(centre + SQUARE, vec2(12.0, 12.0)), 2.0, AMBER);
    }
    for (axis, colour) in AXES {
        let Some((tip, _)) = stage.screen(pivot + axis * (ARM * stage.point(depth))) else { continue };
        painter.line_segment([centre, tip], Stroke::new(3.0, colour));
        painter.circle_filled(tip, 6.0, colour);
    }
    let middle = Rect::from_center_size(centre, vec2(14.0, 14.0));
    painter.rect(middle, 7.0, Color32::from_white_alpha(215), Stroke::new(1.0, Color32::DARK_GRAY), StrokeKind::Inside);
}

/// A ball around the selection: centre and radius.
pub(super) fn ball(scene: &SceneCopy, selection: Selection, otherwise: f32) -> Option<(Vec3, f32)> {
    match selection {
        Selection::Object { .. } | Selection::Piece { .. } => {
            let corners = selection.object(scene)?.corners()?;
            Some(((corners[0] + corners[7]) / 2.0, (corners[0].distance(corners[7]) / 2.0).max(1e-4)))
        }
        Selection::Light { index } => position(scene.info.lights.get(index)?).map(|at| (at, otherwise)),
    }
}

/// The point that the selection is moved by.
fn pivot(scene: &SceneCopy, selection: Selection) -> Option<Vec3> {
    ball(scene, selection, 0.0).map(|(centre, _)| centre)
}

/// Where a lamp is; the sun is nowhere.
fn position(light: &Light) -> Option<Vec3> {
    match light {
        Light::Point { position, .. } | Light::Spot { position, .. } | Light::Luminaire { position, .. } => {
            Some(*position)
        }
        Light::Directional { .. } => None,
    }
}

fn distance_to_segment(at: Pos2, a: Pos2, b: Pos2) -> f32 {
    let along = b - a;
    let share = ((at - a).dot(along) / along.length_sq().max(1e-6)).clamp(0.0, 1.0);
    at.distance(a + along * share)
}

#[cfg(test)]
mod tests {
    use eframe::egui::pos2;

    use super::*;
    use crate::display::message::SceneInfo;

    fn stage() -> Stage {
        Stage { camera: Camera::default(), rect: Rect::from_min_size(pos2(10.0, 20.0), vec2(1280.0, 960.0)) }
    }

    fn scene() -> SceneCopy {
        let place = Transform { linear: Mat3::IDENTITY, translation: Vec3::new(0.3, 0.0, 0.0) };
        let bounds = Some([Vec3::splat(-0.1), Vec3::splat(0.1)]);
        let object =
            ObjectInfo { name: "t".into(), place, visible: true, moves: false, bounds, materials: vec![], own: vec![] };
        let light = Light::Point { position: Vec3::new(-0.5, 0.5, 0.0), intensity: Vec3::ONE };
        let info = SceneInfo { objects: vec![object], lights: vec![light], ..SceneInfo::default() };
        SceneCopy { info, ..SceneCopy::default() }
    }

    const OBJECT: Selection = Selection::Object { index: 0, material: None };

    fn dragged(grip: Grip, start: Pos2, by: Vec2) -> Change {
        grab(stage(), &scene(), OBJECT, grip, start).unwrap().drag_to(&scene(), start + by).unwrap()
    }

    fn place(change: Change) -> Transform {
        let Change::Transform { object: 0, scene_from_object } = change else { panic!("{change:?}") };
        scene_from_object
    }

    #[test]
    fn what_is_dragged_stays_under_the_pointer() {
        let (centre, _) = stage().screen(Vec3::new(0.3, 0.0, 0.0)).unwrap();
        let moved = place(dragged(Grip::Free, centre, vec2(40.0, 30.0)));
        let (now, _) = stage().screen(moved.translation).unwrap();
        assert!(now.distance(centre + vec2(40.0, 30.0)) < 0.1, "{now:?}");
        // Along an axis, only along it.
        let moved = place(dragged(Grip::Axis(0), centre, vec2(40.0, 30.0)));
        assert!(moved.translation.y == 0.0 && moved.translation.z == 0.0 && moved.translation.x > 0.31, "{moved:?}");
    }

    #[test]
    fn ring_and_square_turn_and_size_about_the_middle() {
        let (centre, _) = stage().screen(Vec3::new(0.3, 0.0, 0.0)).unwrap();
        let turned = place(dragged(Grip::Turn, centre + vec2(RING, 0.0), vec2(-RING, RING)));
        assert!(
            (turned.linear * Vec3::X).abs_diff_eq(Vec3::Z, 1e-3)
                || (turned.linear * Vec3::X).abs_diff_eq(-Vec3::Z, 1e-3)
        );
        assert!(turned.translation.abs_diff_eq(Vec3::new(0.3, 0.0, 0.0), 1e-5));
        let grown = place(dragged(Grip::Size, centre + SQUARE, SQUARE));
        assert!((grown.linear.x_axis.x - 2.0).abs() < 1e-3, "{grown:?}");
    }

    #[test]
    fn steps_go_where_they_say() {
        let stepped = |way: Step| place(step(stage(), &scene(), OBJECT, way).unwrap());
        let (before, _) = stage().screen(Vec3::new(0.3, 0.0, 0.0)).unwrap();
        let (up, _) = stage().screen(stepped(Step::Shift(Vec3::Y)).translation).unwrap();
        assert!(up.distance(before - vec2(0.0, ARM / 8.0)) < 0.1, "{before:?} {up:?}");
        let (_, depth) = stage().screen(stepped(Step::Shift(Vec3::Z)).translation).unwrap();
        assert!(depth > 3.0, "{depth}");
        assert!((stepped(Step::Size(1.05)).linear.y_axis.y - 1.05).abs() < 1e-4);
        assert!(stepped(Step::Turn(0.1)).linear.x_axis.abs_diff_eq(Vec3::new(0.1f32.cos(), 0.0, -0.1f32.sin()), 1e-4));
        let lamp = Selection::Light { index: 0 };
        assert!(step(stage(), &scene(), lamp, Step::Shift(Vec3::X)).is_some());
        assert!(step(stage(), &scene(), lamp, Step::Turn(0.1)).is_none());
    }

    #[test]
    fn grips_are_found_where_they_are_drawn() {
        let (scene, stage) = (scene(), stage());
        let (centre, _) = stage.screen(Vec3::new(0.3, 0.0, 0.0)).unwrap();
        let (lamp, _) = stage.screen(Vec3::new(-0.5, 0.5, 0.0)).unwrap();
        let at = |at| grip_at(&stage, &scene, Some(OBJECT), at);
        assert_eq!(at(centre), Some(Grip::Free));
        assert_eq!(at(centre + SQUARE), Some(Grip::Size));
        assert_eq!(at(centre + vec2(ARM * 0.8, 0.0)), Some(Grip::Axis(0)));
        assert_eq!(at(centre + vec2(-RING, 0.0)), Some(Grip::Turn));
        assert_eq!((at(lamp), lamp_at(&stage, &scene, lamp)), (None, Some(0)), "a drag from there is the picture's");
        assert_eq!(lamp_at(&stage, &scene, centre), None);
        assert_eq!(at(pos2(12.0, 22.0)), None);
        assert_eq!(grip_at(&stage, &scene, None, centre), None);
    }
}
