//! Writes the drawn weights files again: `cargo run -p meissner-models --example draw_weights`.

use std::path::Path;

use meissner_models::{DRAWN, Description, drawn_file};

fn main() -> std::io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("weights");
    for (name, seed) in DRAWN {
        let file = format!("{name}.safetensors");
        let description = Description::shipped(name).expect("every drawn network is shipped");
        let bytes = drawn_file(&description, *seed);
        std::fs::write(folder.join(&file), &bytes)?;
        println!("{file}: {} bytes, seed {seed}", bytes.len());
    }
    Ok(())
}
