//! OBJ geometry.

use glam::Vec3;
use scenes::{Mesh, Scene};

use crate::folder::{Folder, load_obj, notes};

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

fn area(scene: &Scene) -> f32 {
    let of = |mesh: &Mesh| -> f32 {
        let corner = |i: u32| mesh.positions[i as usize];
        mesh.triangles
            .iter()
            .map(|t| (corner(t[1]) - corner(t[0])).cross(corner(t[2]) - corner(t[0])).length() / 2.0)
            .sum()
    };
    scene.meshes.iter().map(|mesh| of(mesh)).sum()
}

#[test]
fn statements_may_be_written_in_every_way_the_format_allows() {
    let plain = load_obj(&format!("{SQUARE}f 1 2 3 4\n")).scene;
    assert_eq!(plain.triangle_count(), 2);
    let others = [
        format!("{SQUARE}f -4 -3 -2 -1\n"),
        format!("\u{feff}# a comment\r\n{}f 1 2 \\\r\n  3 4 # trailing\r\n", SQUARE.replace('\n', "\r\n")),
        format!("{}\tf\t1  2 3\t4", SQUARE.replace("v ", "  v\t")),
        format!("f 1 2 3 4\n{SQUARE}"),
        format!("{}f 1 2 3 4\n", SQUARE.replace(" 0\n", " 0 1.0\n")),
        format!("{SQUARE}l 1 2\np 1\ns off\nusemap x\nf 1// 2// 3// 4//\n"),
    ];
    for text in &others {
        assert_eq!(load_obj(text).scene.meshes, plain.meshes, "{text}");
    }
}

#[test]
fn latin_1_does_not_stop_reading() {
    let mut text = b"# caf\xe9\no st\xfchle\n".to_vec();
    text.extend(format!("{SQUARE}f 1 2 3 4\n").as_bytes());
    let loaded = Folder::of(&[("a.obj", &text)]).load("");
    assert_eq!(loaded.scene.triangle_count(), 2);
}

#[test]
fn faces_with_and_without_normals_keep_theirs_within_one_group() {
    let scene = load_obj(&format!("{SQUARE}vn 0 0 2\nvn 0 1 0\nf 1 2 3\nf 1//1 3//1 4//2\nf 1 3//1 4\n")).scene;
    let mesh = &scene.meshes[0];
    let normals: Vec<[Vec3; 3]> = mesh.triangles.iter().map(|t| t.map(|i| mesh.normals[i as usize])).collect();
    assert_eq!(normals, [[Vec3::ZERO; 3], [Vec3::Z, Vec3::Z, Vec3::Y], [Vec3::ZERO; 3]]);
}

#[test]
fn concave_faces_are_cut_without_leaving_them() {
    let scene = load_obj("v 0 0 5\nv 4 0 5\nv 4 4 5\nv 2 1 5\nv 0 4 5\nf 1 2 3 4 5\n").scene;
    assert_eq!(scene.triangle_count(), 3);
    assert!((area(&scene) - 10.0).abs() < 1e-5, "{}", area(&scene));
}

#[test]
fn each_name_is_an_object_and_groups_count_only_where_there_are_no_names() {
    let named = load_obj(&format!("{SQUARE}o a\nf 1 2 3\ng part\nf 1 3 4\no b\nf 1 2 4\no a\nf 2 3 4\n")).scene;
    let names = |scene: &Scene| scene.objects.iter().map(|o| o.name.clone()).collect::<Vec<_>>();
    let counts = |scene: &Scene| scene.meshes.iter().map(|m| m.triangles.len()).collect::<Vec<_>>();
    assert_eq!((names(&named), counts(&named)), (vec!["a".into(), "b".into()], vec![3, 1]));
    let grouped = load_obj(&format!("{SQUARE}f 1 2 3\ng chair leg\nf 1 3 4\n")).scene;
    assert_eq!(names(&grouped), ["default", "chair leg"]);
}

#[test]
fn a_file_of_many_objects_is_merged_but_for_those_that_move() {
    let mut text = SQUARE.to_owned();
    (0..70).for_each(|i| text += &format!("o screw{i}\nf 1 2 3\n"));
    let json = r#"{"obj": "a.obj", "movable": ["screw7"],
        "animation": [{"object": "screw3", "keyframes": [{"t": 0, "translate": [0, 0, 1]}]}]}"#;
    let loaded = Folder::of(&[("a.obj", text.as_bytes()), ("scene.json", json.as_bytes())]).load("");
    let names: Vec<_> = loaded.scene.objects.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["static", "screw3", "screw7"]);
    assert_eq!(loaded.scene.triangle_count(), 70);
    assert!(notes(&loaded).contains("68 objects were merged"), "{}", notes(&loaded));
}

#[test]
fn triangles_without_area_are_dropped_with_a_count_and_nothing_else_changes() {
    let clean = load_obj(&format!("{SQUARE}f 1 2 3\nf 1 3 4\n"));
    let text =
        format!("{SQUARE}v 2 0 0\nv nan 0 0\nv 1e39 0 0\nf 1 2 3\nf 1 1 2\nf 1 2 5\nf 1 2 6\nf 1 2 7\nf 1 3 4\n");
    let dirty = load_obj(&text);
    assert_eq!(dirty.scene.meshes, clean.scene.meshes);
    let notes = notes(&dirty);
    assert!(notes.contains("line 9: 2 triangles without area were dropped"), "{notes}");
    assert!(notes.contains("line 11: 2 triangles with a vertex that is no finite number"), "{notes}");
    assert!(notes.contains("line 6: 1 vertices are no finite numbers"), "{notes}");
}

#[test]
fn needles_of_a_million_to_one_are_triangles() {
    assert_eq!(load_obj("v 0 0 0\nv 1 0 0\nv 0.5 1e-6 0\nf 1 2 3\n").scene.triangle_count(), 1);
}

#[test]
fn normals_of_no_length_are_replaced_by_flatness_and_counted() {
    let loaded = load_obj(&format!("{SQUARE}vn 1e-30 0 0\nvn nan 0 0\nvn 1e30 0 0\nf 1//1 2//2 3//3\n"));
    assert_eq!(loaded.scene.meshes[0].normals, [Vec3::X, Vec3::ZERO, Vec3::X]);
    assert!(notes(&loaded).contains("were no usable numbers"), "{}", notes(&loaded));
}

#[test]
fn the_same_file_gives_the_same_scene() {
    let text = format!("{SQUARE}vn 0 0 1\no x\nf 1//1 2//1 3//1\no y\nf 1 3 4\n");
    assert_eq!(load_obj(&text).scene, load_obj(&text).scene);
}
