//! Descriptions, weights and networks built from them.

mod convolutions;
mod descriptions;
mod features;
mod filters;
mod frame_vectors;
mod frames;
mod heads;
mod hostile_descriptions;
mod hostile_weights;
mod listed_tensors;
mod maps;
mod modules;
mod names;
mod network_files;
mod problems;
mod properties;
mod refits;
mod sizes;
mod support;
mod weights;
