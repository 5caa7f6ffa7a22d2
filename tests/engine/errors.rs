//! What errors of the libraries say of their sources.

use std::error::Error;
use std::io;
use std::path::PathBuf;

use meissner_engine::representations::RepresentationError;
use meissner_engine::{EngineError, Sensor};
use meissner_io::{IoError, Place};
use meissner_kernels::KernelError;
use meissner_live::LiveError;
use meissner_models::ModelError;
use meissner_models::systems::slip::SlipError;
use meissner_reference::ReferenceError;

fn denied() -> io::Error {
    io::Error::new(io::ErrorKind::PermissionDenied, "denied")
}

/// Errors of every library that have a source, or stand for one that has, and how many sources they have.
fn errors() -> Vec<(Box<dyn Error>, usize)> {
    let path = || PathBuf::from("some.file");
    let layer = || {
        let source = KernelError::Length { tensor: "weight", expected: 3, found: 2 };
        EngineError::Layer { layer: "conv1".to_owned(), source }
    };
    let bytes = || IoError::Unsupported { expected: "some", actual: "other".to_owned() };
    let reading = RepresentationError::Reading { electrode: 3, value: f32::NAN };
    vec![
        (Box::new(layer()), 1),
        (Box::new(LiveError::Engine(layer())), 1),
        (Box::new(LiveError::Thread(denied())), 1),
        (Box::new(ModelError::Read { path: path(), source: denied() }), 1),
        (Box::new(ModelError::Engine(layer())), 1),
        (Box::new(ReferenceError::Engine(layer())), 1),
        (Box::new(ReferenceError::Engine(EngineError::Sensor(Sensor::new(0, 1)))), 0),
        (Box::new(SlipError::Reading(reading)), 0),
        (Box::new(IoError::File { action: "open", path: path(), source: denied() }), 1),
        (
            Box::new(IoError::Stream {
                format: "CSV",
                action: "read",
                place: Place::Line(2),
                source: denied(),
            }),
            1,
        ),
        (Box::new(IoError::Content { path: path(), source: Box::new(bytes()) }), 1),
    ]
}

#[test]
fn an_error_of_a_library_does_not_repeat_its_source() {
    for (error, sources) in errors() {
        let mut outer: &dyn Error = &*error;
        let mut count = 0;
        while let Some(source) = outer.source() {
            assert!(!outer.to_string().contains(&source.to_string()), "{outer}: {source}");
            outer = source;
            count += 1;
        }
        assert_eq!(count, sources, "{error}");
    }
}
