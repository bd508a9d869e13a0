//! Any bytes as a mesh file: the first one chooses the format.
#![no_main]

use std::path::Path;

use fluxion::mitsuba::mesh;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Some((choice, rest)) = bytes.split_first() else { return };
    let format = ["obj", "ply", "serialized"][usize::from(choice % 3)];
    if let Ok(mesh) = mesh::read(format, rest, usize::from(choice / 3 % 3), Path::new("fuzz")) {
        let count = mesh.positions.len();
        assert!(mesh.triangles.iter().flatten().all(|&vertex| (vertex as usize) < count));
        assert!([mesh.normals.len(), mesh.uvs.len()].iter().all(|&n| n == 0 || n == count));
        for (name, values) in &mesh.attributes {
            let expected = if name.starts_with("face_") { mesh.triangles.len() } else { count };
            assert_eq!(values.len(), expected, "{name}");
        }
    }
});
