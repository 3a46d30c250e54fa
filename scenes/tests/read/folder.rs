//! Scene folders made by tests.

use std::path::PathBuf;

use scenes::read::{self, Loaded, ReadError};
use scenes::{Scene, Texture};

/// A temporary folder with files in it.
pub struct Folder(tempfile::TempDir);

impl Folder {
    /// With these files.
    pub fn of(files: &[(&str, &[u8])]) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        for (name, content) in files {
            folder.write(name, content);
        }
        folder
    }

    /// Adds or replaces a file.
    pub fn write(&self, name: &str, content: &[u8]) {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, content).unwrap();
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Reads the file, or the folder if the name is empty. Whatever is read must be sound.
    pub fn try_load(&self, name: &str) -> Result<Loaded, ReadError> {
        let loaded = read::load(&self.path(name));
        if let Ok(loaded) = &loaded {
            loaded.scene.check().unwrap();
        }
        loaded
    }

    pub fn load(&self, name: &str) -> Loaded {
        self.try_load(name).unwrap_or_else(|error| panic!("{error}"))
    }
}

/// An OBJ file alone, read.
pub fn load_obj(text: &str) -> Loaded {
    Folder::of(&[("a.obj", text.as_bytes())]).load("a.obj")
}

/// A triangle of material `m`, and the MTL that says what that is, read.
pub fn load_mtl(mtl: &str) -> Loaded {
    Folder::of(&[("a.obj", TRIANGLE.as_bytes()), ("a.mtl", mtl.as_bytes())]).load("a.obj")
}

/// A triangle of material `m` in `a.mtl`.
pub const TRIANGLE: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n";

/// The textures that the files name: all but the sky of a studio.
pub fn textures(scene: &Scene) -> Vec<&Texture> {
    scene.textures.iter().map(|texture| &**texture).filter(|texture| texture.name != "studio").collect()
}

/// Messages of notes, one a line.
pub fn notes(loaded: &Loaded) -> String {
    loaded.notes.iter().map(|note| format!("{note}\n")).collect()
}

/// A PNG of one colour.
pub fn png(width: u32, height: u32, rgba: [u8; 4]) -> Vec<u8> {
    png_of(width, height, |_, _| rgba)
}

/// A PNG of texels by column and row.
pub fn png_of(width: u32, height: u32, rgba: impl Fn(u32, u32) -> [u8; 4]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_fn(width, height, |x, y| image::Rgba(rgba(x, y)))
        .write_to(&mut bytes, image::ImageFormat::Png)
        .unwrap();
    bytes.into_inner()
}
