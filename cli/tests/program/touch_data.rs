//! A small data set of a tactile skin.

use std::io::Write;

use tempfile::TempDir;

/// A folder with containers: of each class a recording of two spikes for training, and one for the
/// test.
pub(crate) fn touch_folder(classes: usize) -> TempDir {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let mut arrays = Vec::new();
    for (split, first) in [("train", 0), ("test", 3)] {
        for class in 0..classes {
            arrays.push((
                format!("Ev-Containers/{split}/sample_{class}_label_{class}.npy"),
                array(first + class),
            ));
        }
    }
    std::fs::write(folder.path().join("Ev-Containers.zip"), archive(&arrays))
        .expect("a temporary file can be written");
    folder
}

/// An archive with these files.
pub(crate) fn archive(files: &[(impl AsRef<str>, Vec<u8>)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut archive = rawzip::ZipArchiveWriter::new(&mut bytes);
    for (name, content) in files {
        let (mut entry, config) = archive.new_file(name.as_ref()).start().expect("a vector takes everything");
        let mut writer = config.wrap(&mut entry);
        writer.write_all(content).expect("a vector takes everything");
        let (_, descriptor) = writer.finish().expect("a vector takes everything");
        entry.finish(descriptor).expect("a vector takes everything");
    }
    archive.finish().expect("a vector takes everything");
    bytes
}

/// An array of four bins with spikes of the taxel in the first and in the last.
fn array(taxel: usize) -> Vec<u8> {
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (39, 2, 4), }\n";
    let mut values = [0.0_f32; 39 * 2 * 4];
    for place in [0, 7] {
        values[taxel * 8 + place] = 1.0;
    }
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    bytes
}
