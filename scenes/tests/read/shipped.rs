//! The scenes of this repository.

use std::path::Path;

use scenes::Needs;
use scenes::read::load;

/// Folder, triangles, emissive triangles, materials, textures, mirrors, glasses.
const SHIPPED: [(&str, u64, u32, usize, usize, u32, u32); 7] = [
    ("cornell", 36, 2, 8, 0, 0, 0),
    ("cornell_spheres", 18060, 2, 8, 0, 1, 1),
    ("veach_door", 20764, 2, 13, 5, 1, 1),
    ("livingroom", 142_971, 8, 21, 3, 2, 1),
    ("conference", 124_739, 120, 20, 0, 0, 0),
    ("daylit", 1532, 0, 17, 1, 0, 1),
    ("product", 5874, 6, 10, 1, 0, 1),
];

#[test]
fn shipped_scenes_are_read_whole_and_without_a_note() {
    for (name, triangles, emissive, materials, textures, mirrors, glass) in SHIPPED {
        let loaded = load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap();
        let needs = Needs::of(&loaded.scene);
        assert_eq!((needs.triangles, needs.emissive_triangles), (triangles, emissive), "{name}");
        assert_eq!((loaded.scene.materials.len(), loaded.scene.textures.len()), (materials, textures), "{name}");
        assert_eq!((needs.mirrors, needs.glass), (mirrors, glass), "{name}");
        // A sky by formula says where its sun stands.
        let is_news = |note: &&scenes::read::Note| !note.to_string().contains("the sun stands");
        assert_eq!(loaded.notes.iter().filter(is_news).count(), 0, "{name}: {:?}", loaded.notes);
        assert_eq!(loaded.scene.name, name);
        assert!(Path::new(env!("CARGO_MANIFEST_DIR")).join(name).join("CREDITS.md").is_file(), "{name} has no credits");
    }
}

#[test]
fn a_scene_read_twice_is_the_same_scene() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("veach_door");
    assert_eq!(load(&folder).unwrap().scene, load(&folder).unwrap().scene);
}
