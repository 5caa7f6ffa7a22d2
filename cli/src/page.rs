//! The page of subcommands other than `view`: the data that `play` and `run` report to their
//! observer.

use std::io;
use std::path::Path;

use meissner_engine::{Event, Sensor};
use meissner_run::run::{Observer, Prediction, ReportState};
use meissner_view::Chosen;
use meissner_view::sensors::{Report, Sensors, State};
use meissner_view::server::Server;

use crate::error::CliError;
use crate::stderr::tell;

/// A server at `port`.
///
/// # Errors
/// The port is in use.
pub(crate) fn serve(port: u16) -> Result<Server, CliError> {
    Server::open(port).map_err(|source| CliError::Port { port, source })
}

/// The page at `port`, if requested, for inputs with these names and sensors.
///
/// # Errors
/// The port is in use.
pub(crate) fn sensors<N>(
    port: Option<u16>,
    inputs: &[(String, Sensor)],
    span_us: i64,
    name: &str,
    chosen: &Chosen<N>,
) -> Result<Option<Sensors>, CliError> {
    let Some(port) = port else { return Ok(None) };
    let server = serve(port)?;
    tell(format_args!("page: {}", server.url()));
    let short = |(name, sensor): &(String, Sensor)| {
        let file = Path::new(name).file_stem().map(|file| file.to_string_lossy().into_owned());
        (file.unwrap_or_else(|| name.clone()), *sensor)
    };
    let inputs: Vec<_> = inputs.iter().map(short).collect();
    Ok(Some(Sensors::new(server, &inputs, span_us, name, chosen)))
}

/// Calls `run`, which shows its predictions to `observer`, and on the page if there is one.
pub(crate) fn observe<T>(
    sensors: Option<Sensors>,
    observer: &mut dyn Observer,
    run: impl FnOnce(&mut dyn Observer) -> T,
) -> T {
    match sensors {
        Some(sensors) => run(&mut Viewed { sensors, observer }),
        None => run(observer),
    }
}

/// Shows the data of an observer.
struct Viewed<'a> {
    sensors: Sensors,
    observer: &'a mut dyn Observer,
}

impl Observer for Viewed<'_> {
    fn prediction(&mut self, prediction: &Prediction<'_>) -> io::Result<()> {
        let elapsed = |us: i128| i64::try_from(us).unwrap_or(i64::MAX);
        let (input, report) = match prediction {
            Prediction::Report(of) => {
                let state = match of.state {
                    ReportState::Fresh => State::Fresh,
                    ReportState::Behind => State::Behind,
                    ReportState::Old => State::Old,
                };
                let report = Report {
                    elapsed_us: elapsed(of.elapsed_us),
                    values: of.value.0,
                    nodes: of.nodes,
                    unlike: of.unlike,
                    took_us: of.waited_us,
                    state,
                    waiting: of.behind_events,
                    dropped: of.dropped_events,
                    lost: of.lost_events,
                };
                (of.input, report)
            }
            Prediction::Events(of) => {
                let (elapsed_us, values) = (elapsed(of.elapsed_us.unwrap_or(0)), of.value.0);
                let (nodes, unlike, took_us) = (of.nodes, of.unlike, of.update_us);
                (0, Report { elapsed_us, values, nodes, unlike, took_us, ..Report::default() })
            }
            Prediction::Frames(of) => {
                let (elapsed_us, values) = (elapsed(of.elapsed_us), of.value.0);
                let nodes = usize::try_from(of.events).unwrap_or(usize::MAX);
                let (unlike, took_us) = (of.unlike, of.update_us);
                (0, Report { elapsed_us, values, nodes, unlike, took_us, ..Report::default() })
            }
            _ => return self.observer.prediction(prediction),
        };
        self.sensors.report(input, &report);
        self.observer.prediction(prediction)
    }

    fn progress(&mut self, taken: u64) {
        self.observer.progress(taken);
    }

    fn event(&mut self, input: usize, event: Event) {
        self.sensors.event(input, event);
        self.observer.event(input, event);
    }

    fn takes_events(&self) -> bool {
        true
    }
}
