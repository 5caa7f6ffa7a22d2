//! The program as its users run it: arguments and files in, lines and exit statuses out.
#![forbid(unsafe_code)]

mod bench;
mod default_recording;
mod equality;
mod every;
mod exit_status;
mod files;
mod live;
mod output;
mod support;
