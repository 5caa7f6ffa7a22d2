//! The program as its users run it: arguments and files in, lines and exit statuses out.
#![forbid(unsafe_code)]

mod bench;
mod bench_frames;
mod broken_input;
mod data;
mod dv;
mod equality;
mod eval;
mod eval_digits;
mod eval_digits_trainings;
mod eval_slip;
mod eval_slip_trainings;
mod exit_status;
mod files;
mod fit;
mod frames;
mod frames_electrodes;
mod frames_pictures;
mod frames_video;
mod letters;
mod live;
mod lost;
mod mcap;
mod names;
mod output;
#[cfg(unix)]
mod pages;
mod pareto;
mod pareto_tasks;
mod play;
mod prepare;
mod prepare_graphs;
mod prepare_presses;
mod provenance;
mod record;
mod report;
mod resume;
#[path = "../../../tests/shared_files.rs"]
mod shared_files;
mod signals;
mod simulate;
mod sockets;
mod support;
mod unlike;
mod verify;
#[cfg(unix)]
mod view;
