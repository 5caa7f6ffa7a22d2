//! Writes the drawn weights files again: `cargo run -p meissner-models --example draw_weights`.

use std::path::Path;

fn main() -> std::io::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("weights");
    for (name, seed) in meissner_models::DRAWN {
        let file = format!("{name}.safetensors");
        let bytes = meissner_models::drawn_file(name).expect("every drawn network is shipped");
        std::fs::write(folder.join(&file), &bytes)?;
        println!("{file}: {} bytes, seed {seed}", bytes.len());
    }
    Ok(())
}
