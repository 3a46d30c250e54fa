//! Faces with more than three corners, cut into triangles.

use glam::{DVec2, DVec3};

use super::limits::CONCAVE_CORNERS_MAX;

/// A face too large to cut, see [`triangulate`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TooManyCorners;

/// Triangles over the corners of a face, as indices into `corners`, wound like the face.
///
/// Convex faces become a fan about corner 0; others are cut by their ears (Meisters 1975), in the
/// plane of Newell's normal. A face that crosses itself gives some `n − 2` triangles.
pub(super) fn triangulate(corners: &[DVec3], triangles: &mut Vec<[usize; 3]>) -> Result<(), TooManyCorners> {
    let n = corners.len();
    if n == 3 {
        triangles.push([0, 1, 2]);
        return Ok(());
    }
    let plane = flatten(corners);
    let turns_right = |i: usize| turn(plane[(i + n - 1) % n], plane[i], plane[(i + 1) % n]) < 0.0;
    if !(0..n).any(turns_right) {
        triangles.extend((2..n).map(|i| [0, i - 1, i]));
        return Ok(());
    }
    if n > CONCAVE_CORNERS_MAX {
        return Err(TooManyCorners);
    }
    let mut left: Vec<usize> = (0..n).collect();
    while left.len() > 3 {
        let ear = (0..left.len()).find(|&i| is_ear(&plane, &left, i)).unwrap_or(0);
        let m = left.len();
        triangles.push([left[(ear + m - 1) % m], left[ear], left[(ear + 1) % m]]);
        left.remove(ear);
    }
    triangles.push([left[0], left[1], left[2]]);
    Ok(())
}

/// Corner `i` of the remaining polygon is convex, has an area and no other corner lies in its triangle.
fn is_ear(plane: &[DVec2], left: &[usize], i: usize) -> bool {
    let m = left.len();
    let [a, b, c] = [(i + m - 1) % m, i, (i + 1) % m].map(|k| plane[left[k]]);
    if turn(a, b, c) <= 0.0 {
        return false;
    }
    let inside = |p: DVec2| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
    !left.iter().map(|&k| plane[k]).any(|p| p != a && p != b && p != c && inside(p))
}

/// The corners along the two axes in which the face is largest, counter-clockwise.
fn flatten(corners: &[DVec3]) -> Vec<DVec2> {
    let mut normal = DVec3::ZERO;
    for (i, &p) in corners.iter().enumerate() {
        normal += (p - corners[0]).cross(corners[(i + 1) % corners.len()] - corners[0]);
    }
    let size = normal.abs();
    let (u, v, facing) = if size.z >= size.x && size.z >= size.y {
        (DVec3::X, DVec3::Y, normal.z)
    } else if size.y >= size.x {
        (DVec3::Z, DVec3::X, normal.y)
    } else {
        (DVec3::Y, DVec3::Z, normal.x)
    };
    let u = if facing < 0.0 { -u } else { u };
    corners.iter().map(|&p| p - corners[0]).map(|p| DVec2::new(p.dot(u), p.dot(v))).collect()
}

/// Twice the signed area of a triangle: positive if it turns left.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(corners: &[DVec3]) -> f64 {
        let mut triangles = Vec::new();
        triangulate(corners, &mut triangles).unwrap();
        assert_eq!(triangles.len(), corners.len() - 2);
        let signed = |t: &[usize; 3]| (corners[t[1]] - corners[t[0]]).cross(corners[t[2]] - corners[t[0]]).z / 2.0;
        assert!(triangles.iter().all(|t| signed(t) >= 0.0), "a triangle is wound backwards: {triangles:?}");
        triangles.iter().map(signed).sum()
    }

    fn polygon(points: &[(f64, f64)]) -> Vec<DVec3> {
        points.iter().map(|&(x, y)| DVec3::new(x, y, 0.0)).collect()
    }

    #[test]
    fn an_arrow_whose_first_corner_is_its_notch_or_not_keeps_its_area() {
        let arrow = [(0.0, 0.0), (2.0, 0.0), (0.5, 0.5), (0.0, 2.0)];
        for start in 0..4 {
            let mut turned = arrow;
            turned.rotate_left(start);
            assert!((area(&polygon(&turned)) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_comb_is_cut_into_triangles_that_neither_overlap_nor_leave_it() {
        let mut comb = vec![(20.0, 0.0), (20.0, 1.0)];
        comb.extend((0..20).rev().flat_map(|i| [(f64::from(i) + 0.5, 3.0), (f64::from(i), 1.0)]));
        comb.push((0.0, 0.0));
        assert!((area(&polygon(&comb)) - 40.0).abs() < 1e-9);
    }

    #[test]
    fn a_convex_face_is_a_fan_about_its_first_corner() {
        let mut triangles = Vec::new();
        triangulate(&polygon(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]), &mut triangles).unwrap();
        assert_eq!(triangles, [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn a_huge_concave_face_is_refused_and_a_huge_convex_one_is_not() {
        let circle: Vec<_> = (0..5000).map(|i| f64::from(i) * 0.001).map(|a| (a.cos(), a.sin())).collect();
        assert!(triangulate(&polygon(&circle), &mut Vec::new()).is_ok());
        let star: Vec<_> = circle.iter().enumerate().map(|(i, p)| if i % 2 == 0 { *p } else { (0.0, 0.0) }).collect();
        assert_eq!(triangulate(&polygon(&star), &mut Vec::new()), Err(TooManyCorners));
    }
}
