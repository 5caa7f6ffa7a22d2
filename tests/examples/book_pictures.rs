//! Draws the pictures of the page on concepts, from the embedded press.
//!
//! ```text
//! cargo run --release -p meissner-tests --example book_pictures
//! ```
//!
//! Input: `run/assets/dome_press.evt3`. Output: `docs/concepts/*.svg`, equal bytes at each run.

use std::collections::BTreeSet;
use std::error::Error;
use std::fs;
use std::path::Path;

use meissner_engine::{Batch, Engine, Event, Options, Sensor, Stream};
use meissner_models::{Description, Weights, draw};
use meissner_plot::{Panel, Plane, Series, Style, page};

/// Time at which the window is shown, in microseconds since the first event, and its length.
const NOW_US: i64 = 100_000;
const SPAN_US: i64 = 50_000;

/// Three blocks of 8 neighbours; `graph` states from which events they are chosen, and for how
/// long.
fn network(graph: &str) -> String {
    let blocks = (1..=3).map(|i| {
        format!(
            "[[layer]]\nname = \"block{i}\"\nkind = \"spline\"\nchannels = 4\nkernel = 2\nroot = true\n\n"
        )
    });
    format!(
        "[network]\nname = \"book\"\nspan_us = {SPAN_US}\ncapacity = 8192\n\n[graph]\nkind = \"knn\"\nk = 8\n{graph}\nscale = \
         0.1\n\n{}[[layer]]\nname = \"readout\"\nkind = \"readout\"\ngrid = [4, 4]\n\n[[layer]]\nname = \
         \"out\"\nkind = \"dense\"\noutputs = 1\n\n[output]\nnames = [\"value\"]\nunit = \"one\"\n",
        blocks.collect::<String>()
    )
}

fn engine(graph: &str, sensor: Sensor) -> Result<Engine, Box<dyn Error>> {
    let description = Description::parse(&network(graph))?;
    let network = description.network(&draw(&description, 7))?;
    Ok(Engine::with_options(network, sensor, Options::new().with_record_rows(true))?)
}

fn plane(title: &str, about: &str, axes: [&str; 2], series: Vec<Series>) -> Panel<'static> {
    Panel::Plane(Plane { about: about.to_owned(), series, ..Plane::new(title, axes) })
}

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let recording = meissner_io::read(&root.join("run/assets/dome_press.evt3"))?;
    let sensor = recording.sensor.ok_or("the recording names its sensor")?;
    let first_us = recording.events[0].t_us;
    let events: Vec<Event> =
        recording.events.iter().map(|event| Event { t_us: event.t_us - first_us, ..*event }).collect();
    let seen = &events[..events.partition_point(|event| event.t_us <= NOW_US)];
    for (name, svg) in [
        ("window", window(&events)),
        ("graph", graph(seen, sensor)?),
        ("rows", rows(seen, sensor)?),
        ("pooling", pooling(seen)),
        ("exactness", exactness(&events, sensor)?),
    ] {
        fs::write(root.join(format!("docs/concepts/{name}.svg")), svg)?;
    }
    Ok(())
}

/// Events of a strip of rows over time: events that have left, are in the window, or will come.
fn window(events: &[Event]) -> String {
    let strip = events.iter().filter(|event| (127..=128).contains(&event.y)).step_by(2);
    let place = |event: &&Event| (event.t_us as f64 / 1e3, f64::from(event.x));
    let of = |name: &str, colour, from: i64, until: i64| {
        let points = strip.clone().filter(|event| (from..until).contains(&event.t_us));
        Series::new(name, colour, Style::Dots, points.map(|event| place(&event)).collect())
    };
    let end = |t_us: i64| vec![(t_us as f64 / 1e3, 0.0), (t_us as f64 / 1e3, 346.0)];
    let series = vec![
        of("have left", 5, 0, NOW_US - SPAN_US),
        of("in the window", 0, NOW_US - SPAN_US, NOW_US),
        of("will come", 4, NOW_US, 140_000),
        Series::new("", 3, Style::Line, end(NOW_US - SPAN_US)),
        Series::new("", 3, Style::Line, end(NOW_US)),
    ];
    let about = "events of two rows of pixels; the window is the last 50 ms, between the lines";
    page("The window", "a simulated press", &[vec![plane("Events", about, ["time (ms)", "column"], series)]])
}

/// The newest event with its neighbours, and their neighbours, among the events near it.
fn graph(seen: &[Event], sensor: Sensor) -> Result<String, Box<dyn Error>> {
    let mut engine = engine("candidates = \"past\"\nlifetime = \"window\"", sensor)?;
    engine.push_slice(seen);
    let held = engine.events();
    let last = held.len() - 1;
    let place = |i: usize| (f64::from(held[i].x), f64::from(held[i].y));
    let edges = |of: usize, name: &str, colour, style| {
        let neighbours = engine.neighbourhood(of).into_iter();
        neighbours
            .enumerate()
            .map(|(i, to)| {
                let name = if i == 0 { name } else { "" };
                Series::new(name, colour, style, vec![place(of), place(to.row as usize)])
            })
            .collect::<Vec<_>>()
    };
    let first_ring: Vec<usize> =
        engine.neighbourhood(last).iter().map(|neighbour| neighbour.row as usize).collect();
    let mut series = Vec::new();
    for (i, &of) in first_ring.iter().enumerate() {
        series.extend(edges(of, if i == 0 { "edges of its neighbours" } else { "" }, 4, Style::Dashed));
    }
    series.extend(edges(last, "edges of the newest event", 3, Style::Line));
    let (x, y) = place(last);
    let is_near = |&i: &usize| (place(i).0 - x).abs() <= 26.0 && (place(i).1 - y).abs() <= 14.0;
    // Older events would cover these; edges to them end without a dot.
    let is_new = |&i: &usize| held[i].t_us > NOW_US - 8_000;
    let points = (0..last).filter(is_near).filter(is_new);
    series.push(Series::new("other events", 5, Style::Dots, points.map(place).collect()));
    let members = first_ring.iter().map(|&i| place(i)).collect();
    series.push(Series::new("neighbours", 0, Style::Marks, members));
    series.push(Series::new("newest event", 1, Style::Marks, vec![place(last)]));
    let about = "the nearest 8 of the events before it, in column, row and time together";
    Ok(page(
        "The graph",
        "a simulated press",
        &[vec![plane("Around the newest event", about, ["column", "row"], series)]],
    ))
}

/// Rows that one event recomputes, with each kind of graph.
fn rows(seen: &[Event], sensor: Sensor) -> Result<String, Box<dyn Error>> {
    let panel = |title: &str, graph: &str| -> Result<Panel<'static>, Box<dyn Error>> {
        let mut engine = engine(graph, sensor)?;
        let (newest, before) = seen.split_last().ok_or("there are events")?;
        engine.push_slice(before);
        engine.predict()?;
        engine.push(*newest);
        engine.predict()?;
        let (held, changed) = (engine.events(), engine.recomputed());
        let near = |i: usize| held[i].x.abs_diff(newest.x) <= 20 && held[i].y.abs_diff(newest.y) <= 16;
        // A pixel is drawn once, by the first layer whose row of one of its events is recomputed.
        let mut drawn = BTreeSet::new();
        let mut pixels = |rows: &mut dyn Iterator<Item = usize>| {
            let new =
                rows.filter(|&i| near(i)).map(|i| (held[i].x, held[i].y)).filter(|at| drawn.insert(*at));
            new.map(|(x, y)| (f64::from(x), f64::from(y))).collect::<Vec<_>>()
        };
        let names = ["from layer 1 on", "from layer 2 on", "from layer 3 on"];
        let mut series = Vec::new();
        for ((rows, name), colour) in changed.iter().zip(names).zip([3, 1, 4]) {
            let points = pixels(&mut rows.iter().copied());
            if !points.is_empty() {
                series.push(Series::new(name, colour, Style::Marks, points));
            }
        }
        series.insert(0, Series::new("kept", 5, Style::Dots, pixels(&mut (0..held.len()))));
        let count: usize = changed.iter().take(3).map(Vec::len).sum();
        let about = format!("one event recomputes {count} of {} rows of three layers", 3 * held.len());
        Ok(plane(title, &about, ["column", "row"], series))
    };
    let panels = vec![
        panel("Neighbours before and after", "candidates = \"all\"")?,
        panel("Earlier neighbours, frozen", "candidates = \"past\"\nlifetime = \"frozen\"")?,
    ];
    Ok(page("Rows that an event changes", "pixels around the newest event", &[panels]))
}

/// Events in cells of 16 x 16 pixels, and the mean of each cell.
fn pooling(seen: &[Event]) -> String {
    const CELL: u16 = 16;
    let (left, top, cells) = (128, 96, 5);
    let (right, bottom) = (left + cells * CELL, top + cells * CELL);
    let held = seen.iter().filter(|event| event.t_us > NOW_US - 6_000);
    let inside: Vec<&Event> =
        held.filter(|event| (left..right).contains(&event.x) && (top..bottom).contains(&event.y)).collect();
    let mut series = Vec::new();
    for i in 0..=cells {
        let [x, y] = [left + i * CELL, top + i * CELL].map(f64::from);
        let name = if i == 0 { "borders of cells" } else { "" };
        let (l, r, t, b) = (f64::from(left), f64::from(right), f64::from(top), f64::from(bottom));
        series.push(Series::new(name, 5, Style::Line, vec![(x, t), (x, b)]));
        series.push(Series::new("", 5, Style::Line, vec![(l, y), (r, y)]));
    }
    let points = inside.iter().map(|event| (f64::from(event.x) + 0.5, f64::from(event.y) + 0.5));
    series.push(Series::new("events", 0, Style::Dots, points.collect()));
    let cell = |event: &&Event| ((event.x - left) / CELL, (event.y - top) / CELL);
    let all = (0..cells).flat_map(|row| (0..cells).map(move |column| (column, row)));
    let means = all.filter_map(|at| {
        let members: Vec<_> = inside.iter().filter(|event| cell(event) == at).collect();
        let mean = |of: fn(&Event) -> u16| {
            members.iter().map(|event| f64::from(of(event)) + 0.5).sum::<f64>() / members.len() as f64
        };
        (!members.is_empty()).then(|| (mean(|event| event.x), mean(|event| event.y)))
    });
    series.push(Series::new("node of a cell, at their mean", 3, Style::Marks, means.collect()));
    let about = "the events of 6 ms; a cell with an event is one node of the next level";
    page(
        "Pooling",
        "a simulated press",
        &[vec![plane("Cells of 16 x 16 pixels", about, ["column", "row"], series)]],
    )
}

/// Predictions of the engine, event by event, and of full recomputation: equal bits.
fn exactness(events: &[Event], sensor: Sensor) -> Result<String, Box<dyn Error>> {
    let description = Description::shipped("tactigraph-past").ok_or("it is shipped")?;
    let weights = Weights::shipped("tactigraph-past").ok_or("it has weights")?;
    let mut engine = Engine::new(description.network(&weights)?, sensor)?;
    let batch_of = Batch::new(engine.network().clone(), sensor)?;
    let (mut lines, mut dots) = ([Vec::new(), Vec::new()], [Vec::new(), Vec::new()]);
    let mut taken = 0;
    for t_us in (10_000..300_000).step_by(5_000) {
        let until = events.partition_point(|event| event.t_us <= t_us);
        engine.push_slice(&events[taken..until]);
        taken = until;
        engine.advance(t_us);
        let found = engine.predict()?.values.to_vec();
        let ms = t_us as f64 / 1e3;
        for (line, &value) in lines.iter_mut().zip(&found) {
            line.push((ms, f64::from(value).to_degrees()));
        }
        if t_us % 20_000 == 0 {
            let stream = Stream { now_us: t_us, ..Stream::new(&events[..until]) };
            let full = batch_of.forward(stream)?.prediction;
            assert!(found.iter().zip(&full).all(|(a, b)| a.to_bits() == b.to_bits()), "{t_us}");
            for (dots, &value) in dots.iter_mut().zip(&full) {
                dots.push((ms, f64::from(value).to_degrees()));
            }
        }
    }
    let [roll, pitch] = lines;
    let [full_roll, full_pitch] = dots;
    let series = vec![
        Series::new("roll, event by event", 0, Style::Line, roll),
        Series::new("pitch, event by event", 1, Style::Line, pitch),
        Series::new("from scratch: equal in every bit", 3, Style::Marks, [full_roll, full_pitch].concat()),
    ];
    let about = "tactigraph-past over the press; the program that drew this compared all bits";
    Ok(page(
        "Exactness",
        "",
        &[vec![plane("Two ways to one answer", about, ["time (ms)", "angle (degrees)"], series)]],
    ))
}
