//! Every variant of every shape, timed beside the engine's rows; then the changes that events of a recording cause.

use std::hint::black_box;
use std::sync::Arc;

use meissner_benches::answers::Deviation;
use meissner_benches::report::{Column, Digits, print_markdown_head, print_markdown_row};
use meissner_benches::timing::interleaved_ns;
use meissner_benches::{networks, streams};
use meissner_engine::{Network, Stream};
use meissner_kernels::{Lanes, Matrix, SplineScratch};
use pulp::x86::V4;
use serde_json::{Value, json};

use crate::format::{Bytes, Float, Format, Fours, Halves, Pairs, Words};
use crate::problem::{Problem, ROWS, Rounded, Span, flat};
use crate::rows::{ByTable, I16, Rows, Stage, Width};
use crate::wave;

/// Channels read, channels written, in-edges.
const SHAPES: [[usize; 3]; 8] = [
    [8, 16, 8],
    [8, 16, 16],
    [16, 16, 8],
    [16, 16, 16],
    [16, 32, 8],
    [16, 32, 16],
    [32, 32, 8],
    [32, 32, 16],
];
/// Levels an axis that attributes are rounded to.
const LEVELS: [usize; 4] = [3, 5, 9, 17];
/// Changed in-edges of a row.
const CHANGED: [usize; 5] = [1, 2, 4, 8, 16];
/// Places in the recording, and events from each.
const PLACES: usize = 6;
const EVENTS: usize = 50;

const COLUMNS: [Column; 8] = [
    ("shape", "shape, in-edges", Digits::Fixed(0)),
    ("name", "row", Digits::Fixed(0)),
    ("ns", "ns", Digits::Fixed(1)),
    ("ratio", "ratio", Digits::Fixed(2)),
    ("multiply_adds", "multiply-adds", Digits::Fixed(0)),
    ("kib", "weights, KiB", Digits::Fixed(0)),
    ("max", "error, max", Digits::Exponent),
    ("rms", "error, RMS", Digits::Exponent),
];
const WAVE_COLUMNS: [Column; 8] = [
    ("layer", "layer", Digits::Fixed(0)),
    ("width", "activations", Digits::Fixed(0)),
    ("dirty", "dirty rows an event", Digits::Fixed(1)),
    ("edges", "in-edges", Digits::Fixed(1)),
    ("changed", "changed", Digits::Fixed(1)),
    ("share", "changed, %", Digits::Fixed(0)),
    ("few", "few changed, % of rows", Digits::Fixed(0)),
    ("unchanged", "unchanged, % of rows", Digits::Fixed(1)),
];

/// Runs all shapes, then the recording.
pub(crate) fn run() {
    let Some(v) = V4::try_new() else {
        println!("skipped: the integer rows need AVX-512 (F, VL, DQ, BW)");
        return;
    };
    let vnni =
        if cfg!(target_feature = "avx512vnni") { "one instruction (VNNI)" } else { "two instructions" };
    let (network, ..) = networks::published_graphres();
    let window = streams::window();
    let batch = networks::grid_batch(&network, window.sensor);
    let trace = batch.forward(Stream::new(&window.events)).expect("finite");
    println!("integer products are added in {vnni}\n");
    print_markdown_head(&COLUMNS);
    for shape in SHAPES {
        let problem = Problem::new(&trace, shape);
        match shape {
            [8, ..] => all_rows::<8, 1>(v, &problem),
            [16, 16, _] => all_rows::<16, 1>(v, &problem),
            [16, ..] => all_rows::<16, 2>(v, &problem),
            _ => all_rows::<32, 2>(v, &problem),
        }
    }
    waves(&network);
}

/// Lines of the table and their calls. Ratios are to the first one's time.
#[derive(Default)]
struct Lines<'a> {
    lines: Vec<Value>,
    calls: Vec<Box<dyn FnMut() + 'a>>,
}

impl<'a> Lines<'a> {
    /// `counts`: multiply-adds of a row, and bytes of weights.
    fn add(
        &mut self,
        name: impl Into<String>,
        [multiply_adds, bytes]: [usize; 2],
        deviation: Option<Deviation>,
        call: impl FnMut() + 'a,
    ) {
        let [max, rms] = [deviation.map(|d| d.max), deviation.map(|d| d.rms)];
        let (name, kib) = (name.into(), bytes as f64 / 1024.0);
        self.lines.push(json!({
            "name": name, "multiply_adds": multiply_adds, "kib": kib, "max": max, "rms": rms,
        }));
        self.calls.push(Box::new(call));
    }

    /// Times all and prints them.
    fn print(mut self, shape: &str) {
        for (mut line, [ns, ratio]) in self.lines.into_iter().zip(interleaved_ns(&mut self.calls)) {
            line["shape"] = shape.into();
            (line["ns"], line["ratio"]) = (json!(ns / ROWS as f64), json!(ratio));
            print_markdown_row(&COLUMNS, &line);
        }
    }
}

/// All variants of `problem`, C -> 16 B channels.
fn all_rows<const C: usize, const B: usize>(v: V4, problem: &Problem) {
    let shape = format!("{C} -> {}, {}", 16 * B, problem.degree);
    let expected = problem.answer(&problem.edges, &problem.basis);
    let this = Variants::<C, B> { v, problem, expected: &expected };

    let mut lines = Lines::default();
    this.engine(&mut lines, true);
    this.narrow::<Float<Words>>(&mut lines, Width::F32, 1e-5, "f32, this code");
    this.narrow::<Float<Halves>>(&mut lines, Width::F32, 0.05, "bf16 weights");
    this.narrow::<Float<Bytes>>(&mut lines, Width::F32, 0.05, "i8 weights, f32 sums");
    this.narrow::<I16>(&mut lines, Width::I16, 0.3, "i16 x, i16 sums, i8 weights");
    // 256 products of 4095 and 2047 fit an i32.
    this.narrow::<Pairs<4_095, 2_047>>(&mut lines, Width::I16, 0.3, "i16 x, 13-bit sums, 12-bit weights");
    this.narrow::<I16>(&mut lines, Width::I8, 0.3, "i8 x, i16 sums, i8 weights");
    this.narrow::<Fours>(&mut lines, Width::I8, 0.3, "i8 x, 7-bit sums, i8 weights");
    lines.print(&shape);

    let mut lines = Lines::default();
    this.engine(&mut lines, true);
    this.engine(&mut lines, false);
    for levels in LEVELS {
        this.tables(&mut lines, levels, Span::Whole, "of 0 to 1");
        this.tables(&mut lines, levels, Span::Occurring, "of what occurs");
    }
    lines.print(&shape);

    let mut lines = Lines::default();
    this.updates(&mut lines);
    lines.print(&shape);
}

/// The variants of a problem, whose answer is `expected`.
struct Variants<'a, const C: usize, const B: usize> {
    v: V4,
    problem: &'a Problem,
    expected: &'a Matrix,
}

impl<'a, const C: usize, const B: usize> Variants<'a, C, B> {
    fn rows<F: Format>(&self, width: Width) -> Rows<F, C, B> {
        Rows::new(self.v, self.problem, width, self.expected)
    }

    /// The distance of values, all of whole lanes, from the engine's answer.
    fn deviation(&self, found: impl IntoIterator<Item = f32>) -> Deviation {
        Deviation::between(&flat(self.expected), &found.into_iter().collect::<Vec<_>>())
    }

    /// The engine's rows, the basis at hand or not.
    fn engine(&self, lines: &mut Lines<'a>, at_hand: bool) {
        let [sums, weights] = self.problem.multiply_adds();
        let name = if at_hand { "engine, f32, basis at hand" } else { "engine, f32, basis computed" };
        let (mut scratch, mut out) = (SplineScratch::default(), self.expected.clone());
        let problem = self.problem;
        lines.add(name, [sums + weights, 4 * weights], None, move || {
            let basis = at_hand.then_some(&problem.basis[..]);
            problem.engine(&problem.edges, basis, &mut scratch, black_box(&mut out));
        });
    }

    /// A number format: whole rows, then their stages; `most` is the largest error that is accepted.
    fn narrow<F: Format + 'a>(&self, lines: &mut Lines<'a>, width: Width, most: f64, name: &str) {
        let made = || {
            let mut rows = self.rows::<F>(width);
            rows.run(Stage::Whole);
            rows
        };
        let mut rows = made();
        let deviation = self.deviation(rows.values());
        assert!(deviation.max < most, "{name}: error {}", deviation.max);
        let ([sums, weights], bytes) = (self.problem.multiply_adds(), rows.bytes());
        lines.add(name, [sums + weights, bytes], Some(deviation), move || rows.run(Stage::Whole));
        for (stage, part, count) in
            [(Stage::Sums, "sums", sums), (Stage::Contraction, "contraction", weights)]
        {
            // Sums do not read weights: those beside narrower ones in f32 are the control's.
            if stage == Stage::Contraction || size_of::<F::Weights>() == size_of::<Words>() {
                let mut rows = made();
                lines.add(format!("... {part} alone"), [count, bytes], None, move || rows.run(stage));
            }
        }
    }

    /// Attributes on a grid: weights and basis from tables, whose rows must be the same.
    fn tables(&self, lines: &mut Lines<'a>, levels: usize, span: Span, of: &str) {
        let (problem, rounded) = (self.problem, Rounded::new(self.problem, levels, span));
        let mut basis = Vec::new();
        rounded.look_up(&mut basis);
        let answer = problem.answer(&rounded.edges, &basis);
        let rows = self.rows::<Float<Words>>(Width::F32);
        let mut table = ByTable::new(&rows, problem, &rounded, problem.degree, false);
        table.run();
        let between = Deviation::between(&flat(&answer), &table.out).max;
        assert!(between < 1e-5, "by weights and by basis differ by {between}");
        let off = Some(self.deviation(flat(&answer)));
        let [sums, weights] = problem.multiply_adds();
        let counts = [problem.degree * C * 16 * B, table.bytes()];
        lines.add(format!("weights from a table, {levels} levels {of}"), counts, off, move || table.run());
        if span == Span::Occurring {
            let counts = [sums + weights, 4 * weights + size_of::<Lanes>() * rounded.bases.len()];
            let (mut scratch, mut out) = (SplineScratch::default(), answer);
            lines.add(format!("basis from a table, {levels} levels {of}"), counts, off, move || {
                rounded.look_up(&mut basis);
                problem.engine(&rounded.edges, Some(&basis), &mut scratch, black_box(&mut out));
            });
        }
    }

    /// Rows in integers, updated for some changed in-edges.
    fn updates(&self, lines: &mut Lines<'a>) {
        let (problem, [sums, weights]) = (self.problem, self.problem.multiply_adds());
        let mut whole = self.rows::<I16>(Width::I8);
        let bytes = whole.bytes();
        lines.add("i8 x, recomputed", [sums + weights, bytes], None, move || whole.run(Stage::Whole));
        let rounded = Rounded::new(problem, 5, Span::Occurring);
        for changed in CHANGED.into_iter().filter(|&changed| changed <= problem.degree) {
            let mut slots = self.rows::<I16>(Width::I8);
            let mut table = ByTable::new(&slots, problem, &rounded, changed, true);
            table.check_update();
            slots.update_by_slots(problem, changed);
            let counts = [2 * changed * 8 * C + weights, bytes];
            lines.add(format!("i8 x, {changed} changed, by slots"), counts, None, move || {
                slots.run(Stage::Whole);
            });
            let counts = [changed * C * 16 * B, table.bytes()];
            let name = format!("i8 x, {changed} changed, by table of 5 levels");
            lines.add(name, counts, None, move || table.run());
        }
    }
}

/// Prints the changes that events cause, layer by layer.
fn waves(network: &Arc<Network>) {
    let recording =
        streams::Recording::load("tactile_dots").unwrap_or_else(|| streams::Recording::synthetic(20_000));
    let places: Vec<usize> = (1..=PLACES).map(|i| recording.events.len() * i / (PLACES + 1)).collect();
    let waves = wave::waves(network, &recording, &places, EVENTS);
    let events = (PLACES * EVENTS) as f64;
    println!("\n{}, {events} events at {PLACES} places, a prediction after each\n", recording.name);
    print_markdown_head(&WAVE_COLUMNS);
    let names: Vec<&str> = network.layers().into_iter().filter(|name| !name.starts_with("pool")).collect();
    for (layer, name) in names.iter().enumerate() {
        for (width, waves) in ["f32", "i16", "i8"].iter().zip(&waves) {
            let w = waves.layers[layer];
            let [stayed, edges, changed] = [w.stayed, w.edges, w.changed].map(|n| n as f64);
            let row = json!({
                "layer": name, "width": width, "dirty": w.dirty as f64 / events, "edges": edges / stayed,
                "changed": changed / stayed, "share": 100.0 * changed / edges,
                "few": 100.0 * w.few as f64 / stayed, "unchanged": 100.0 * w.unchanged as f64 / stayed,
            });
            print_markdown_row(&WAVE_COLUMNS, &row);
        }
    }
    for (width, waves) in ["i16", "i8"].iter().zip(&waves[1..]) {
        let most = |of: fn(&Deviation) -> f64| waves.deviations.iter().map(of).fold(0.0, f64::max);
        let (max, rms) = (most(|d| d.max), most(|d| d.rms));
        println!(
            "\n{width} x: error of the last layer at the worst of the places, max {max:.1e}, RMS {rms:.1e}"
        );
    }
}
