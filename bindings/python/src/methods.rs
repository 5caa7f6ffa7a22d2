//! Methods of several classes: each macro writes them for one class. Also tables of a notebook.

use std::fmt::Write;

use meissner::EventCounters;

/// Methods of every engine. They use its field `description` and, for copies, all fields.
macro_rules! engine_methods {
    ($class:ident) => {
        #[pymethods]
        impl $class {
            /// The description of the network.
            #[getter]
            fn description(slf: &Bound<'_, Self>) -> Outcome<Description> {
                let this = turn(slf)?;
                Ok(this.description.clone())
            }

            // An engine is true, events or not.
            fn __bool__(&self) -> bool {
                true
            }

            fn __copy__(&self) -> Self {
                self.clone()
            }

            fn __deepcopy__(slf: &Bound<'_, Self>, _memo: &Bound<'_, PyAny>) -> Outcome<Self> {
                let this = turn(slf)?;
                Ok(this.clone())
            }
        }
    };
}

/// Methods of an engine over events. They use its fields `engine`, `outputs` and `losses`. The
/// arguments after its name are the path to its sensor from `self`, and the method of `engine` for
/// the bytes of its state, if a notebook shows them.
macro_rules! engine_over_events {
    ($class:ident, $field:ident $(.$part:ident())+ $(, $bytes:ident)?) => {
        impl $class {
            /// Warns once for each reason for which many events were lost.
            pub(crate) fn warn_of_losses(&mut self, py: Python<'_>) -> Outcome<()> {
                self.losses.look(py, *self.engine.event_counters(), self.$field$(.$part())+)
            }
        }

        #[pymethods]
        impl $class {
            /// Inserts events in order; returns the number of accepted ones, including events that
            /// were held before. The others are held, or counted in `counters`.
            ///
            /// Give a structured array with the fields t (microseconds or timedelta64), x, y, p
            /// (-1, 0, 1 or bool) of any integer types in any order, four arrays `t=, x=, y=, p=`,
            /// or a `Recording`. Other common names in files are accepted, too: ts, time,
            /// timestamp, each also with _us; pol, polarity, on. Arrays are read in place: strides,
            /// gaps and byte order are free; only durations in units other than microseconds are
            /// converted first. Empty lists contain no events. While many events are pushed, other
            /// threads run, and Ctrl-C raises `KeyboardInterrupt` between two events: the events
            /// before have then been inserted.
            ///
            /// Raises `InputError` or `DtypeError` before the first event is inserted.
            #[pyo3(signature = (*args, **keywords), text_signature = "($self, events=None, *, t=None, x=None, y=None, p=None)")]
            fn push<'py>(
                slf: &Bound<'_, Self>,
                py: Python<'py>,
                args: &Bound<'py, PyTuple>,
                keywords: Option<&Bound<'py, PyDict>>,
            ) -> Outcome<usize> {
                let mut this = turn(slf)?;
                let events = Events::of_call(args, keywords)?;
                let restarts = this.engine.event_counters().restarts;
                let (engine, mut accepted) = (&mut this.engine, 0);
                events.work(py, |part| {
                    accepted += engine.push_slice(part);
                    Ok(())
                })?;
                if accepted < events.len() || this.engine.event_counters().restarts > restarts {
                    this.warn_of_losses(py)?;
                }
                Ok(accepted)
            }

            /// Advances the clock to `t_us` without an event: older events expire. Earlier times
            /// change nothing.
            fn advance(slf: &Bound<'_, Self>, t_us: i64) -> Outcome<()> {
                let mut this = turn(slf)?;
                this.engine.advance(t_us);
                Ok(())
            }

            /// The prediction for the current window. Raises `NotANumberError`.
            fn predict(slf: &Bound<'_, Self>, py: Python<'_>) -> Outcome<Prediction> {
                let mut this = turn(slf)?;
                let Self { engine, outputs, .. } = &mut *this;
                prediction::computed(py, engine, None, outputs)
            }

            /// Removes all events; the next one sets a new epoch. Counters are kept.
            fn reset(slf: &Bound<'_, Self>) -> Outcome<()> {
                let mut this = turn(slf)?;
                this.engine.reset();
                Ok(())
            }

            /// Counts since it was made: events, rows by layer (a `Batch` recomputes each),
            /// predictions.
            #[getter]
            fn counters<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
                let this = turn(slf)?;
                counters(py, &this.engine.counters(), &this.outputs.layers)
            }

            /// (width, height) of the sensor.
            #[getter]
            fn sensor(slf: &Bound<'_, Self>) -> Outcome<(u16, u16)> {
                let this = turn(slf)?;
                Ok(sides(this.$field$(.$part())+))
            }

            /// Current time in microseconds: that of the newest event, or of a later `advance`;
            /// None before the first event.
            #[getter]
            fn now_us(slf: &Bound<'_, Self>) -> Outcome<Option<i64>> {
                let this = turn(slf)?;
                Ok(this.engine.now_us())
            }

            fn __len__(slf: &Bound<'_, Self>) -> Outcome<usize> {
                let this = turn(slf)?;
                Ok(this.engine.nodes())
            }

            fn _repr_html_(slf: &Bound<'_, Self>) -> Outcome<String> {
                let this = turn(slf)?;
                let engine = &this.engine;
                let title =
                    format!("{} {:?} on {}", stringify!($class), engine.network().name(), this.$field$(.$part())+);
                let now = engine.now_us().map_or("none yet".to_owned(), |t_us| format!("{t_us} us"));
                let mut rows = vec![
                    ["predicts".to_owned(), this.outputs.labels()],
                    ["events in the window".to_owned(), engine.nodes().to_string()],
                    ["time".to_owned(), now],
                ];
                rows.extend(rows_of_events(*engine.event_counters()));
                $(rows.push(["state".to_owned(), format!("{} bytes", engine.$bytes())]);)?
                Ok(html_table(&title, &rows))
            }

            fn __repr__(slf: &Bound<'_, Self>) -> Outcome<String> {
                let this = turn(slf)?;
                let (class, name, sensor) =
                    (stringify!($class), this.engine.network().name(), this.$field$(.$part())+);
                let (nodes, labels) = (this.engine.nodes(), this.outputs.labels());
                Ok(format!("<{class} {name:?} on {sensor}: {nodes} events, predicts {labels}>"))
            }
        }
    };
}

/// Methods of each representation of events that advances in time. They use its field `$field`.
macro_rules! representation {
    ($class:ident, $field:ident) => {
        #[pymethods]
        impl $class {
            /// Forgets time and all events. Counters are kept.
            fn reset(slf: &Bound<'_, Self>) -> Outcome<()> {
                let mut this = turn(slf)?;
                this.$field.reset();
                Ok(())
            }

            /// (channels, height, width) of every frame.
            #[getter]
            fn shape(slf: &Bound<'_, Self>) -> Outcome<(usize, usize, usize)> {
                let this = turn(slf)?;
                Ok(this.$field.shape().into())
            }

            /// Counts of the events so far.
            #[getter]
            fn counters<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
                let this = turn(slf)?;
                counted(py, this.$field.counters(), this.$field.outside_crop())
            }

            fn __repr__(slf: &Bound<'_, Self>) -> Outcome<String> {
                let this = turn(slf)?;
                let (class, accepted) = (stringify!($class), this.$field.counters().accepted);
                Ok(format!("<{class} {:?}: {accepted} events>", this.$field.shape()))
            }
        }
    };
}

/// Methods of a representation that can be read at any time. They use its field `$field`.
macro_rules! sliding_representation {
    ($class:ident, $field:ident) => {
        representation!($class, $field);

        #[pymethods]
        impl $class {
            /// Takes events, as `Engine.push`.
            #[pyo3(signature = (*args, **keywords), text_signature = "($self, events=None, *, t=None, x=None, y=None, p=None)")]
            fn push<'py>(
                slf: &Bound<'_, Self>,
                py: Python<'py>,
                args: &Bound<'py, PyTuple>,
                keywords: Option<&Bound<'py, PyDict>>,
            ) -> Outcome<()> {
                let mut this = turn(slf)?;
                let $field = &mut this.$field;
                Events::of_call(args, keywords)?.each(py, |event| _ = $field.push(event))
            }

            /// Advances time to `t_us`: older events leave.
            fn advance(slf: &Bound<'_, Self>, t_us: i64) -> Outcome<()> {
                let mut this = turn(slf)?;
                this.$field.advance(t_us);
                Ok(())
            }
        }
    };
}

pub(crate) use {engine_methods, engine_over_events, representation, sliding_representation};

/// A table with a title, of rows of texts.
pub(crate) fn html_table<const N: usize>(title: &str, rows: &[[String; N]]) -> String {
    let mut html = format!("<table><caption>{}</caption><tbody>", escaped(title));
    for row in rows {
        html.push_str("<tr>");
        for (i, cell) in row.iter().enumerate() {
            let tag = if i == 0 { "th" } else { "td" };
            let _ = write!(html, "<{tag} style=\"text-align:left\">{}</{tag}>", escaped(cell));
        }
        html.push_str("</tr>");
    }
    html + "</tbody></table>"
}

/// The rows of an engine's counts: pushed events, and lost ones by reason.
pub(crate) fn rows_of_events(events: EventCounters) -> Vec<[String; 2]> {
    let mut rows = vec![["events pushed".to_owned(), events.pushed.to_string()]];
    let lost = [
        ("outside the sensor, dropped", events.outside_sensor),
        ("late, dropped", events.late),
        ("time out of range, dropped", events.time_out_of_range),
        ("far ahead, dropped", events.outliers),
        ("by the network's filters, dropped", events.filtered),
        ("late, with the newest time", events.clamped),
        ("restarts of the sensor's clock", events.restarts),
    ];
    let lost = lost.into_iter().filter(|(_, count)| *count > 0);
    rows.extend(lost.map(|(name, count)| [name.to_owned(), count.to_string()]));
    rows
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
