//! Every variant of every shape, timed beside the engine's rows; then the changes that events of a recording cause.

use std::hint::black_box;

use meissner_benches::answers::Deviation;
use meissner_benches::report::{Column, Digits, print_markdown_head, print_markdown_row};
use meissner_benches::timing::interleaved_ns;
use meissner_benches::{networks, streams};
use meissner_engine::Stream;
use meissner_kernels::{Lanes, Matrix, SplineScratch};
use pulp::x86::V4;
use serde_json::{Value, json};

use crate::problem::{Problem, ROWS, Ranges, Rounded, flat};
use crate::rows::{Rows, Stage};
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

/// Activations with as many steps of their largest magnitude as an i16 or an i8 has, and the steps of 1 of their basis.
pub(crate) const I16: [f32; 2] = [32_767.0, 2_048.0];
pub(crate) const I8: [f32; 2] = [127.0, 128.0];

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
    wave::print(&network);
}

/// Prints all variants of `problem`, C -> 16 B channels.
fn all_rows<const C: usize, const B: usize>(v: V4, problem: &Problem) {
    let expected = problem.answer(&problem.edges, &problem.basis);
    let mut variants = Variants::<C, B> { v, problem, expected: &expected, lines: vec![], calls: vec![] };
    let float = |weight| Ranges { weight, ..Ranges::default() };
    let integer = |steps, weight, sum| Ranges { steps: Some(steps), weight: Some(weight), sum };

    variants.engine(true);
    variants.narrow::<false, 4>("f32, this code", float(None), 1e-5);
    variants.narrow::<false, 2>("bf16 weights", float(None), 0.05);
    variants.narrow::<false, 1>("i8 weights, f32 sums", float(Some(127.0)), 0.05);
    variants.narrow::<true, 2>("i16 x, i16 sums, i8 weights", integer(I16, 127.0, 32_767), 0.3);
    // 256 products of 4095 and 2047 fit an i32.
    variants.narrow::<true, 2>("i16 x, 13-bit sums, 12-bit weights", integer(I16, 2_047.0, 4_095), 0.3);
    variants.narrow::<true, 2>("i8 x, i16 sums, i8 weights", integer(I8, 127.0, 32_767), 0.3);
    variants.narrow::<true, 1>("i8 x, 7-bit sums, i8 weights", integer(I8, 127.0, 63), 0.3);
    variants.print();

    variants.engine(true);
    variants.engine(false);
    for levels in LEVELS {
        variants.tables(levels, false);
        variants.tables(levels, true);
    }
    variants.print();

    variants.updates(integer(I8, 127.0, 32_767));
    variants.print();
}

/// The variants of a problem, whose answer is `expected`: lines of the table and their calls. Ratios are to the first one's
/// time.
struct Variants<'a, const C: usize, const B: usize> {
    v: V4,
    problem: &'a Problem,
    expected: &'a Matrix,
    lines: Vec<Value>,
    calls: Vec<Box<dyn FnMut() + 'a>>,
}

impl<'a, const C: usize, const B: usize> Variants<'a, C, B> {
    /// Adds a line. `found`: values in whole lanes, to compare with the answer.
    fn add(
        &mut self,
        name: impl Into<String>,
        [multiply_adds, bytes]: [usize; 2],
        found: Option<Vec<f32>>,
        call: impl FnMut() + 'a,
    ) {
        let deviation = found.map(|found| Deviation::between(&flat(self.expected), &found));
        self.lines.push(json!({
            "shape": format!("{C} -> {}, {}", 16 * B, self.problem.degree), "name": name.into(),
            "multiply_adds": multiply_adds, "kib": bytes as f64 / 1024.0,
            "max": deviation.map(|d| d.max), "rms": deviation.map(|d| d.rms),
        }));
        self.calls.push(Box::new(call));
    }

    /// Times all lines and prints them.
    fn print(&mut self) {
        for (mut line, [ns, ratio]) in self.lines.drain(..).zip(interleaved_ns(&mut self.calls)) {
            (line["ns"], line["ratio"]) = (json!(ns / ROWS as f64), json!(ratio));
            print_markdown_row(&COLUMNS, &line);
        }
        self.calls.clear();
    }

    fn rows<const INTEGER: bool, const BYTES: usize>(&self, ranges: Ranges) -> Rows<C, B, INTEGER, BYTES> {
        Rows::new(self.v, self.problem, ranges, self.expected)
    }

    /// The engine's rows, the basis at hand or not.
    fn engine(&mut self, at_hand: bool) {
        let problem = self.problem;
        let [sums, weights] = problem.multiply_adds();
        let name = if at_hand { "engine, f32, basis at hand" } else { "engine, f32, basis computed" };
        let (mut scratch, mut out) = (SplineScratch::default(), self.expected.clone());
        self.add(name, [sums + weights, 4 * weights], None, move || {
            let basis = at_hand.then_some(&problem.basis[..]);
            problem.engine(&problem.edges, basis, &mut scratch, black_box(&mut out));
        });
    }

    /// A number format: whole rows, then their stages; `most` is the largest error that is accepted.
    fn narrow<const INTEGER: bool, const BYTES: usize>(&mut self, name: &str, ranges: Ranges, most: f64) {
        let [sums, weights] = self.problem.multiply_adds();
        let stages = [
            (Stage::Whole, name, sums + weights),
            (Stage::Sums, "... sums alone", sums),
            (Stage::Contraction, "... contraction alone", weights),
        ];
        for (stage, name, count) in stages {
            let mut rows = self.rows::<INTEGER, BYTES>(ranges);
            rows.run(Stage::Whole);
            let found = (stage == Stage::Whole).then(|| rows.values());
            // Sums do not read weights: those beside narrower ones in f32 are the control's.
            if INTEGER || BYTES == 4 || stage != Stage::Sums {
                self.add(name, [count, rows.bytes()], found, move || rows.run(stage));
            }
            let error = &self.lines[self.lines.len() - 1]["max"];
            assert!(error.is_null() || error.as_f64() < Some(most), "{name}: error {error}");
        }
    }

    /// Attributes on a grid: weights and basis from tables, whose rows must be the same.
    fn tables(&mut self, levels: usize, occurring: bool) {
        let (problem, rounded) = (self.problem, Rounded::new(self.problem, levels, occurring));
        let mut basis = Vec::new();
        rounded.look_up(&mut basis);
        let mut answer = problem.answer(&rounded.edges, &basis);
        let mut table = self.rows::<false, 4>(Ranges::default());
        table.look_up(problem, &rounded, problem.degree, false);
        table.run(Stage::ByTable);
        let between = Deviation::between(&flat(&answer), &table.values()).max;
        assert!(between < 1e-5, "by weights and by basis differ by {between}");
        let name = format!("{levels} levels {}", if occurring { "of what occurs" } else { "of 0 to 1" });
        let (found, [sums, weights]) = (Some(flat(&answer)), problem.multiply_adds());
        let counts = [problem.degree * C * 16 * B, table.bytes()];
        self.add(format!("weights from a table, {name}"), counts, found.clone(), move || {
            table.run(Stage::ByTable);
        });
        if occurring {
            let counts = [sums + weights, 4 * weights + size_of::<Lanes>() * rounded.bases.len()];
            let mut scratch = SplineScratch::default();
            self.add(format!("basis from a table, {name}"), counts, found, move || {
                rounded.look_up(&mut basis);
                problem.engine(&rounded.edges, Some(&basis), &mut scratch, black_box(&mut answer));
            });
        }
    }

    /// Rows in integers, updated for some changed in-edges.
    fn updates(&mut self, ranges: Ranges) {
        let (problem, [sums, weights]) = (self.problem, self.problem.multiply_adds());
        let mut whole = self.rows::<true, 2>(ranges);
        let bytes = whole.bytes();
        self.add("i8 x, recomputed", [sums + weights, bytes], None, move || whole.run(Stage::Whole));
        let rounded = Rounded::new(problem, 5, true);
        for changed in CHANGED.into_iter().filter(|&changed| changed <= problem.degree) {
            let [mut slots, mut table] = [(); 2].map(|()| self.rows::<true, 2>(ranges));
            slots.update_by_slots(problem, changed);
            table.update_by_table(problem, &rounded, changed);
            let counts = [2 * changed * 8 * C + weights, bytes];
            let name = format!("i8 x, {changed} changed, by slots");
            self.add(name, counts, None, move || slots.run(Stage::Whole));
            let counts = [changed * C * 16 * B, table.bytes()];
            let name = format!("i8 x, {changed} changed, by table of 5 levels");
            self.add(name, counts, None, move || table.run(Stage::ByTable));
        }
    }
}
