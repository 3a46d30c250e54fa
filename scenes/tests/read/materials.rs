//! What MTL materials become.

use glam::Vec3;
use scenes::{Colour, Dielectric, Gloss, LookUp, Material, Pixels, Scalar, Sheen, Specular, Surface};

use crate::folder::{Folder, TRIANGLE, load_mtl, notes, png, textures};

fn material(mtl: &str) -> Material {
    load_mtl(&format!("newmtl m\n{mtl}")).scene.materials[0].clone()
}

fn diffuse(r: f32, g: f32, b: f32) -> Surface {
    Surface::Diffuse { albedo: Colour::plain(Vec3::new(r, g, b)) }
}

/// Roughness, metalness and F₀ of a glossy surface.
fn glossy(mtl: &str) -> (Vec3, f32, f32, f32) {
    match material(mtl).surface {
        Surface::Glossy(Gloss { base, roughness, metalness, f0, .. }) => {
            (base.value, roughness.value, metalness.value, f0)
        }
        other => panic!("{mtl}: {other:?}"),
    }
}

#[test]
fn the_conventions_of_the_references_are_kept() {
    assert_eq!(material("illum 1\nKd .1 .2 .3\nKs 1 1 1\nNs 10\n").surface, diffuse(0.1, 0.2, 0.3));
    let reflectance = Vec3::new(0.85, 0.8, 0.7);
    assert_eq!(material("illum 3\nKd 0 0 0\nKs .85 .8 .7").surface, Surface::Mirror { reflectance });
    assert_eq!(material("illum 5\nKs .85 .8 .7").surface, Surface::Mirror { reflectance });
    assert_eq!(glossy("illum 3\nKs .85 .8 .7\nPr 0.25"), (reflectance, 0.25, 1.0, 0.04));
    let glass = |r, g, b| {
        let transmittance = Colour::plain(Vec3::new(r, g, b));
        Surface::Dielectric(Dielectric { transmittance, ..Dielectric::clear(1.33, false) })
    };
    assert_eq!(material("illum 7\nKd 0 0 0\nNi 1.33\nTf .9 .8 .7").surface, glass(0.9, 0.8, 0.7));
    assert_eq!(material("illum 4\nNi 1.33").surface, glass(1.0, 1.0, 1.0));
    let lamp = material("illum 1\nKd .7 .7 .7\nKe 16 14.5 12");
    assert_eq!((lamp.surface, lamp.emission.value), (diffuse(0.7, 0.7, 0.7), Vec3::new(16.0, 14.5, 12.0)));
    assert!(!lamp.emits_both_sides);
}

#[test]
fn phong_s_constants_become_a_lobe_as_wide() {
    let (base, roughness, metalness, f0) = glossy("Kd .5 .5 .5\nKs .5 .5 .5\nNs 198");
    assert_eq!((base, metalness), (Vec3::splat(0.5), 0.0));
    assert!((roughness - 0.1_f32.sqrt()).abs() < 1e-6 && (f0 - 0.04).abs() < 1e-6, "{roughness} {f0}");
    let (base, _, metalness, _) = glossy("illum 2\nKd 0 0 0\nKs .9 .6 .3\nNs 100");
    assert_eq!((base, metalness), (Vec3::new(0.9, 0.6, 0.3), 1.0));
    assert_eq!(material("Kd .5 .5 .5\nKs 0 0 0\nNs 100").surface, diffuse(0.5, 0.5, 0.5));
}

#[test]
fn highlights_have_the_colour_of_ks_and_its_map() {
    let gloss = |body: &str| {
        let mtl = format!("newmtl m\n{body}");
        let [red, dark] = [png(1, 1, [255, 0, 0, 255]), png(1, 1, [64, 0, 0, 255])];
        let files: [(&str, &[u8]); 4] =
            [("a.obj", TRIANGLE.as_bytes()), ("a.mtl", mtl.as_bytes()), ("ks.png", &red), ("ns.png", &dark)];
        let loaded = Folder::of(&files).load("a.obj");
        let Surface::Glossy(gloss) = loaded.scene.materials[0].surface.clone() else { panic!("{body}: it is glossy") };
        (gloss, notes(&loaded), loaded.scene)
    };
    let (grey, ..) = gloss("Kd .5 .5 .5\nKs .5 .5 .5\nNs 198");
    assert_eq!(grey.specular, Specular::WHOLE);
    let (gold, ..) = gloss("Kd .5 .5 .5\nKs .9 .6 .3\nNs 198");
    assert!((gold.specular.colour.value * gold.f0 - Vec3::new(0.9, 0.6, 0.3) * 0.08).length() < 1e-6, "{gold:?}");
    let (mapped, said, scene) = gloss("Kd .5 .5 .5\nKs 0 0 0\nNs 198\nmap_Ks ks.png\nmap_Ns ns.png");
    assert!((mapped.f0 - 0.08).abs() < 1e-6 && mapped.specular.colour.texture.is_some(), "black under a map is white");
    let (texture, channel) = mapped.roughness.texture.expect("by its map");
    let Pixels::Linear8(texels) = &scene.textures[texture as usize].pixels else { panic!("numbers") };
    let found = mapped.roughness.value * f32::from(texels[0][usize::from(channel)]) / 255.0;
    let exponent = 198.0 * 64.0 / 255.0_f32;
    assert!((found - (2.0 / (exponent + 2.0)).sqrt().sqrt()).abs() < 3e-3, "{found}");
    assert!(!said.contains("not drawn"), "{said}");
    let mirror = load_mtl("newmtl m\nillum 3\nKs 1 1 1\nmap_Ks ks.png\n");
    assert!(notes(&mirror).contains("map_ks not drawn"), "{}", notes(&mirror));
}

#[test]
fn the_pbr_extension_is_roughness_and_metalness() {
    assert_eq!(glossy("Kd .5 .5 .5\nPr .3\nPm 1"), (Vec3::splat(0.5), 0.3, 1.0, 0.04));
    assert_eq!(glossy("Kd .5 .5 .5\nPr 7"), (Vec3::splat(0.5), 1.0, 0.0, 0.04));
}

#[test]
fn a_coat_lies_over_gloss_and_over_what_is_matt() {
    let coat = |mtl: &str| match material(mtl).surface {
        Surface::Glossy(Gloss { metalness, coat: Some(coat), .. }) => {
            (metalness.value, coat.amount.value, coat.roughness.value)
        }
        other => panic!("{mtl}: {other:?}"),
    };
    assert_eq!(coat("Kd .5 .5 .5\nPr .3\nPm 1\nPc .75\nPcr .1"), (1.0, 0.75, 0.1));
    assert_eq!(coat("illum 1\nKd .5 .5 .5\nPc 1"), (0.0, 1.0, 0.0));
    assert_eq!(material("illum 1\nKd .5 .5 .5\nPc 0\nPcr .3\nPs 0").surface, diffuse(0.5, 0.5, 0.5));
    let Surface::Glossy(velvet) = material("illum 1\nKd .5 .5 .5\nPs .4").surface else { panic!("it has sheen") };
    let sheen = Sheen { colour: Colour::plain(Vec3::splat(0.4)), roughness: Scalar::plain(0.5) };
    assert_eq!((velvet.sheen, velvet.coat, velvet.specular.amount.value), (Some(sheen), None, 0.0));
    let glass = load_mtl("newmtl m\nillum 7\nNi 1.5\nTf 1 1 1\nPc 1\nPs .5\naniso .5\n");
    assert!(matches!(glass.scene.materials[0].surface, Surface::Dielectric(_)));
    for said in
        ["a coat (Pc) over mirrors and glass", "sheen (Ps) over mirrors and glass", "anisotropy (aniso) is not drawn"]
    {
        assert!(notes(&glass).contains(said), "{}", notes(&glass));
    }
}

/// What Blender writes, in its order, of a material of specular level ½ and roughness ½.
fn blenders(illum: u32, d: f32, kd: &str) -> String {
    format!(
        "Ns 250.000000\nKa 1.000000 1.000000 1.000000\nKd {kd}\nKs 0.500000 0.500000 0.500000\n\
         Ke 0.000000 0.000000 0.000000\nNi 1.450000\nd {d:.6}\nillum {illum}\n"
    )
}

#[test]
fn blender_s_metal_is_metal_of_its_colour_and_roughness_with_and_without_its_header() {
    let gold = Vec3::new(0.8, 0.45, 0.06);
    for header in ["", "# Blender 4.1.1 MTL File: 'room.blend'\n# www.blender.org\n"] {
        let read = |body: &str| load_mtl(&format!("{header}newmtl m\n{body}"));
        let loaded = read(&blenders(3, 1.0, "0.8 0.45 0.06"));
        let Surface::Glossy(Gloss { base, roughness, metalness, .. }) = &loaded.scene.materials[0].surface else {
            panic!("{:?}", loaded.scene.materials[0].surface)
        };
        assert_eq!((base.value, roughness.value, metalness.value), (gold, 0.5, 1.0));
        let said = "1 materials are metal as Blender writes it";
        assert!(notes(&loaded).contains(said), "{}", notes(&loaded));
        // The PBR extension's numbers go before.
        let loaded = read(&(blenders(3, 1.0, "0.8 0.45 0.06") + "Pr 0.300000\nPm 1.000000\nPs 0.000000\n"));
        let Surface::Glossy(Gloss { base, roughness, metalness, .. }) = &loaded.scene.materials[0].surface else {
            panic!("{:?}", loaded.scene.materials[0].surface)
        };
        assert_eq!((base.value, roughness.value, metalness.value), (gold, 0.3, 1.0));
        // Smooth ones are mirrors of their colour.
        let smooth = blenders(3, 1.0, "0.8 0.45 0.06").replace("250.000000", "1000.000000");
        assert_eq!(read(&smooth).scene.materials[0].surface, Surface::Mirror { reflectance: gold });
    }
}

#[test]
fn mirrors_that_others_write_stay_mirrors() {
    for body in [
        "illum 3\nKd 0 0 0\nKs .95 .95 .95\n",
        "Ns 250\nKa 0 0 0\nKd 0 0 0\nKs .95 .95 .95\nKe 0 0 0\nNi 1.5\nd 1\nillum 3\n",
        "Ns 250\nKa 0 0 0\nKd .2 .2 .2\nKs .95 .95 .95\nKe 0 0 0\nNi 1.5\nd 1\nillum 3\n",
        "Ns 250\nKa 1 1 1\nKd .2 .2 .2\nKs .5 .5 .5\nKe 0 0 0\nNi 1\nd 1\nTr 0\nTf 1 1 1\nillum 3\n",
    ] {
        let loaded = load_mtl(&format!("newmtl m\n{body}"));
        assert!(matches!(loaded.scene.materials[0].surface, Surface::Mirror { .. }), "{body}");
        assert!(!notes(&loaded).contains("Blender"), "{}", notes(&loaded));
    }
}

#[test]
fn what_exporters_call_glass_is_glass_only_if_it_is() {
    let is_glass = |body: &str| matches!(material(body).surface, Surface::Dielectric(_));
    for body in [
        "illum 4\nKd .5 .5 .5\nKa 0 0 0\nTf 1.00 1.00 1.00\nNi 1.00\n",
        "illum 4\nKd .5 .5 .5\nNi 1.0\n",
        "Kd .8 .8 .8\nKs 0 0 0\nillum 7\n",
        &blenders(9, 0.9, ".1 .3 .7"),
        &format!("Kd 1 1 1\n{}", blenders(6, 0.8, ".1 .3 .7")),
    ] {
        assert!(!is_glass(body), "{body}");
    }
    for body in [
        "illum 7\nKd 0 0 0\nKs 1 1 1\nNi 1.5\nTf 1 1 1\n",
        "illum 4\nKd .8 .9 .9\nTf .9 1 .9\n",
        "illum 9\nKd .8 .9 .9\nNi 1.5\nd .1\n",
        "illum 6\nKd .8 .9 .9\nd .1\n",
        "illum 4\n",
    ] {
        assert!(is_glass(body), "{body}");
    }
    let loaded = load_mtl("newmtl m\nillum 4\nKd .5 .5 .5\nTf 1 1 1\nNi 1\n");
    assert!(notes(&loaded).contains("1 materials of glass"), "{}", notes(&loaded));
}

#[test]
fn opacity_is_how_much_is_there_and_old_ways_of_saying_opaque_are_opaque() {
    let there = |mtl: &str| {
        let material = material(mtl);
        assert_eq!(material.surface, diffuse(1.0, 1.0, 1.0), "{mtl}");
        material.coverage.map_or(1.0, |coverage| coverage.of(1.0))
    };
    for (mtl, share) in [("d 0.2", 0.2), ("Tr 0.75", 0.25), ("d 0.49", 0.49), ("d 0.5", 0.5), ("d 0.7", 0.7)] {
        assert_eq!(there(&format!("Kd 1 1 1\n{mtl}")), share, "{mtl}");
    }
    let curtain = material(&blenders(9, 0.9, "1 1 1")).coverage;
    assert_eq!(curtain.map(|coverage| coverage.of(1.0)), Some(0.9), "Blender's alpha");
    for opaque in ["Kd 1 1 1\nd 1", "Kd 1 1 1\nTr 1", "Kd 1 1 1\nd 1\nTr 1"] {
        assert_eq!(there(opaque), 1.0, "{opaque}");
    }
}

#[test]
fn colours_may_be_one_number_and_are_kept_within_energy() {
    assert_eq!(material("illum 1\nKd 0.25").surface, diffuse(0.25, 0.25, 0.25));
    let loaded = load_mtl("newmtl m\nillum 1\nKd 2 0.5 -1\n");
    assert_eq!(loaded.scene.materials[0].surface, diffuse(1.0, 0.5, 0.0));
    assert!(notes(&loaded).contains("Kd is outside 0..1"), "{}", notes(&loaded));
}

#[test]
fn names_may_hold_blanks_and_hashes() {
    let obj = TRIANGLE.replace("usemtl m", "usemtl Material #25");
    let mtl = b"newmtl Material #25\nillum 1\nKd .1 .2 .3\n";
    let scene = Folder::of(&[("a.obj", obj.as_bytes()), ("a.mtl", mtl)]).load("a.obj").scene;
    assert_eq!(
        (scene.materials[0].name.as_str(), &scene.materials[0].surface),
        ("Material #25", &diffuse(0.1, 0.2, 0.3))
    );
}

#[test]
fn textures_are_found_under_names_that_other_machines_wrote() {
    let red = png(2, 1, [255, 0, 0, 255]);
    for written in ["tex/Red One.PNG", r"tex\red one.png", r"C:\Users\me\Red One.png", "-s 1 1 1 -bm 0.2 red one.png"] {
        let mtl = format!("newmtl m\nKd 1 1 1\nmap_Kd {written}\n");
        let files: &[(&str, &[u8])] =
            &[("a.obj", TRIANGLE.as_bytes()), ("a.mtl", mtl.as_bytes()), ("tex/Red One.png", &red)];
        let scene = Folder::of(files).load("a.obj").scene;
        assert_eq!(textures(&scene).len(), 1, "{written}");
        assert_eq!(scene.textures[0].pixels, Pixels::Srgb8(vec![[255, 0, 0, 255]; 2]));
    }
}

#[test]
fn textures_are_looked_for_beside_the_mtl_before_the_obj() {
    let (red, blue) = (png(1, 1, [255, 0, 0, 255]), png(1, 1, [0, 0, 255, 255]));
    let obj = TRIANGLE.replace("a.mtl", "mats/a.mtl");
    for (map, texel) in [("c.png", [255, 0, 0, 255]), ("img/e.png", [255, 0, 0, 255]), ("d.png", [0, 0, 255, 255])] {
        let mtl = format!("newmtl m\nmap_Kd {map}\n");
        let files: &[(&str, &[u8])] = &[
            ("a.obj", obj.as_bytes()),
            ("mats/a.mtl", mtl.as_bytes()),
            ("mats/c.png", &red),
            ("mats/img/e.png", &red),
            ("c.png", &blue),
            ("d.png", &blue),
        ];
        let scene = Folder::of(files).load("a.obj").scene;
        assert_eq!(scene.textures[0].pixels, Pixels::Srgb8(vec![texel]), "{map}");
    }
}

#[test]
fn names_in_any_encoding_stay_apart_and_utf_16_is_read() {
    // "red wall" and "blue wall" in GBK.
    let [red, blue] = [b"\xba\xec\xc7\xbd".as_slice(), b"\xc0\xb6\xc7\xbd"];
    let mtl = [b"newmtl ", red, b"\nillum 1\nKd 1 0 0\nnewmtl ", blue, b"\nillum 1\nKd 0 0 1\n"].concat();
    let points = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n".as_slice();
    let obj = [points, b"usemtl ", red, b"\nf 1 2 3\nusemtl ", blue, b"\nf 3 2 1\n"].concat();
    let scene = Folder::of(&[("a.obj", &obj), ("a.mtl", &mtl)]).load("a.obj").scene;
    let surfaces: Vec<_> = scene.materials.iter().map(|material| material.surface.clone()).collect();
    assert_eq!(surfaces, [diffuse(1.0, 0.0, 0.0), diffuse(0.0, 0.0, 1.0)]);

    let wide = |text: &str| format!("\u{feff}{text}").encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    let files: &[(&str, &[u8])] = &[("a.obj", &wide(TRIANGLE)), ("a.mtl", &wide("newmtl m\nillum 1\nKd .1 .2 .3\n"))];
    assert_eq!(Folder::of(files).load("a.obj").scene.materials[0].surface, diffuse(0.1, 0.2, 0.3));
}

#[test]
fn an_mtl_that_is_not_named_but_beside_is_used_and_said() {
    for line in ["", "mtllib old_name.mtl\n"] {
        let obj = TRIANGLE.replace("mtllib a.mtl\n", line);
        let files: &[(&str, &[u8])] = &[("a.obj", obj.as_bytes()), ("A.MTL", b"newmtl m\nillum 1\nKd .1 .2 .3\n")];
        let loaded = Folder::of(files).load("a.obj");
        assert_eq!(loaded.scene.materials[0].surface, diffuse(0.1, 0.2, 0.3));
        assert!(notes(&loaded).contains("`a.mtl` beside it is used"), "{}", notes(&loaded));
    }
}

#[test]
fn texture_options_place_the_texture() {
    let mtl = b"newmtl m\nmap_Kd -s 2 3 -o 0.5 0.25 -clamp on a.png\n";
    let files: &[(&str, &[u8])] = &[("a.obj", TRIANGLE.as_bytes()), ("a.mtl", mtl), ("a.png", &png(1, 1, [9; 4]))];
    let scene = Folder::of(files).load("a.obj").scene;
    let uvs: Vec<_> = scene.meshes[0].uvs.iter().map(|uv| uv.to_array()).collect();
    assert_eq!(uvs, [[0.5, 0.25], [2.5, 0.25], [0.5, 3.25]]);
    assert_eq!(scene.textures[0].look_up, LookUp::CLAMP);
}

#[test]
fn the_same_image_is_stored_once_for_each_meaning() {
    let obj = format!("{TRIANGLE}usemtl n\nf 2/1 3/2 1/3\n");
    let mtl = b"newmtl m\nmap_Kd a.png\nnewmtl n\nmap_Kd a.png\nmap_d a.png\n";
    let files: &[(&str, &[u8])] = &[("a.obj", obj.as_bytes()), ("a.mtl", mtl), ("a.png", &png(1, 1, [9; 4]))];
    let scene = Folder::of(files).load("a.obj").scene;
    assert_eq!(textures(&scene).len(), 2);
    assert!(matches!(scene.textures[1].pixels, Pixels::Linear8(_)));
}

#[test]
fn masks_are_read_from_alpha_if_there_is_any_else_from_red() {
    for (alpha, channel) in [(0, 3), (255, 0)] {
        let mask = png(1, 1, [200, 200, 200, alpha]);
        let mtl = b"newmtl m\nKd 1 1 1\nmap_d mask.png\n";
        let files: &[(&str, &[u8])] = &[("a.obj", TRIANGLE.as_bytes()), ("a.mtl", mtl), ("mask.png", &mask)];
        let coverage = Folder::of(files).load("a.obj").scene.materials[0].coverage;
        let amount = scenes::Scalar { value: 1.0, texture: Some((0, channel)) };
        assert_eq!(coverage, Some(scenes::Coverage { amount, cutoff: None }), "soft as the mask is");
    }
}

#[test]
fn emissive_faces_are_flat() {
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 1 0 0\nusemtl m\nf 1//1 2//1 3//1\n";
    let folder = Folder::of(&[("a.obj", obj.as_bytes()), ("a.mtl", b"newmtl m\nKe 1 1 1\n")]);
    assert!(folder.load("a.obj").scene.meshes[0].normals.is_empty());
}

#[test]
fn a_texture_that_is_missing_leaves_the_colour_and_says_so() {
    let loaded = load_mtl("newmtl m\nillum 1\nKd .2 .3 .4\nmap_Kd nowhere.png\n");
    assert_eq!(loaded.scene.materials[0].surface, diffuse(0.2, 0.3, 0.4));
    assert!(notes(&loaded).contains("line 4: texture `nowhere.png` does not exist"), "{}", notes(&loaded));
}

#[test]
fn a_material_that_is_missing_is_grey_and_says_so() {
    let loaded = load_mtl("newmtl other\nKd 1 0 0\n");
    assert_eq!(loaded.scene.materials[0].surface, diffuse(0.5, 0.5, 0.5));
    assert!(notes(&loaded).contains("line 9: material `m` is defined nowhere"), "{}", notes(&loaded));
    let alone = Folder::of(&[("a.obj", TRIANGLE.as_bytes())]).load("");
    assert!(notes(&alone).contains("line 1: material file `a.mtl` does not exist"), "{}", notes(&alone));
}

#[test]
fn what_mtl_says_and_is_not_drawn_is_named() {
    let said = |body: &str| {
        let mtl = format!("newmtl m\n{body}\n");
        let texture = png(1, 1, [255, 0, 0, 255]);
        let files: [(&str, &[u8]); 3] =
            [("a.obj", TRIANGLE.as_bytes()), ("a.mtl", mtl.as_bytes()), ("c.png", &texture)];
        notes(&Folder::of(&files).load("a.obj"))
    };
    for (body, expected) in [
        ("refl -type sphere room.png", "a.mtl: line 1: material `m`: refl not drawn"),
        ("Km 0.2\nmode 3", "a.mtl: line 2: 2 statements are not understood: left out; this is the first: `Km 0.2`"),
        ("d -halo 0.5", "a.mtl: line 2: 1 halos are not drawn"),
        ("map_Kd -mm 0.2 0.5 -boost 2 -cc on c.png", "a.mtl: line 2: -mm, -boost, -cc of `c.png` not heeded"),
    ] {
        let notes = said(body);
        assert!(notes.contains(expected), "{body}: {notes}");
    }
    let notes = said("Kd 1 1 1\nd 1\nsharpness 60\nanisor 0.5\nmap_aat on\nmap_Kd -mm 0 1 -boost 0 -cc off c.png");
    assert!(!notes.contains("a.mtl"), "{notes}");
}

#[test]
fn material_files_may_have_blanks_in_their_names() {
    let said = |named: &str| {
        let obj = format!("mtllib {named}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\nusemtl blue\nf 3 2 1\n");
        let files: [(&str, &[u8]); 3] = [
            ("a.obj", obj.as_bytes()),
            ("my red.mtl", b"newmtl red\nillum 1\nKd 1 0 0\n"),
            ("my blue.mtl", b"newmtl blue\nillum 1\nKd 0 0 1\n"),
        ];
        let loaded = Folder::of(&files).load("a.obj");
        let looks: Vec<Surface> = loaded.scene.materials.iter().map(|material| material.surface.clone()).collect();
        (looks, notes(&loaded))
    };
    for named in ["my red.mtl my blue.mtl", r"my\ blue.mtl my\ red.mtl", "my red.mtl my blue.mtl # both"] {
        let (looks, notes) = said(named);
        assert_eq!(looks, [diffuse(1.0, 0.0, 0.0), diffuse(0.0, 0.0, 1.0)], "{named}: {notes}");
        assert!(!notes.contains("does not exist"), "{named}: {notes}");
    }
    let (_, notes) = said(r"no\ such.mtl nor this.mtl my red.mtl my blue.mtl");
    for missing in ["`no such.mtl`", "`nor this.mtl`"] {
        assert!(notes.contains(&format!("material file {missing} does not exist")), "{notes}");
    }
}
