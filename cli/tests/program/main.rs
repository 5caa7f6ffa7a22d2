//! The program as its users run it: arguments and files in, lines and exit statuses out.
#![forbid(unsafe_code)]

mod approximations;
mod bench;
mod bench_frames;
mod broken_input;
mod digits_data;
mod draw;
mod equality;
mod eval_angle;
mod eval_digits;
mod eval_digits_trainings;
mod eval_force;
mod eval_slip;
mod eval_slip_trainings;
mod eval_touch;
mod every;
mod exit_status;
mod files;
mod foreign_input;
mod frames;
mod frames_decisions;
mod frames_electrodes;
mod frames_events;
mod frames_pictures;
mod json_page;
mod left_out;
mod live;
mod lost;
mod manual;
mod output;
mod pareto;
mod pareto_digits;
mod pareto_force;
mod pareto_slip;
mod play;
mod play_many;
mod prepare;
mod prepare_digits;
mod prepare_graphs;
mod provenance;
mod refused_lines;
mod resume;
#[path = "../../../tests/shared_files.rs"]
mod shared_files;
#[cfg(unix)]
mod signals;
mod simulate;
mod slip_data;
mod slip_views;
mod soak;
mod sockets;
mod stress;
mod support;
mod touch_data;
mod verify;
mod widths;
