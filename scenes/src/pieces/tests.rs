//! Tests of `pieces`.

use std::path::Path;

use proptest::prelude::*;

use super::*;

/// Boxes, each with corners of its own, as twelve triangles.
fn boxes(boxes: &[[Vec3; 2]]) -> Mesh {
    let mut mesh = Mesh::default();
    for [low, high] in boxes {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend((0..8).map(|i| {
            let side = |axis: usize| if i >> axis & 1 == 1 { high[axis] } else { low[axis] };
            Vec3::new(side(0), side(1), side(2))
        }));
        for [a, b, c, d] in [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]] {
            mesh.triangles.extend([[a, b, c], [a, c, d]].map(|triangle| triangle.map(|corner| first + corner)));
            mesh.materials.extend([0; 2]);
        }
    }
    mesh
}

fn at(low: [f32; 3], size: [f32; 3]) -> [Vec3; 2] {
    let low = Vec3::from(low);
    [low, low + Vec3::from(size)]
}

/// Four legs under a seat.
fn stool(x: f32, z: f32) -> Vec<[Vec3; 2]> {
    let leg = |dx: f32, dz: f32| at([x + dx, 0.0, z + dz], [0.1, 0.5, 0.1]);
    vec![leg(0.0, 0.0), leg(0.9, 0.0), leg(0.0, 0.9), leg(0.9, 0.9), at([x, 0.505, z], [1.0, 0.1, 1.0])]
}

#[test]
fn stools_are_wholes_and_the_floor_is_none_of_them() {
    let floor = at([0.0, -0.2, 0.0], [12.0, 0.2, 12.0]);
    let all: Vec<_> = [vec![floor], stool(1.0, 1.0), stool(3.0, 1.0), stool(8.0, 8.0)].concat();
    let pieces = boxes(&all).pieces().clone();
    assert_eq!(pieces.count(), 4);
    assert_eq!(pieces.triangles(0), (0..12).collect::<Vec<_>>());
    assert_eq!(pieces.triangles(2), (12 * 6..12 * 11).collect::<Vec<_>>());
    assert_eq!(pieces.of_triangle(12 * 11), 3);
    assert!(pieces.triangles(4).is_empty() && pieces.triangles(u32::MAX).is_empty());
}

#[test]
fn what_crosses_without_a_corner_near_touches() {
    // Two bars across each other; a far box makes them small.
    let bars = [at([0.0, 0.0, 0.45], [1.0, 0.1, 0.1]), at([0.45, 0.05, 0.0], [0.1, 0.2, 1.0])];
    let far = at([20.0, 0.0, 0.0], [1.0, 1.0, 1.0]);
    assert_eq!(boxes(&[bars[0], bars[1], far]).pieces().count(), 2);
}

#[test]
fn a_mesh_without_triangles_has_no_pieces() {
    assert_eq!(Mesh::default().pieces().count(), 0);
}

/// Chairs are chairs in the scene that people will try this in.
#[test]
fn the_conference_room_falls_into_chairs_tables_and_emitters() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("conference");
    let scene = crate::read::load(&folder).unwrap().scene;
    let mesh = &scene.meshes[0];
    let pieces = mesh.pieces();
    let of_size = |size: usize| (0..pieces.count() as u32).filter(move |p| pieces.triangles(*p).len() == size).count();
    // Armchairs, chairs of tubes, the two halves of the table, paper baskets.
    assert_eq!([of_size(1428), of_size(3928), of_size(5000), of_size(1276)], [12, 20, 2, 2]);
    assert!((100..250).contains(&pieces.count()), "{}", pieces.count());
    let shines = |t: &u32| !scene.materials[mesh.materials[*t as usize] as usize].emission.is_black();
    let emitters = (0..pieces.count() as u32).filter(|piece| pieces.triangles(*piece).iter().all(shines));
    assert_eq!(emitters.count(), 60);
}

proptest! {
    /// Whatever there is: every triangle is in one piece, neighbours are together, and order does not matter.
    #[test]
    fn pieces_are_a_partition(triangles in prop::collection::vec(prop::array::uniform3(0_u8..60), 1..60), far in 0.0_f32..30.0) {
        let corner = |i: u8| Vec3::new(f32::from(i % 4), f32::from(i / 4 % 4), f32::from(i / 16) * far);
        let positions: Vec<Vec3> = triangles.iter().flatten().map(|i| corner(*i)).collect();
        let count = triangles.len() as u32;
        let mesh = Mesh {
            positions,
            triangles: (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            materials: vec![0; triangles.len()],
            ..Mesh::default()
        };
        let pieces = mesh.pieces();
        let mut seen = vec![0; triangles.len()];
        for piece in 0..pieces.count() as u32 {
            prop_assert!(pieces.triangles(piece).is_sorted());
            for triangle in pieces.triangles(piece) {
                prop_assert_eq!(pieces.of_triangle(*triangle as usize), piece);
                seen[*triangle as usize] += 1;
            }
        }
        prop_assert!(seen.iter().all(|count| *count == 1));
        for (a, one) in triangles.iter().enumerate() {
            for (b, other) in triangles.iter().enumerate() {
                let shares = one.iter().any(|i| other.iter().any(|j| corner(*i) == corner(*j)));
                prop_assert!(!shares || pieces.of_triangle(a) == pieces.of_triangle(b));
            }
        }
    }
}
