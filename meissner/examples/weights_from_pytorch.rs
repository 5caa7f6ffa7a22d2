//! Weights of `PyTorch`: the names and shapes that a network needs, and a file loaded into it.
//!
//! ```text
//! cargo run --release -p meissner --example weights_from_pytorch [DESCRIPTION.toml WEIGHTS]
//! ```
//!
//! WEIGHTS is a safetensors file or a state dict (`torch.save(model.state_dict(), "weights.pth")`),
//! which is never executed. `docs/weights-from-pytorch.md` has the layouts.

use std::collections::BTreeMap;
use std::error::Error;

use meissner::{Description, Engine, Event, Sensor, Weights, draw};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (description, weights) = if let [description, weights] = &arguments[..] {
        (Description::load(description)?, Weights::load(weights)?)
    } else {
        // Stands in for a file that a training wrote.
        let description = Description::shipped("tactigraph-past").ok_or("no such network")?;
        let drawn = draw(&description, 1).to_safetensors(&BTreeMap::new());
        (description, Weights::from_bytes(&drawn)?)
    };
    for (name, shape) in description.tensors() {
        let found = weights.get(&name).map(|tensor| tensor.shape().to_vec());
        println!("{name}: expected {shape:?}, found {found:?}");
    }
    // A missing tensor, a wrong shape or a value that is not finite is an error with its name.
    let network = description.network(&weights)?;
    let mut engine = Engine::new(network, Sensor::new(240, 180))?;
    engine.push(Event::new(0, 120, 90, true));
    println!("{:?}", engine.predict()?.values);
    Ok(())
}
