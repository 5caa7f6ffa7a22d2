//! Prints the hash that the module must give in a browser.

fn main() {
    println!("{}", meissner_wasm::press_hash());
}
