//! Tests of `message`.

use glam::Vec3;
use proptest::prelude::*;
use scenes::{Camera, SurfacePoint};

use super::*;
use crate::question::{Address, Ask, Bound, Frames, Lit, Part, Point, Points, Quality, Ray, Rays, Rect, Samples, Tile};

fn question(rect: Rect, frame: u32, seed: u64) -> Question {
    let tile = Tile { camera: Camera::default(), rect, lit: Lit { set: 3, frame, seed, quality: Quality::default() } };
    Question { world: WorldState { world: [5; 32], revision: 2 }, ask: Ask::Tile(tile) }
}

fn whole() -> Question {
    question(Rect { x: 0, y: 0, width: 640, height: 480 }, 0, 0)
}

fn with(edit: impl FnOnce(&mut Tile)) -> Question {
    let mut question = whole();
    let Ask::Tile(tile) = &mut question.ask else { panic!("these tests ask about tiles") };
    edit(tile);
    question
}

fn samples(edit: impl FnOnce(&mut Samples)) -> Question {
    let rect = Rect { x: 8, y: 0, width: 32, height: 32 };
    let mut samples = Samples { camera: Camera::default(), rect, first: 64, count: 16, seed: 1, max_bounces: Some(3) };
    edit(&mut samples);
    Question { world: WorldState { world: [5; 32], revision: 2 }, ask: Ask::Reference(samples) }
}

fn there_and_back<T: Control + PartialEq + std::fmt::Debug>(message: T) {
    let bytes = encode(&message).unwrap();
    let (head, body) = bytes.split_first_chunk().unwrap();
    let header = Header::parse(*head).unwrap();
    assert_eq!(header, Header { kind: T::KIND, length: body.len() as u32 });
    assert_eq!(decode::<T>(header.kind, body), Ok(message));
    for end in 0..body.len() {
        assert!(decode::<T>(header.kind, &body[..end]).is_err(), "a message cut at {end} was taken");
    }
    assert!(decode::<T>(header.kind, &[body, &[0]].concat()).is_err(), "a longer message was taken");
}

#[test]
fn messages_survive_the_wire() {
    let state = WorldState { world: [7; 32], revision: 300 };
    let whole_from_piece = scenes::Transform { translation: Vec3::X, ..scenes::Transform::IDENTITY };
    let changes = vec![
        Change::Time(0.25),
        Change::Visible { object: 3, visible: false },
        Change::Camera(Camera::default()),
        Change::PieceTransform { object: 3, piece: 300, whole_from_piece },
        Change::PieceVisible { object: 3, piece: 7, visible: false },
    ];
    there_and_back(Hello { proof: [1; 32], threads: 8, name: "büro-7".into(), bits: [5; 8] });
    there_and_back(Welcome { proof: [2; 32] });
    there_and_back(Refusal { reason: "wrong token".into() });
    there_and_back(ToWorker::World { state, changes: changes.clone() });
    there_and_back(ToWorker::Changes { from: state, revision: 301, changes });
    there_and_back(ToWorker::Ask { id: QuestionId(9), question: whole().into() });
    there_and_back(ToWorker::Ask { id: QuestionId(9), question: samples(|_| {}).into() });
    let Ask::Tile(tile) = whole().ask else { panic!("a tile") };
    let frames = Question { ask: Ask::Frames(Frames { tile, count: 9 }), ..whole() };
    there_and_back(ToWorker::Ask { id: QuestionId(9), question: frames.into() });
    there_and_back(ToWorker::Cancel { ids: vec![QuestionId(1), QuestionId(u64::MAX)] });
    there_and_back(ToWorker::Goodbye { reason: "done".into() });
    there_and_back(ToMaster::Want { hashes: vec![[3; 32]; 5] });
    there_and_back(ToMaster::Progress { have: 2, of: 5 });
    there_and_back(ToMaster::Ready { state });
    there_and_back(ToMaster::Missing { id: QuestionId(4) });
    there_and_back(ToMaster::Failed { id: QuestionId(4), reason: "panicked".into() });
    there_and_back(ToMaster::Refused { id: QuestionId(4), reason: "no such point".into() });
    there_and_back(ToMaster::Relaying(Behind { workers: 300, threads: RELAYED_MAX, depth: DEPTH_MAX }));
    there_and_back(ToMaster::Retracted { reason: "worker 3 computes wrongly".into() });
    there_and_back(ToMaster::Leaving { started: vec![QuestionId(4)] });
    there_and_back(ToMaster::Goodbye { reason: "stopped".into() });
}

#[test]
fn strangers_are_told_apart() {
    let good = Header { kind: Kind::Hello, length: 3 }.bytes();
    let edited = |at: usize, byte: u8| {
        let mut bytes = good;
        bytes[at] = byte;
        Header::parse(bytes)
    };
    assert_eq!(Header::parse(*b"GET / HTTP/1"), Err(WireError::Magic));
    let theirs = VERSION + 1;
    assert_eq!(edited(4, theirs as u8), Err(WireError::Version { theirs }));
    assert_eq!(edited(3, 77), Err(WireError::Kind(77)));
    assert_eq!(edited(10, 1), Err(WireError::TooLong { length: 0x1_0003, limit: STRANGER_MAX }));
}

#[test]
fn what_is_too_long_is_not_sent_either() {
    let changes = vec![Change::Time(0.0); CONTROL_MAX / 9 + 1];
    let message = ToWorker::World { state: WorldState::default(), changes };
    assert!(matches!(encode(&message), Err(WireError::TooLong { .. })));
}

#[test]
fn questions_out_of_range_are_refused() {
    assert_eq!(check_question(&whole()), Ok(()));
    let refused = |edit: &dyn Fn(&mut Tile)| check_question(&with(edit)).is_err();
    assert!(refused(&|tile| tile.camera.fov_y_deg = f32::NAN));
    assert!(refused(&|tile| tile.camera.up = Vec3::ZERO));
    assert!(refused(&|tile| tile.camera.width = 0));
    assert!(refused(&|tile| tile.camera.height = PICTURE_SIDE_MAX + 1));
    assert!(refused(&|tile| tile.rect.width = 0));
    assert!(refused(&|tile| tile.rect.width = 641));
    assert!(refused(&|tile| tile.rect.x = u32::MAX));
    assert!(refused(&|tile| tile.lit.set = 9));
    assert!(refused(&|tile| tile.lit.quality.interleave = [0, 3]));
    assert!(refused(&|tile| tile.lit.quality.interleave = [17, 3]));
    assert!(refused(&|tile| tile.lit.quality.replicates = 0));
    assert!(refused(&|tile| tile.lit.quality.photons = u32::MAX));
    assert!(refused(&|tile| tile.lit.quality.photon_radius = 0.0));
    assert!(refused(&|tile| tile.lit.quality.bound = Bound::Geometry { distance: f32::INFINITY }));
    assert!(refused(&|tile| {
        (tile.camera.width, tile.camera.height) = (16384, 16384);
        (tile.rect.width, tile.rect.height) = (16384, 16384);
    }));
}

#[test]
fn questions_about_several_frames_out_of_range_are_refused() {
    let frames = |count, edit: &dyn Fn(&mut Tile)| {
        let Question { world, ask: Ask::Tile(tile) } = with(edit) else { panic!("a tile") };
        check_question(&Question { world, ask: Ask::Frames(Frames { tile, count }) })
    };
    assert_eq!(frames(16, &|_| {}), Ok(()));
    assert!(frames(0, &|_| {}).is_err());
    assert!(frames(17, &|_| {}).is_err());
    assert!(frames(9, &|tile| tile.lit.frame = u32::MAX - 8).is_err());
    assert!(frames(9, &|tile| tile.lit.set = 9).is_err());
}

#[test]
fn reference_questions_out_of_range_are_refused() {
    let lights = |edit: &dyn Fn(&mut Tile)| {
        let Question { world, ask: Ask::Tile(tile) } = with(edit) else { panic!("a tile") };
        Question { world, ask: Ask::Lights(tile.lights()) }
    };
    assert_eq!(check_question(&lights(&|_| {})), Ok(()));
    assert!(check_question(&lights(&|tile| tile.lit.set = 9)).is_err());
    assert!(check_question(&lights(&|tile| tile.lit.quality.interleave = [0, 3])).is_err());
    assert!(check_question(&lights(&|tile| tile.camera.width = 0)).is_err());
    assert_eq!(check_question(&samples(|_| {})), Ok(()));
    let refused = |edit: &dyn Fn(&mut Samples)| check_question(&samples(edit)).is_err();
    assert!(refused(&|samples| samples.camera.height = PICTURE_SIDE_MAX + 1));
    assert!(refused(&|samples| samples.rect.height = 0));
    assert!(refused(&|samples| samples.rect.x = 640 - 31));
    assert!(refused(&|samples| samples.count = 0));
    assert!(refused(&|samples| samples.first = u32::MAX - 15));
    assert!(refused(&|samples| samples.count = 1 << 20));
    assert!(refused(&|samples| {
        (samples.camera.width, samples.camera.height) = (2048, 2048);
        (samples.rect, samples.count) = (Rect { x: 0, y: 0, width: 2048, height: 2048 }, 1);
    }));
}

/// The wire form may only change together with [`VERSION`].
#[test]
fn the_bytes_are_golden() {
    let digest = |question| {
        let bytes = encode(&ToWorker::Ask { id: QuestionId(1000), question: Arc::new(question) }).unwrap();
        (bytes.len(), crate::parts::short(&crate::parts::hash(&bytes)))
    };
    let tile = question(Rect { x: 64, y: 300, width: 32, height: 32 }, 70000, 1 << 40);
    assert_eq!(VERSION, 18);
    let lit = Lit { set: 3, frame: 7, seed: 9, quality: Quality::default() };
    let at = SurfacePoint { object: 2, triangle: 70000, uv: [0.25, 0.5], back: true, turned: false };
    let address = Address { pixel: [300, 4], number: 7 };
    let ray = |aim| Ray { address, aim };
    let (camera, through) = (Camera::default(), vec![ray(None), ray(Some(at))]);
    let about = |ask| Question { ask, ..whole() };
    let rays = Ask::Rays(Rays { camera, view: Some(camera), through, lit });
    let (at, part) = (vec![Point { at, address }], Part::DirectOf(vec![1, 5]));
    let points = Ask::Points(Points { view: None, at, part, lit });
    let digests = [digest(tile), digest(samples(|_| {})), digest(about(rays)), digest(about(points))];
    let known = [(144, "b31e71667c3d"), (107, "f34e2827290a"), (204, "db2e4a97c5c6"), (105, "a2ef58b4ed09")];
    assert_eq!(digests, known.map(|(length, hash)| (length, hash.to_owned())));
}

proptest! {
    #[test]
    fn answers_survive_the_wire(id: u64, counters in prop::array::uniform6(0_u64..1 << 40), squeezed: Vec<u8>) {
        let [eye_rays, shadow_rays, light_rays, compensation_rays, photon_queries, dropped] = counters;
        let cost = Cost { eye_rays, shadow_rays, light_rays, compensation_rays, photon_queries, dropped, micros: counters };
        let sent = Answered { id: QuestionId(id), cost, squeezed };
        let bytes = sent.encode();
        let (head, body) = bytes.split_first_chunk().unwrap();
        let header = Header::parse(*head).unwrap();
        prop_assert_eq!(header.length as usize, body.len());
        prop_assert_eq!(Answered::decode(header.kind, body), Ok(sent));
    }

    #[test]
    fn random_bytes_never_panic(head: [u8; HEADER_LEN], body: Vec<u8>) {
        let _ = Header::parse(head);
        let _ = decode::<Hello>(Kind::Hello, &body);
        let _ = decode::<ToWorker>(Kind::ToWorker, &body);
        let _ = decode::<ToMaster>(Kind::ToMaster, &body);
        let _ = Answered::decode(Kind::Answer, &body);
    }

    #[test]
    fn damaged_questions_are_refused_or_in_range(at in 0..400_usize, flip in 1_u8..) {
        let question = if flip % 2 == 0 { whole() } else { samples(|_| {}) };
        let mut bytes = encode(&ToWorker::Ask { id: QuestionId(1), question: question.into() }).unwrap();
        let body = &mut bytes[HEADER_LEN..];
        let at = at % body.len();
        body[at] ^= flip;
        if let Ok(ToWorker::Ask { question, .. }) = decode(Kind::ToWorker, body) {
            prop_assert_eq!(check_question(&question), Ok(()));
        }
    }

    #[test]
    fn cutting_text_keeps_it_text(text: String, limit in 0..100_usize) {
        let short = cut(&text, limit);
        prop_assert!(short.len() <= limit && text.starts_with(&short));
    }
}
